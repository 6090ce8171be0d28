"""What is done with a trained agent beyond its run: transfers to other levels, and probes; described, not carried out.

A transfer tests the agent on levels that it was not trained for: harder ones, other physics, another observation, or
levels between those of training and those of the test. :mod:`segar.experiments.evaluation.transfer_evaluation` carries it out.
This module does not import torch, so that work can be planned without it.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from segar.experiments.evaluation.probing import ProbeConfig, is_probed
from segar.experiments.levels.builders import Prepared, distribution_of, in_own_world
from segar.experiments.runs.executed_code import differing_parts, played_code
from segar.experiments.runs.journal import read_journal
from segar.experiments.runs.run_folder import (
    EVALUATIONS,
    LEVELS_TEST,
    LEVELS_TRAIN,
    folder_path,
    is_finished,
    of_another_agent,
    read_evaluation,
)
from segar.experiments.settings import LevelsConfig, ObservationConfig, RunConfig, as_data, plain_name
from segar.experiments.settings.run import digest
from segar.levels import Levels, hash_of_levels, mixed_levels

LEVELS = "levels.npz"  # in the folder of an evaluation: what was played
OWN = {"train": LEVELS_TRAIN, "test": LEVELS_TEST}  # the run's own level sets


@dataclass(frozen=True)
class FactorSwap:
    """Levels between training and test: training levels in which some groups of factors are those of test levels."""

    groups: Mapping[str, Sequence[str]]  # name to factors and parameters; all others are the group "rest"
    changed: Sequence[str]  # names of groups


@dataclass(frozen=True)
class Transfer:
    """Test levels, and what the agent observes of them; ``label`` says what differs from training.

    With ``mixture``, level i is training level i modulo their number, in which some factors are those of test level i.
    """

    label: str
    panel: str  # of the test levels, e.g. empty-hard
    variation: str
    observation: ObservationConfig
    test_count: int = 100
    test_seed: int = 0
    mixture: FactorSwap | None = None

    def folder_name(self) -> str:
        """Names the folder in ``evaluations/``; equal for equal levels and looks."""
        data = {key: value for key, value in as_data(self).items() if key != "label" and value is not None}
        return f"transfer-{plain_name(self.label)}-{digest(data)}"

    def folder(self, run: RunConfig) -> Path:
        """Where the results of this run's agent lie."""
        return folder_path(run) / EVALUATIONS / self.folder_name()

    def is_done(self, run: RunConfig) -> bool:
        """Whether this run's agent was tested so, with the weights that it has now."""
        found = read_evaluation(self.folder(run))
        return found is not None and not of_another_agent(folder_path(run), found)

    def levels_config(self) -> LevelsConfig:
        """The settings of the test levels."""
        return LevelsConfig(train=self.panel, test=self.panel, variation=self.variation)

    def levels(self, run: RunConfig) -> Levels:
        """The test levels; raises :class:`SegarError` if they cannot be made."""
        if self.mixture is None:
            return distribution_of(self.levels_config(), "test").sample(
                self.test_count, seed=self.test_seed, split="test"
            )
        train, test = (
            in_own_world(Levels.load(folder_path(run) / name), run.levels, which) for which, name in OWN.items()
        )
        chosen = dict.fromkeys(self.mixture.changed, True)
        return mixed_levels(train[np.arange(len(test)) % len(train)], test, self.mixture.groups, chosen)

    def code(self, run: RunConfig) -> dict[str, str]:
        """The code that decides what this run's agent achieves there, beside its weights, as
        :func:`segar.experiments.runs.executed_code.played_code`; its part ``levels`` is of all test levels."""
        if self.mixture is not None:
            return played_code(Prepared(dataclasses.replace(run, observation=self.observation)))
        task = dataclasses.replace(run.task, name=Prepared(run).task_name)
        there = dataclasses.replace(run, levels=self.levels_config(), task=task, observation=self.observation)
        return {**played_code(Prepared(there)), "levels": hash_of_levels(self.levels(run))}

    def changed_parts(self, run: RunConfig, code: Mapping[str, str]) -> list[str]:
        """Names of the parts of ``code``, today's, that were others when this run's agent was tested so; none where it was
        not."""
        found = read_evaluation(self.folder(run)) if self.is_done(run) else None
        return [] if found is None else differing_parts(found.get("code", {}), code)


@dataclass(frozen=True)
class RunTask:
    """A run, the transfers of its agent, and what its probes measure.

    ``imported``: whether tables of another machine hold the run; ``whole``: whether they hold all results of it.
    ``changed``: the parts of the code that are others than when the run, finished or not, was made.
    ``retested``: names of the folders of transfers that other code made, which are to be made anew.
    """

    run: RunConfig
    transfers: tuple[Transfer, ...] = field(default=())
    probes: ProbeConfig | None = None
    imported: bool = False
    whole: bool = False
    changed: tuple[str, ...] = ()
    retested: frozenset[str] = frozenset()

    def is_done(self) -> bool:
        """Whether nothing is left to do."""
        return self.whole or self.is_done_here()

    def is_done_here(self) -> bool:
        """Whether run folders have all of it."""
        if self.is_anew():
            return False
        return is_finished(folder_path(self.run)) and not self.transfers_left() and not self.needs_probing()

    def is_anew(self) -> bool:
        """Whether the run is trained anew, whatever its folder holds."""
        return self.run.restart or (bool(self.changed) and self.run.stale == "anew")

    def transfers_left(self) -> list[Transfer]:
        """The transfers that are still to be made; all where the run is trained anew."""
        if self.is_anew():
            return list(self.transfers)
        return [one for one in self.transfers if not one.is_done(self.run) or one.folder_name() in self.retested]

    def needs_probing(self) -> bool:
        """Whether the run is to be probed, and its folder has no such probes, or is made anew."""
        if self.whole or self.probes is None:
            return False
        return self.is_anew() or not is_probed(self.run, self.probes)

    def frames_left(self) -> int:
        """Frames that are still to be trained; the journal says how many an interrupted run has."""
        folder = folder_path(self.run)
        if self.is_anew() and not self.whole:
            return self.run.scale.frames
        if self.whole or is_finished(folder):
            return 0
        done = max((entry.get("frames", 0) for entry in read_journal(folder)), default=0) if folder.exists() else 0
        return max(self.run.scale.frames - done, 0)
