"""How commands start and stop: Hydra and its choices, process-wide defaults, signals.

The room may import segar and experiments.settings. Others use its modules by name: ``hydra_app`` to run a command or to compose
settings, ``config_store`` for what Hydra knows, ``process_defaults`` before torch is imported, ``signals`` to stop a run.
"""
