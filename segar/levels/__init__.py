"""Levels: what they are, the distributions that they are sampled from, and what is known about these distributions."""
