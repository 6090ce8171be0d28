"""Small tools that every room may use: whole-file writes, optional packages, threads, counter-based random numbers."""
