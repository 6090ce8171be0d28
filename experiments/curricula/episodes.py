"""Episodes that ended, and the sums over their steps that scores are made of."""

from dataclasses import dataclass

import numpy as np
from torch import Tensor

from segar.experiments.collection.collector import Rollout
from segar.experiments.collection.saved_state import SavedState

MEANS = ("value_l1", "positive_value_loss", "mean_value")
SUMS = ("steps", "returns", "learned_return", "discount", *MEANS)


@dataclass(frozen=True, eq=False)
class Ended:
    """Episodes that ended; arrays lead with the episode.

    Attributes:
        row: int64, the row of the level, or which of the levels that were tried.
        steps: int64, of the episode.
        returns: float64, the rewards of the task, added up.
        learned_return: float64, the rewards as they are learned from, discounted to the first step.
        value_l1, positive_value_loss: float64, means over steps of the size of the advantage, and of its positive part.
        mean_value: float64, mean over steps of the value that the agent expected.
    """

    row: np.ndarray
    steps: np.ndarray
    returns: np.ndarray
    learned_return: np.ndarray
    value_l1: np.ndarray
    positive_value_loss: np.ndarray
    mean_value: np.ndarray


class EpisodeSums(SavedState):
    """Sums over the running episodes of all environments, which rollouts cut at their ends.

    Args:
        gamma: the discount of the returns that are learned from.
    """

    saved = ("sums",)

    def __init__(self, num_envs: int, gamma: float) -> None:
        self.gamma = gamma
        self.sums = {name: np.full(num_envs, float(name == "discount")) for name in SUMS}

    def add(self, rollout: Rollout, reward: Tensor, advantage: Tensor, row: np.ndarray) -> Ended:
        """Adds the steps of a rollout; returns the episodes that ended in it, but for those whose level is in no row any more.

        Args:
            reward, advantage: as they are learned from, [T, N, 1].
            row: int64 [T, N], of the level of each step; below 0 where there is none.
        """
        tensors = (rollout.reward, reward, advantage, rollout.value)
        raw, learned, gains, value = (one[..., 0].double().cpu().numpy() for one in tensors)
        done, sums, found = rollout.done[..., 0].cpu().numpy(), self.sums, []
        for t in range(len(row)):
            sums["steps"] += 1
            sums["returns"] += raw[t]
            sums["learned_return"] += sums["discount"] * learned[t]
            sums["discount"] *= self.gamma
            sums["value_l1"] += np.abs(gains[t])
            sums["positive_value_loss"] += np.maximum(gains[t], 0.0)
            sums["mean_value"] += value[t]
            ends = np.flatnonzero(done[t])
            if len(ends):
                found.append({"row": row[t][ends], **{name: array[ends] for name, array in sums.items()}})
                for name, array in sums.items():
                    array[ends] = float(name == "discount")
        return ended_of(found)


def ended_of(found: list[dict[str, np.ndarray]]) -> Ended:
    """Episodes from their sums, with means over steps; those of no row are left out."""
    columns = {name: np.concatenate([one[name] for one in found] or [np.zeros(0)]) for name in ("row", *SUMS)}
    there = columns["row"] >= 0
    columns = {name: array[there] for name, array in columns.items() if name != "discount"}
    means = {name: columns[name] / columns["steps"] for name in MEANS}
    whole = {name: columns[name].astype(np.int64) for name in ("row", "steps")}
    return Ended(**{**columns, **means, **whole})
