"""Test a trained agent on the levels of a :class:`segar.experiments.evaluation.transfers.Transfer`.

The results lie in ``evaluations/`` of the run folder: the levels, ``episodes.parquet``, and ``summary.json``, which is
written last.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

from segar.experiments.evaluation.episodes import distance_figures, figures_in_modes, play_in_modes
from segar.experiments.evaluation.evaluator import load_agent, options_of, write
from segar.experiments.evaluation.transfers import Transfer
from segar.experiments.runs.executed_code import code_after
from segar.experiments.runs.run_folder import LEVELS_TRAIN, folder_path
from segar.experiments.settings import RunConfig, as_data
from segar.levels import Levels


def evaluate_transfer(run: RunConfig, transfer: Transfer, say: Callable[[str], None] = print) -> dict[str, Any]:
    """Plays each test level once, deterministically and with sampled actions; writes and returns the summary.

    Raises:
        SegarError: the run has no weights, or its agent cannot observe these levels.
    """
    folder, test, code = folder_path(run), transfer.levels(run), transfer.code(run)
    as_seen = dataclasses.replace(run, observation=transfer.observation)
    policy, frames = load_agent(folder, as_seen, test, say)
    options = options_of(folder, as_seen, transfer.panel if transfer.mixture is None else "train")
    rows = play_in_modes(policy, "test", test, options, run.evaluation.seed)
    distances = distance_figures(Levels.load(folder / LEVELS_TRAIN), test, run.evaluation.distances)
    figures = {**figures_in_modes(rows, "test"), **distances}
    summary = {"transfer": as_data(transfer), "frames": frames, **figures, "code": code_after(code, say)}
    write(transfer.folder(run), test, rows, summary)
    say(f"{run.label()}: tested on {transfer.label}, return {figures['evaluation/test/return/deterministic']:.3f}")
    return summary
