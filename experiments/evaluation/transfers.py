"""A trained agent on levels that it was not made for: harder ones, other physics, another look, or levels between those
of training and those of the test.

What comes of it lies in ``evaluations/`` of the run folder: ``episodes.parquet``, and ``summary.json``, which is written
last.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from experiments.evaluation.probing import ProbeConfig, is_probed
from experiments.runs.journal import read_journal
from experiments.runs.run_folder import (
    EPISODE_SCHEMA,
    EPISODES,
    EVALUATIONS,
    LEVELS_TEST,
    LEVELS_TRAIN,
    SUMMARY,
    folder_path,
    is_finished,
    write_json,
    write_rows,
)
from experiments.settings import ACTION_MODES, LevelsConfig, ObservationConfig, RunConfig, as_data

if TYPE_CHECKING:
    from segar.levels import Levels


@dataclass(frozen=True)
class Mixture:
    """Levels between training and test: which groups of factors are those of the test levels."""

    groups: Mapping[str, Sequence[str]]  # name to factors and parameters; all others are the group "rest"
    changed: Sequence[str]  # names of groups


@dataclass(frozen=True)
class Transfer:
    """Test levels, and what the agent sees of them. What differs from training says ``label``.

    With a mixture, level i is training level i modulo their number, in which some factors are those of test level i.
    """

    label: str
    panel: str  # of the test levels, e.g. empty-hard
    variation: str
    observation: ObservationConfig
    test_count: int = 100
    test_seed: int = 0
    mixture: Mixture | None = None

    def folder_name(self) -> str:
        """Names the folder in ``evaluations/``; equal for equal levels and looks."""
        data = {key: value for key, value in as_data(self).items() if key != "label" and value is not None}
        digest = hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:8]
        return f"transfer-{''.join(c if c.isalnum() or c in '-_.' else '_' for c in self.label)}-{digest}"

    def folder(self, run: RunConfig) -> Path:
        """Where the results of this run's agent lie."""
        return folder_path(run) / EVALUATIONS / self.folder_name()

    def is_done(self, run: RunConfig) -> bool:
        """Whether this run's agent was tested so."""
        return (self.folder(run) / SUMMARY).exists()


@dataclass(frozen=True)
class RunWork:
    """A run, the transfers of its agent, and what is asked about its representation; ``elsewhere``: all of it was done on
    another machine, and tables say what came of it."""

    run: RunConfig
    transfers: tuple[Transfer, ...] = field(default=())
    probes: ProbeConfig | None = None
    elsewhere: bool = False

    def is_done(self) -> bool:
        """Whether nothing is left to do."""
        return self.elsewhere or self.is_done_here()

    def is_done_here(self) -> bool:
        """Whether run folders have all of it."""
        tested = all(transfer.is_done(self.run) for transfer in self.transfers)
        return is_finished(folder_path(self.run)) and tested and not self.lacks_probes()

    def lacks_probes(self) -> bool:
        """Whether the run is to be probed, and was not probed so."""
        return not self.elsewhere and self.probes is not None and not is_probed(self.run, self.probes)

    def frames_left(self) -> int:
        """Frames that are still to be trained; a run that was cut off is known by its journal."""
        folder = folder_path(self.run)
        if self.elsewhere or is_finished(folder):
            return 0
        done = max((entry.get("frames", 0) for entry in read_journal(folder)), default=0) if folder.exists() else 0
        return max(self.run.scale.frames - done, 0)


def evaluate_transfer(run: RunConfig, transfer: Transfer, say: Callable[[str], None] = print) -> dict[str, Any]:
    """Plays each test level once, deterministically and with sampled actions; writes and returns the summary.

    Raises:
        SegarError: the run has no weights, or its agent cannot observe these levels.
    """
    import torch

    from experiments.evaluation.episodes import distance_figures, mean_figures, play
    from experiments.evaluation.evaluator import load_agent
    from experiments.levels.builders import environment_options
    from segar.levels import Levels

    folder, out = folder_path(run), transfer.folder(run)
    test = levels_of(run, transfer)
    seen = dataclasses.replace(run, observation=transfer.observation)
    policy, frames = load_agent(folder, seen, test, say)
    options, seed = environment_options(seen), run.evaluation.seed
    rows: list[dict[str, Any]] = []
    for mode in ACTION_MODES:
        rng = torch.Generator().manual_seed(seed) if mode == "sampled" else None
        played = play(policy, test, np.arange(len(test)), options, rng=rng, seed=seed)
        rows += [{"levels": "test", "action_mode": mode, **row} for row in played]
    figures: dict[str, float] = {}
    for mode in ACTION_MODES:
        figures |= mean_figures([row for row in rows if row["action_mode"] == mode], "test", mode)
    figures |= distance_figures(Levels.load(folder / LEVELS_TRAIN), test, run.evaluation.distances)
    out.mkdir(parents=True, exist_ok=True)
    test.save(out / "levels.npz")
    write_rows(out / EPISODES, rows, EPISODE_SCHEMA)
    summary = {"transfer": as_data(transfer), "frames": frames, **figures}
    write_json(out / SUMMARY, summary)
    say(f"{run.label()}: tested on {transfer.label}, return {figures['evaluation/test/return/deterministic']:.3f}")
    return summary


def levels_of(run: RunConfig, transfer: Transfer) -> Levels:
    """The levels of a transfer; raises :class:`SegarError` if there are none such."""
    from experiments.levels.builders import make_levels
    from experiments.levels.mixed_levels import hybrid_levels
    from segar.levels import Levels

    if transfer.mixture is None:
        levels = LevelsConfig(
            train=transfer.panel, count=1, variation=transfer.variation, test_count=transfer.test_count,
            test_seed=transfer.test_seed,
        )  # fmt: skip
        return make_levels(levels)[1]
    train, test = (Levels.load(folder_path(run) / name) for name in (LEVELS_TRAIN, LEVELS_TEST))
    chosen = dict.fromkeys(transfer.mixture.changed, True)
    return hybrid_levels(train[np.arange(len(test)) % len(train)], test, transfer.mixture.groups, chosen)
