"""One run from settings to summary: :func:`segar.experiments.training.run.run`, its loop, and the progress that it shows."""
