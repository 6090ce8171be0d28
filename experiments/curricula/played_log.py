"""Which levels were played, and how far their distribution is from the one that levels are meant to be drawn from.

Each line is about an interval of training. Of its episodes, at most :data:`SHOWN` at equal distances stand for all.

``w2_target``, ``w2_test``: exact Wasserstein-2 from the levels of these episodes to levels of the target and of the test.
``ks``: the largest Kolmogorov-Smirnov statistic of a factor against the target. ``w2_floor``, ``ks_floor``: the same of as many
independent levels of the target. ``effective_number``: how many levels without any likeness the episodes are worth (repeated
levels count once for each episode). ``entropy``: of the different levels among them, in nats, factor by factor.
``choice_entropy``: of which level an episode is on, in nats, over all episodes; ``levels``: how many different ones;
``episodes``: how many. ``made``: the share of episodes on levels that a curriculum made.
"""

import dataclasses
import warnings
from collections.abc import Iterable, Mapping
from itertools import groupby
from typing import Any

import numpy as np
import pyarrow as pa
import scipy

from segar.errors import UnseenDifferenceWarning
from segar.experiments.collection.saved_state import SavedState
from segar.experiments.curricula.level_rows import MADE
from segar.experiments.curricula.played_env import Began
from segar.levels import LEVEL_ARRAYS, Levels
from segar.metrics import effective_number, ks_by_factor, sample_entropy, w2

SHOWN = 100  # episodes of an interval, and levels of the target, whose distributions are compared
TARGET_SPLIT = "target"  # of the levels that stand for the target, so that they are no train or test levels
FEWEST = 10  # different levels from which an entropy is estimated
PLAYED_SCHEMA = pa.schema(
    [
        ("frames", pa.int64()),  # at the end of the interval
        ("level", pa.int64()),  # index in the fixed set or in the training split, -1 for a level that was made
        ("identity", pa.int64()),  # a number that no other level of the run has
        ("episodes", pa.int64()),  # that began on it in the interval
        ("score", pa.float64()),  # of the level at the end of the interval; null where it has none
    ]
)


class PlayedLog(SavedState):
    """The episodes since the last line, and the lines of the table so far.

    Args:
        like: training levels, from which the played ones differ in their arrays alone.
        target: what training levels are meant to be drawn from. test: the test levels.
    """

    saved = ("began",)

    def __init__(self, like: Levels, target: Any, test: Levels) -> None:
        self.like, self.test = like, test[:SHOWN]
        number = min(2 * SHOWN, len(target)) if hasattr(target, "__len__") else 2 * SHOWN
        levels = target.sample(number, seed=0, split=TARGET_SPLIT)
        self.target, self.independent = levels[: -(-number // 2)], levels[number // 2 :]
        self.known_floors: dict[int, dict[str, float]] = {}
        self.rows: list[dict[str, Any]] = []
        self.began: list[dict[str, np.ndarray]] = []  # arrays of levels, their numbers and identities

    def add(self, began: Iterable[Began]) -> None:
        """Takes note of episodes that began."""
        for _, group in groupby(began, key=lambda one: id(one.levels)):  # all that began on the same levels at once
            parts = list(group)
            row, number, identity = (
                np.concatenate([getattr(one, name) for one in parts]) for name in ("row", "number", "identity")
            )
            arrays = {name: getattr(parts[0].levels, name)[row] for name in LEVEL_ARRAYS}
            self.began.append({**arrays, "number": number, "identity": identity})

    def line(self, frames: int, scores: Mapping[int, float]) -> dict[str, float]:
        """Figures of the episodes since the last line; the table gets a row for each of their levels.

        Args:
            scores: of levels, by identity.
        """
        if not self.began:
            return {}
        played = joined(self.began)
        self.began = []
        identity, first, times = np.unique(played["identity"], return_index=True, return_counts=True)
        for who, at, episodes in zip(identity.tolist(), first.tolist(), times.tolist(), strict=True):
            about = {"frames": frames, "level": int(played["number"][at]), "identity": who, "episodes": episodes}
            self.rows.append({**about, "score": scores.get(who)})
        n = len(played["number"])
        shown = np.linspace(0, n - 1, min(n, SHOWN)).round().astype(int)
        found = {
            "episodes": n,
            "levels": len(identity),
            "choice_entropy": scipy.special.entr(times / n).sum(),
            "made": (played["number"] == MADE).mean(),
            **self.compared(self.levels_of(played, shown), np.unique(played["identity"][shown], return_index=True)[1]),
        }
        return {f"played/{name}": float(value) for name, value in found.items()}

    def compared(self, levels: Levels, different: np.ndarray) -> dict[str, float]:
        """How levels of episodes compare with the target and the test; ``different`` are indices of all different ones."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UnseenDifferenceWarning)
            found = {
                "w2_target": w2(levels, self.target),
                "w2_test": w2(levels, self.test),
                "ks": max(ks_by_factor(levels, self.target).values()),
                "effective_number": effective_number(levels),
            }
            found |= self.floors(len(levels))
        if len(different) >= FEWEST:
            found["entropy"] = sample_entropy(levels[different], "mean_field").value
        return found

    def floors(self, number: int) -> dict[str, float]:
        """The distances to the target of so many independent levels of it."""
        if number not in self.known_floors:  # nearly all lines are of the same number
            levels = self.independent[:number]
            found = {"w2_floor": w2(levels, self.target), "ks_floor": max(ks_by_factor(levels, self.target).values())}
            self.known_floors[number] = found
        return self.known_floors[number]

    def levels_of(self, played: Mapping[str, np.ndarray], picked: np.ndarray) -> Levels:
        """The levels of the picked episodes."""
        origin = dataclasses.replace(self.like.provenance, distribution="", indices=played["number"][picked])
        return dataclasses.replace(
            self.like, **{name: played[name][picked] for name in LEVEL_ARRAYS}, provenance=origin
        )


def joined(parts: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Arrays of levels one behind the other, with room for the largest number of vertices."""
    room = max(one["vertices"].shape[2] for one in parts)

    def array(part: dict[str, np.ndarray], name: str) -> np.ndarray:
        if name != "vertices":
            return part[name]
        return np.pad(part[name], ((0, 0), (0, 0), (0, room - part[name].shape[2]), (0, 0)))

    return {name: np.concatenate([array(one, name) for one in parts]) for name in parts[0]}
