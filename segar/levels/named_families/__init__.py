"""The named level distributions."""
