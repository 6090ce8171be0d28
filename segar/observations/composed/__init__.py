"""Observations that are made of other observations: several at once, one of several, stacks, and the last actions."""
