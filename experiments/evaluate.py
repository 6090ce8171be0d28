"""A trained agent on any levels: ``python -m experiments.evaluate run=FOLDER levels=objectsx3-hard n=100``.

``levels`` names a family, a distribution of your own (``module:attribute``) or a level file (``.npz`` or ``.json``), or
says ``train`` or ``test``: the run's own levels. What comes of it lies in ``evaluations/`` of the run folder:
``episodes.parquet``, ``summary.json``, the levels, and videos of the best, the median and the worst level.
"""

from pathlib import Path

from experiments.commands.command_line import run_from_command_line
from experiments.commands.kernels import choose_kernels
from experiments.runs.run_folder import read_config
from experiments.settings import EvaluateConfig


def evaluate(config: EvaluateConfig) -> None:
    """The command. Torch is imported here, after the settings were found right."""
    trained = read_config(Path(config.run).expanduser(), config.trusted)
    choose_kernels(trained.determinism)
    from experiments.evaluation import evaluator as evaluation

    evaluation.evaluate(config)


if __name__ == "__main__":
    run_from_command_line(evaluate, EvaluateConfig, __doc__)
