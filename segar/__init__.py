"""SEGAR: a sandbox for research on generalization in reinforcement learning."""
