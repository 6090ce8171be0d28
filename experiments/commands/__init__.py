"""How commands start and stop: Hydra, process-wide defaults, signals."""
