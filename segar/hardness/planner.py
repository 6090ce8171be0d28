"""The oracle: the best open-loop actions that a cross-entropy search finds with the simulator itself as its model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from segar.envs import Policy, VectorEnv, play
from segar.errors import SegarError
from segar.hardness.rollouts import Episodes, ForkedEpisodes, OpenLoop, Starts, make_starts, play_forks, scripted
from segar.language import Task
from segar.levels import Levels, checks
from segar.support import ArchiveFormat, Form, read_only

BATCH = 16384  # rollouts that are simulated side by side; bounds the memory
ELITES = 0.125  # share of the candidates that the next ones are drawn around
FIRST_SPREAD = 0.5  # of the first candidates around the scripted player, as a share of half the action's range
LEAST_SPREAD = 0.02  # of half the range; the candidates of the last iteration still differ
SMOOTHNESS = 0.8  # correlation of the perturbations of successive actions
FRESH = np.float32((1 - SMOOTHNESS**2) ** 0.5)  # the weight of what is drawn anew, which keeps the deviation
PATIENCE = 3  # candidates are truncated at so many times the steps of the best success
PLAN_ARRAYS = {
    "solved": Form("bool", ("levels",)),
    "died": Form("bool", ("levels",)),
    "steps": Form("int64", ("levels",)),
    "returns": Form("float64", ("levels",)),
    "actions": Form("float32", ("levels", "max steps", "action size")),
    "values": Form("float64", ("levels", "entities", "columns")),
}
PLAN_NUMBERS = {"task": str, "seed": int, "rollouts": int}
FORMAT = ArchiveFormat("segar-plan", 1, "a plan", "plan", SegarError, PLAN_NUMBERS)


@dataclass(frozen=True, eq=False)
class Plan:
    """The best episode that was found on each level, and the actions that certify it; arrays lead with the level.

    Attributes:
        solved: bool ``(n,)``, whether it ends in success. died: bool ``(n,)``.
        steps: int64 ``(n,)``, its length. returns: float64 ``(n,)``, every reward counted.
        actions: float32 ``(n, max steps, action size)``: the certificate; zero after the end.
        values: float64 ``(n, entities, columns)``, the state that it ends in.
        task: name of the task. seed: of the randomness in rules.
        rollouts: episodes that were simulated to find the plan.
    """

    solved: np.ndarray
    died: np.ndarray
    steps: np.ndarray
    returns: np.ndarray
    actions: np.ndarray
    values: np.ndarray
    task: str
    seed: int
    rollouts: int

    def __post_init__(self) -> None:
        for name in PLAN_ARRAYS:  # those of suites are shared, as their levels are
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def __len__(self) -> int:
        return len(self.steps)

    def __getitem__(self, rows: np.ndarray) -> Plan:
        """The plans of some of the levels, by an array of indices or truth values."""
        return replace(self, **{name: getattr(self, name)[rows] for name in PLAN_ARRAYS})

    def save(self, path: str | PathLike[str]) -> None:
        """Write to ``path`` (npz without pickle); levels are not in the file.

        Raises:
            SegarError: the file cannot be written; what stood at ``path`` still stands there.
        """
        arrays = {name: getattr(self, name) for name in PLAN_ARRAYS}
        metadata = {name: getattr(self, name) for name in PLAN_NUMBERS}
        FORMAT.write(Path(path), arrays, metadata)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Plan:
        """The plan in a file that ``save`` wrote.

        Raises:
            SegarError: the file is no plan, is incomplete, or was written by a newer version.
        """
        arrays, metadata = FORMAT.read(Path(path), lambda description: PLAN_ARRAYS)
        return cls(**arrays, **{name: metadata[name] for name in PLAN_NUMBERS})


def plan(
    levels: Levels,
    task: Task | None = None,
    *,
    rng: np.random.Generator,
    samples: int = 128,
    iterations: int = 10,
    seed: int = 0,
    num_threads: int = 1,
) -> Plan:
    """The best episode per level that ``samples * iterations`` simulated ones contain.

    A cross-entropy search over action sequences. It starts from what the task's scripted player does, tries smooth
    perturbations of it, and goes on from the best eighth. Half of the candidates hand over to the scripted player at a
    random step, so that the search has to find the way and the script finds the end of it.

    Success counts more than anything, then the return; an episode that ends without success is charged as if its last
    reward, where that is negative, went on to the time limit: falling into a hole early is no way to save penalties. In
    this order a plan is never worse than the scripted player or than doing nothing. It is the best that was found: that
    a level has no plan does not prove that it has no solution.

    With chance in the rules a plan is clairvoyant: it knows the draws that follow from ``seed``.

    Args:
        task: what is played; the task of the levels where it is None.
        rng: of the search.
        samples: candidates per level and iteration, at least 8.
        seed: of the randomness in rules.
        num_threads: threads of the simulator; results do not depend on it.

    Raises:
        SegarError: samples or iterations are too few, or the levels do not fit the task.
    """
    checks.require_generator("plan", rng)
    require_search(samples, iterations)
    return search(make_starts(levels, task, seed, num_threads), rng, samples, iterations)


def require_search(samples: int, iterations: int) -> None:
    """Raise :class:`SegarError` unless the search is large enough to be one."""
    checks.require_count("the search", "samples", samples, 8)
    checks.require_count("the search", "iterations", iterations, 1)


def search(starts: Starts, rng: np.random.Generator, samples: int, iterations: int) -> Plan:
    """The best episode from each of the starts; see :func:`plan`."""
    block = max(1, BATCH // samples)
    rows = np.arange(len(starts.levels))
    found = [_search(starts, rows[i : i + block], rng, samples, iterations) for i in range(0, len(rows), block)]
    arrays = {name: np.concatenate([getattr(best, name) for best, _ in found]) for name in PLAN_ARRAYS}
    return Plan(**arrays, task=starts.task.name, seed=starts.seed, rollouts=sum(count for _, count in found))


def replay(levels: Levels, certificate: Plan, task: Task | None = None) -> np.ndarray:
    """Whether each level's actions, played in a fresh environment, give all that the plan says, to the bit; ``(n,)``.

    It plays with :class:`segar.envs.VectorEnv`, which shares nothing with the search but the kernel.

    Raises:
        SegarError: the plan is of another task, or of another number of levels.
    """
    if len(levels) != len(certificate):
        raise SegarError(f"this plan is of {len(certificate)} levels, and here are {len(levels)}")
    n = len(levels)
    env = VectorEnv(levels, n, task=task, seed=certificate.seed, autoreset_mode="Disabled")
    if env.task.name != certificate.task:
        raise SegarError(f"this plan is for the task {certificate.task}, not for {env.task.name}; give task=")
    start = env.reset(options={"levels": np.arange(n)})
    same, steps = np.zeros(n, np.bool_), iter(np.moveaxis(certificate.actions, 1, 0))
    for now in play(env, lambda observations: next(steps), start):
        if now.ended.any():
            same |= now.ended & _agrees(certificate, now.info, env.state().state.values)
        if now.time == certificate.actions.shape[1]:
            break
    return same


def _agrees(certificate: Plan, info: dict[str, Any], values: np.ndarray) -> np.ndarray:
    """Of each level, whether an environment's info and states are what the plan says, to the bit; bool ``(n,)``."""
    same = np.array([a.tobytes() == b.tobytes() for a, b in zip(values, certificate.values, strict=True)])
    for name, key in (("solved", "success"), ("died", "death"), ("steps", "length"), ("returns", "return")):
        same &= info[key] == getattr(certificate, name)
    return same


def scripted_episodes(starts: Starts) -> Episodes | None:
    """One episode per level by the task's scripted player, None where the task has none."""
    player = scripted(starts)
    return None if player is None else play_forks(starts, np.arange(len(starts.levels)), player)


def _search(
    starts: Starts, rows: np.ndarray, rng: np.random.Generator, samples: int, iterations: int
) -> tuple[Episodes, int]:
    """The best episodes on the levels ``rows``, and how many were simulated."""
    n, task, script = len(rows), starts.task, scripted(starts)
    shape = (task.max_steps, len(task.action_low))
    half_range = (np.array(task.action_high) - np.array(task.action_low)) / 2
    best = play_forks(starts, rows, OpenLoop(np.zeros((n, *shape), np.float32)))
    if script is not None:
        best = _better(best, play_forks(starts, rows, script), task)
    mean, spread = best.actions, np.full((n, *shape), FIRST_SPREAD * half_range, np.float32)
    elites, level = max(2, round(ELITES * samples)), np.repeat(np.arange(n), samples)
    for _ in range(iterations):
        limits = np.minimum(np.where(best.solved, PATIENCE * best.steps, task.max_steps), task.max_steps)
        smooth = _Perturbed(mean, spread, level, rng)
        player: Policy = smooth
        if script is not None:
            player = _Relay(smooth, script, _hand_over(rng, best.steps, samples).ravel())
        played = play_forks(starts, rows[level], player, limits[level])
        keys = -value(played, task).reshape(n, samples), ~played.solved.reshape(n, samples)
        order = np.lexsort(keys, axis=1)
        picked = order[:, :elites] + samples * np.arange(n)[:, None]
        # After its end an episode has no actions; those of the mean stand in.
        after = np.arange(task.max_steps) >= played.steps[picked][..., None]
        chosen = np.where(after[..., None], mean[:, None], played.actions[picked])
        first = Episodes(**{name: array[picked[:, 0]] for name, array in vars(played).items()})
        best = _better(best, first, task)
        chosen = np.concatenate([best.actions[:, None], chosen], axis=1)
        mean, spread = chosen.mean(axis=1), np.maximum(chosen.std(axis=1), LEAST_SPREAD * half_range, dtype=np.float32)
    return best, n * (1 + (script is not None) + samples * iterations)


def value(episodes: Episodes, task: Task) -> np.ndarray:
    """What the planner maximizes among successes, and among failures, float ``(n,)``; see :func:`plan`."""
    rest = (task.max_steps - episodes.steps) * np.minimum(episodes.last_reward, 0.0)
    return np.where(episodes.solved, episodes.returns, episodes.returns + rest)


def _better(a: Episodes, b: Episodes, task: Task) -> Episodes:
    """Row by row the better of two batches of episodes, the first where they are equal."""
    wins = (b.solved > a.solved) | ((b.solved == a.solved) & (value(b, task) > value(a, task)))
    pick: Any = lambda x, y: np.where(wins.reshape(-1, *(1,) * (x.ndim - 1)), y, x)  # noqa: E731
    return Episodes(**{name: pick(array, getattr(b, name)) for name, array in vars(a).items()})


class _Perturbed:
    """The player of smooth Gaussian perturbations of ``mean[level]``: autoregressive noise, ``spread`` its deviation."""

    def __init__(self, mean: np.ndarray, spread: np.ndarray, level: np.ndarray, rng: np.random.Generator) -> None:
        self.mean, self.spread, self.level, self.rng = mean, spread, level, rng
        self.noise = rng.standard_normal((len(level), mean.shape[-1]), dtype=np.float32)

    def begin(self, forks: ForkedEpisodes) -> None:
        self.forks = forks

    def __call__(self, values: np.ndarray) -> np.ndarray:
        rows, step, noise = self.forks.episodes, self.forks.time, self.noise
        if step:
            drawn = self.rng.standard_normal((len(rows), noise.shape[1]), dtype=np.float32)
            noise[rows] = np.float32(SMOOTHNESS) * noise[rows] + FRESH * drawn
        at = self.level[rows]
        return self.mean[at, step] + self.spread[at, step] * noise[rows]


def _hand_over(rng: np.random.Generator, lengths: np.ndarray, samples: int) -> np.ndarray:
    """The step at which each candidate hands over to the scripted player, int ``(n, samples)``; half never do."""
    at = (rng.random((len(lengths), samples)) * (lengths[:, None] + 1)).astype(np.int64)
    at[:, ::2] = np.iinfo(np.int64).max
    return at


class _Relay:
    """The player that hands over from ``first`` to the script at step ``hands_over[episode]``."""

    def __init__(self, first: _Perturbed, script: Policy, hands_over: np.ndarray) -> None:
        self.first, self.script, self.hands_over = first, script, hands_over

    def begin(self, forks: ForkedEpisodes) -> None:
        self.first.begin(forks)

    def __call__(self, values: np.ndarray) -> np.ndarray:
        chosen, forks = self.first(values), self.first.forks
        late = self.hands_over[forks.episodes] <= forks.time
        if late.any():
            chosen[late] = self.script(values[late])
        return chosen
