"""Trains one agent, evaluates it, and leaves a run folder: ``segar train levels=empty-hard seed=1``.

Settings: ``segar train --help``. Several runs: ``--multirun seed=1,2,3``, side by side with
``hydra/launcher=joblib``.
"""

from collections.abc import Sequence

from segar.experiments.commands.hydra_app import run_command
from segar.experiments.commands.kernels import choose_kernels
from segar.experiments.runs.run_folder import runs_root
from segar.experiments.settings import RunConfig


def train(config: RunConfig) -> dict[str, float]:
    """Carries out the run; returns its final figures. Torch is imported here, after the settings were found right."""
    choose_kernels(config.determinism)
    from segar.experiments.training.run import run

    return {key: value for key, value in run(config).summary.items() if isinstance(value, float)}


def announce(runs: Sequence[RunConfig], number: int) -> None:
    """Prints what a sweep is going to do, before its first run: how many runs, how long, and where they lie."""
    from segar.experiments.reproduction.plan import measure_speeds, sweep_as_text

    print(sweep_as_text(runs, number, measure_speeds(runs_root(runs[0]))), flush=True)


def main() -> None:
    """The command, with what the command line states."""
    run_command(train, announce=announce)


if __name__ == "__main__":
    main()
