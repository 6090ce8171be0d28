"""Trains one agent, evaluates it, and leaves a run folder: ``python -m experiments.train levels=empty-hard seed=1``.

Settings: ``python -m experiments.train --help``. Several runs: ``--multirun seed=1,2,3``, side by side with
``hydra/launcher=joblib``.
"""

from collections.abc import Sequence

from experiments.commands.hydra_app import run_command
from experiments.commands.kernels import choose_kernels
from experiments.runs.run_folder import runs_root
from experiments.settings import RunConfig


def train(config: RunConfig) -> dict[str, float]:
    """Carries out the run; returns its final figures. Torch is imported here, after the settings were found right."""
    choose_kernels(config.determinism)
    from experiments.training.run import run

    return {key: value for key, value in run(config).summary.items() if isinstance(value, float)}


def announce(runs: Sequence[RunConfig], number: int) -> None:
    """Prints what a sweep is going to do, before its first run: how many runs, how long, and where they lie."""
    from experiments.reproduction.plan import measure_speeds, sweep_as_text

    print(sweep_as_text(runs, number, measure_speeds(runs_root(runs[0]))), flush=True)


if __name__ == "__main__":
    run_command(train, announce=announce)
