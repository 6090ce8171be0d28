"""How hard levels are, before anything is trained on them: chance, a script and an oracle play each of them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from segar.hardness.planner import BATCH, Plan, require_search, scripted_episodes, search
from segar.hardness.rollouts import Episodes, Starts, make_starts, play_forks, uniform_actions
from segar.language import Task
from segar.levels import Levels, checks

NORMAL_95 = 1.959963984540054  # two-sided 95 % point of the standard normal distribution


@dataclass(frozen=True, eq=False)
class Hardness:
    """How a random policy, the scripted player and the oracle fare on each level; arrays lead with the level.

    Attributes:
        task: name of the task.
        plays: random episodes per level.
        random_success: float64 ``(n,)``, share of them that succeed.
        random_return: float64 ``(n,)``, their mean return.
        scripted: the scripted player's episode on each level, None where the task has no such player.
        oracle: the best episodes that the planner found, with their actions; see :func:`segar.hardness.plan`.
    """

    task: str
    plays: int
    random_success: np.ndarray
    random_return: np.ndarray
    scripted: Episodes | None
    oracle: Plan

    def rows(self) -> list[dict[str, Any]]:
        """One dictionary per level of plain numbers and truths; steps are None where the level was not solved."""
        rows, (low, high) = [], wilson_interval(self.random_success, self.plays)
        for i in range(len(self.oracle)):
            row: dict[str, Any] = {
                "level": i,
                "random_success": float(self.random_success[i]),
                "random_success_95": [float(low[i]), float(high[i])],
                "random_return": float(self.random_return[i]),
            }
            for name, player in self._players().items():
                row[f"{name}_solved"] = bool(player.solved[i])
                row[f"{name}_steps"] = int(player.steps[i]) if player.solved[i] else None
                row[f"{name}_return"] = float(player.returns[i])
            rows.append(row)
        return rows

    def summary(self) -> dict[str, Any]:
        """The same over all levels, as plain numbers.

        Each share comes with the Wilson interval of as many trials as there are levels. For ``random_success``, a mean
        over several plays of each level, this interval is wide enough whatever the levels are like.
        """
        n, players = len(self.oracle), self._players()
        found: dict[str, Any] = {"levels": n, "task": self.task, "plays": self.plays}
        shares = {"random_success": self.random_success}
        shares |= {f"{name}_success": player.solved for name, player in players.items()}
        for name, share in shares.items():
            low, high = wilson_interval(share.mean(), n)
            found |= {name: float(share.mean()), f"{name}_95": [float(low), float(high)]}
        found["random_return"] = float(self.random_return.mean())
        for name, player in players.items():
            steps = player.steps[player.solved]
            found[f"{name}_steps"] = float(steps.mean()) if len(steps) else None
            found[f"{name}_return"] = float(player.returns.mean())
        return found | {"oracle_rollouts": self.oracle.rollouts}

    def _players(self) -> dict[str, Episodes | Plan]:
        """The players whose episodes are known, by name."""
        return {**({} if self.scripted is None else {"scripted": self.scripted}), "oracle": self.oracle}


def hardness(
    levels: Levels,
    task: Task | None = None,
    *,
    rng: np.random.Generator,
    plays: int = 100,
    samples: int = 128,
    iterations: int = 10,
    seed: int = 0,
    num_threads: int = 1,
) -> Hardness:
    """How hard each level is for a policy that acts at random, for the scripted player, and for the oracle.

    Args:
        task: what is played; the task of the levels where it is None.
        rng: of the random policy and of the search.
        plays: random episodes per level, actions uniform in the task's range, each with draws of its own where rules
            have chance.
        samples, iterations: of the search; see :func:`segar.hardness.plan`.
        seed: of the randomness in rules, for script and oracle.
        num_threads: threads of the simulator; results do not depend on it.

    Raises:
        SegarError: plays, samples or iterations are too few, or the levels do not fit the task.
    """
    checks.require_generator("hardness", rng)
    checks.require_count("hardness", "random play per level", plays, 1)
    require_search(samples, iterations)
    starts = make_starts(levels, task, seed, num_threads)
    solved, returns = random_episodes(starts, plays, rng)
    return Hardness(
        task=starts.task.name,
        plays=plays,
        random_success=solved.mean(axis=1),
        random_return=returns.mean(axis=1),
        scripted=scripted_episodes(starts),
        oracle=search(starts, rng, samples, iterations),
    )


def random_episodes(starts: Starts, plays: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Success (bool) and return (float64) of ``plays`` random episodes on each level, both ``(n, plays)``."""
    rows = np.repeat(np.arange(len(starts.levels)), plays)

    def at_random(values: np.ndarray) -> np.ndarray:
        return uniform_actions(starts.task, len(values), 1, rng)[:, 0]

    solved, returns = np.zeros(len(rows), np.bool_), np.zeros(len(rows))
    for at in range(0, len(rows), BATCH):
        block = slice(at, at + BATCH)
        keys = rng.integers(0, 2**64, len(rows[block]), np.uint64)
        played = play_forks(starts, rows[block], at_random, keys=keys)
        solved[block], returns[block] = played.solved, played.returns
    return solved.reshape(-1, plays), returns.reshape(-1, plays)


def wilson_interval(share: Any, trials: int) -> tuple[Any, Any]:
    """The 95 % interval of a probability of which ``share`` of so many trials came true (Wilson 1927)."""
    p, z2 = np.asarray(share, float), NORMAL_95**2
    centre = (p + z2 / (2 * trials)) / (1 + z2 / trials)
    margin = NORMAL_95 / (1 + z2 / trials) * np.sqrt(p * (1 - p) / trials + z2 / (4 * trials**2))
    low, high = np.maximum(centre - margin, 0.0), np.minimum(centre + margin, 1.0)
    return np.where(p > 0, low, 0.0)[()], np.where(p < 1, high, 1.0)[()]  # to the bit, which rounding would miss
