"""How commands start and stop: Hydra and its choices, process-wide defaults, signals.

The room may import segar and segar.experiments.settings. Others use its modules by name: ``hydra_app`` to run a command or to
compose settings, ``config_store`` for what Hydra knows, ``signals`` to stop a run. Whatever of it a command imports first, the
process gets the defaults of ``process_defaults`` then, before torch is imported.
"""

from segar.experiments.commands import process_defaults
