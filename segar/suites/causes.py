"""Causes of failures: a policy on the test levels of a suite and on their causal twins."""

from __future__ import annotations

import csv
import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from segar.envs import Policy
from segar.errors import SuiteError
from segar.evaluation import Interval, evaluate_levels, mean_of_levels
from segar.hardness import wilson_interval
from segar.levels import Levels
from segar.observations import trained_on
from segar.suites.causal_twins import Twin, Twins
from segar.suites.sides import observation_on, require_free
from segar.suites.suite_file import SIDES, Suite
from segar.support import ShownInNotebooks, aligned, replacing


@dataclass(frozen=True)
class Cause:
    """What one group of factors has to do with the failures of a policy; shares of test levels that have a twin in it.

    Attributes:
        group: of :class:`segar.suites.Twin`. differs: whether training and test differ in it.
        twins: how many levels have a twin.
        success_level, success_twin: success on these levels, and on their twins.
        effect: ``success_twin - success_level`` with its interval over levels, paired: what the policy gains where this group
            is as in training. Of a control it is 0 but for chance.
        failures: on how many of these levels the policy fails.
        attributed: the share of them on whose twin it succeeds, with Wilson's interval over them. A policy that fails by
            chance has one on controls, too: compare with theirs.
    """

    group: str
    differs: bool
    twins: int
    success_level: float
    success_twin: float
    effect: Interval
    failures: float
    attributed: Interval

    @classmethod
    def of_levels(cls, group: str, differs: bool, level: np.ndarray, twin: np.ndarray) -> Cause:
        """The figures of a group, from the success on each level that has a twin, and on the twin; float ``(n,)`` in [0, 1]."""
        failed = 1.0 - level
        share, number = float("nan"), float(failed.sum())
        ends = (float("nan"), float("nan"))
        if number:
            share = float((failed * twin).sum() / number)
            low, high = wilson_interval(share, max(1, round(number)))
            ends = float(low), float(high)
        return cls(
            group, differs, len(level),
            _mean(level), _mean(twin), mean_of_levels(twin - level, -1.0, 1.0), number, Interval(share, *ends),
        )  # fmt: skip

    def row(self) -> dict[str, Any]:
        """The numbers by their names in tables."""
        found: dict[str, Any] = {}
        for name, value in vars(self).items():
            if isinstance(value, Interval):
                found |= {name: value.value, f"{name}_low": value.low, f"{name}_high": value.high}
            else:
                found[name] = value
        return found


@dataclass(frozen=True, eq=False)
class Causes(ShownInNotebooks):
    """A policy on test levels and their twins; ``print`` shows a table.

    Attributes:
        twins: what was played.
        on_levels: success on each test level, float64 ``(n,)``, a mean over episodes.
        on_twins: the same on the twins of each group; NaN where a level has none.
    """

    twins: Twins
    on_levels: np.ndarray
    on_twins: Mapping[str, np.ndarray]

    def cause(self, group: str) -> Cause:
        """The figures of a group; raises :class:`SuiteError` where there is none."""
        one = self.twins[group]
        success = (played[one.found] for played in (self.on_levels, self.on_twins[group]))
        return Cause.of_levels(group, one.differs, *success)

    def causes(self) -> tuple[Cause, ...]:
        """The figures of all groups, those in which training and test differ first."""
        return tuple(self.cause(one.group) for one in self.twins.groups)

    def rows(self) -> list[dict[str, Any]]:
        """The table: a row per group, with the suite and the hash of the twins."""
        about = {"suite": self.twins.suite.name, "twins_hash": self.twins.hash}
        return [about | cause.row() for cause in self.causes()]

    def save(self, path: str | PathLike[str]) -> None:
        """Write the table as csv.

        Raises:
            SuiteError: the file cannot be written; what stood at ``path`` still stands there.
        """
        write_causes(Path(path), self.rows())

    def __str__(self) -> str:
        rows = [["group", "", "twins", "success", "on twins", "effect [95 %]", "failures", "attributed [95 %]"]]
        for one in self.causes():
            kind = "differs" if one.differs else "control"
            numbers = [f"{one.success_level:.3f}", f"{one.success_twin:.3f}", str(one.effect)]
            attributed = str(one.attributed) if one.failures else "-"
            rows.append([one.group, kind, str(one.twins), *numbers, f"{one.failures:g}", attributed])
        title = f"{self.twins.suite.name}: success {_mean(self.on_levels):.3f} on {len(self.on_levels)} test levels"
        return "\n".join([title, aligned(rows), *([f"note: {self.twins.note}"] if self.twins.note else [])])


def write_causes(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows of tables of causes as csv; raises :class:`SuiteError` as :meth:`Causes.save`."""
    with replacing(path, "the table", SuiteError) as beside, beside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [*rows[0]])
        writer.writeheader()
        writer.writerows(rows)


def find_causes(
    policy: Policy,
    twins: Twins,
    *,
    observation: Any = None,
    train: Levels | None = None,
    episodes: int = 1,
    seed: int = 0,
    **options: Any,
) -> Causes:
    """On which test levels of a suite a policy fails, and on which of their twins it does not: what its failures come from.

    A policy that fails on a level and succeeds on the twin in which the mass is that of training fails because of the mass.
    The same policy, seed and options play levels and twins.

    Args:
        policy: as of :func:`segar.evaluate_policy`.
        twins: of :func:`segar.suites.twins`.
        observation: what the policy sees, as of :func:`segar.suites.observation_on`; None for ``"state"`` or, of suites of
            textures, for ``"rgb"``.
        train: levels whose units a normalised observation has; the training levels of seed 0 where it is None.
        episodes: on each level and twin.
        seed: of the environments, for tasks whose physics is random.
        options: of :class:`segar.envs.VectorEnv`, but for those that the suite decides, such as ``task``.

    Raises:
        SegarError: an argument is out of range, or the policy cannot see these levels.
    """
    suite = twins.suite
    require_free(suite, options)
    if observation is None:
        observation = "rgb" if suite.textures else "state"
    seen = {side: observation_on(suite, side, observation) for side in SIDES}
    units = suite.sample(0) if train is None else train

    def played(levels: Levels, side: str) -> np.ndarray:
        given = {**options, "task": suite.task, "observation": trained_on(seen[side], units)}
        return evaluate_levels(policy, levels, episodes=episodes, seed=seed, **given).of_levels("success")

    return causes_of(twins, lambda levels, twin: played(levels, looks_like(suite, twin)))


def causes_of(twins: Twins, success: Callable[[Levels, Twin | None], np.ndarray]) -> Causes:
    """What failures come from, for whoever plays the levels by means of their own.

    Args:
        success: gives the success on each of some levels, float ``(n,)``: the test levels, for which the second argument is
            None, or the twins that it is.
    """
    on_levels = np.asarray(success(twins.test_levels, None), float)
    on_twins = {}
    for one in twins.groups:
        on_twins[one.group] = np.full(len(on_levels), np.nan)
        if one.found.any():
            rows = np.flatnonzero(one.found)
            on_twins[one.group][rows] = success(one.levels[rows], dataclasses.replace(one, levels=one.levels[rows]))
    return Causes(twins, on_levels, on_twins)


def looks_like(suite: Suite, twin: Twin | None) -> str:
    """The side, ``"train"`` or ``"test"``, in whose textures a twin is seen; without a twin, it is the test level itself."""
    is_as_in_training = twin is not None and bool(twin.textures) and twin.textures == suite.textures[0]
    return "train" if is_as_in_training else "test"


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if len(values) else float("nan")
