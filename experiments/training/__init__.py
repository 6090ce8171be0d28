"""One run from settings to summary: training loop, checkpoints, progress."""
