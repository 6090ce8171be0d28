"""Training, evaluation and sweeps: from a Hydra config to a run folder."""
