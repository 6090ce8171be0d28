"""A trained agent on any levels: ``segar evaluate run=FOLDER levels=objectsx3-hard n=100``.

``levels`` names a family, a distribution of your own (``module:attribute``) or a level file (``.npz`` or ``.json``), or
says ``train`` or ``test``: the run's own levels. What comes of it lies in ``evaluations/`` of the run folder:
``episodes.parquet``, ``summary.json``, the levels, and videos of the best, the median and the worst level.
"""

from segar.experiments.commands.command_line import run_from_command_line
from segar.experiments.commands.kernels import choose_kernels
from segar.experiments.runs.files import absolute_path
from segar.experiments.runs.run_folder import read_config
from segar.experiments.settings import EvaluateConfig


def evaluate(config: EvaluateConfig) -> None:
    """The command. Torch is imported here, after the settings were found right."""
    trained = read_config(absolute_path(config.run), config.trusted)
    choose_kernels(trained.determinism)
    from segar.experiments.evaluation import evaluator as evaluation

    evaluation.evaluate(config)


def main() -> None:
    """The command, with what the command line states."""
    run_from_command_line(evaluate, EvaluateConfig)


if __name__ == "__main__":
    main()
