"""Trains one agent, evaluates it, and leaves a run folder: ``python -m experiments.train levels=empty-hard seed=1``.

Settings: ``python -m experiments.train --help``. Several runs: ``--multirun seed=1,2,3``, side by side with
``hydra/launcher=joblib``.
"""

from experiments.commands.hydra_app import run_command
from experiments.commands.kernels import choose_kernels
from experiments.settings import RunConfig


def train(config: RunConfig) -> dict[str, float]:
    """Carries out the run; returns its final figures. Torch is imported here, after the settings were found right."""
    choose_kernels(config.determinism)
    from experiments.training.run import run

    return {key: value for key, value in run(config).summary.items() if isinstance(value, float)}


if __name__ == "__main__":
    run_command(train)
