"""What the agent can change: controllability of each factor, and the factors that go their way whatever it does."""

from dataclasses import dataclass

import numpy as np

from segar.errors import SegarError
from segar.hardness.rollouts import Starts, make_starts, play_forks, scripted, trace, uniform_actions
from segar.language import Layout, Task
from segar.levels import Levels, checks
from segar.support import is_whole

TRACES = 2048  # that are held at a time; bounds the memory
NUDGE = 0.05  # by which the first action is moved to both sides, as a share of half its range


@dataclass(frozen=True)
class FactorInfluence:
    """What actions do to one factor of one entity, in the factor's own unit.

    Attributes:
        entity, factor: names.
        kind: 'endogenous': in some level two plays led to different values. Otherwise 'exogenous': it changed, in all
            plays alike; or 'constant': it never changed.
        gain: change per unit of action: the mean of |df / da| over levels, plays and numbers of the action, for the
            first action of a play, at the step within the horizon where it is greatest.
        reach: the largest difference of two plays of one level at one step.
        share: of the levels, those in which the factor is endogenous.
    """

    entity: str
    factor: str
    kind: str
    gain: float
    reach: float
    share: float


@dataclass(frozen=True)
class Influence:
    """What actions do to all factors that the levels' entities hold.

    Attributes:
        factors: one entry per entity and factor, most endogenous first: by share, then by reach.
    """

    factors: tuple[FactorInfluence, ...]

    def of_kind(self, kind: str) -> list[tuple[str, str]]:
        """Pairs (entity, factor) of one kind: 'endogenous', 'exogenous' or 'constant'."""
        return [(f.entity, f.factor) for f in self.factors if f.kind == kind]

    def of(self, entity: str, factor: str) -> FactorInfluence:
        """The entry of one factor; raises :class:`SegarError` where the levels hold none such."""
        for entry in self.factors:
            if (entry.entity, entry.factor) == (entity, factor):
                return entry
        raise SegarError(f"none of these levels has '{entity}' with {factor}")


def influence(
    levels: Levels,
    task: Task | None = None,
    *,
    rng: np.random.Generator,
    horizon: int = 20,
    plays: int = 8,
    tolerance: float = 1e-9,
    seed: int = 0,
) -> Influence:
    """Controllability of every factor by finite differences, and the split into exogenous and endogenous factors.

    Each level is played by ``plays`` random sequences of actions, by the scripted player, by doing nothing, and by each
    number of the action held at either end of its range; all with the same chance in rules. What differs at a step that
    two plays both reach is endogenous (Dietterich, Trimponias and Chen 2018: what the actions do not reach, through
    other factors either, is exogenous). The split is exact in what it calls endogenous. What it calls exogenous is so in
    these plays: more plays and a longer horizon can only find more that is endogenous.

    For the gain the first action of each random play is moved a little to both sides, one number at a time. Where that
    decides whether bodies meet, the quotient is large, and rarely so: its mean does not depend much on how far it is moved.

    Args:
        rng: of the plays.
        horizon: steps, at most the task's.
        tolerance: difference of two plays up to which a factor counts as unmoved, in its own unit. Bodies that do not
            interact are equal to the bit, so it need not be large.

    Raises:
        SegarError: horizon or plays make no sense.
    """
    checks.require_generator("influence", rng)
    starts = make_starts(levels, task, seed)
    if not (is_whole(horizon) and is_whole(plays)) or not 1 <= horizon <= starts.task.max_steps or plays < 1:
        raise SegarError(
            f"influence needs a horizon of 1 to {starts.task.max_steps} steps, at least 1 play; not {horizon} and {plays}"
        )
    n = len(levels)
    block = max(1, TRACES // (plays * 2 * (1 + len(starts.task.action_low))))
    blocks = [np.arange(at, min(at + block, n)) for at in range(0, n, block)]
    found = [_measure(starts, rows, rng, horizon, plays) for rows in blocks]
    reach, moved, slopes, weights = (np.concatenate(part) for part in zip(*found, strict=True))
    gains = (slopes.sum(axis=0) / np.maximum(weights.sum(axis=0), 1)[:, None, None]).max(axis=0)
    return Influence(_entries(levels, reach, moved, gains, tolerance))


def _measure(
    starts: Starts, rows: np.ndarray, rng: np.random.Generator, horizon: int, plays: int
) -> tuple[np.ndarray, ...]:
    """Of each level in ``rows``: largest difference of two plays and largest change, ``(rows, entities, factors)``; sums
    of derivatives' sizes ``(rows, horizon, entities, factors)`` and how many they are ``(rows, horizon)``."""
    n, layout = len(rows), starts.levels.layout
    drawn = uniform_actions(starts.task, n * plays, horizon, rng).reshape(n, plays, horizon, -1)
    sequences = np.concatenate([drawn, _set_pieces(starts, rows, horizon)], axis=1)
    count = sequences.shape[1]
    states, ends = trace(starts, np.repeat(rows, count), sequences.reshape(n * count, horizon, -1))
    states = states.reshape(n, count, *states.shape[1:])
    running = np.arange(horizon + 1) < ends.reshape(n, count, 1)  # after an end the clocks differ
    on = running[..., None, None]
    high = np.where(on, states, -np.inf).max(axis=1)
    low = np.where(on, states, np.inf).min(axis=1)
    several = (running.sum(axis=1) >= 2)[..., None, None]
    reach = np.where(several, high - low, 0.0).max(axis=1)
    moved = np.abs(states - states[:, :, :1]).max(axis=(1, 2))
    return _by_factor(layout, reach), _by_factor(layout, moved), *_derivatives(starts, rows, drawn)


def _set_pieces(starts: Starts, rows: np.ndarray, horizon: int) -> np.ndarray:
    """Doing nothing, each number of the action at either end, and the script; float32 ``(rows, plays, horizon, size)``."""
    low, high = np.array(starts.task.action_low), np.array(starts.task.action_high)
    held = [
        np.zeros(len(low)),
        *(np.where(np.arange(len(low)) == c, end, 0) for c in range(len(low)) for end in (low, high)),
    ]
    pieces = np.broadcast_to(np.array(held, np.float32)[:, None], (len(rows), len(held), horizon, len(low)))
    script = scripted(starts)
    if script is None:
        return pieces
    return np.concatenate([pieces, play_forks(starts, rows, script).actions[:, None, :horizon]], axis=1)


def _derivatives(starts: Starts, rows: np.ndarray, drawn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sums over plays and numbers of the first action of the sizes of central differences, and how many there are."""
    n, plays, horizon, size = drawn.shape
    task = starts.task
    step = NUDGE * (np.array(task.action_high, np.float32) - np.array(task.action_low, np.float32)) / 2
    base = drawn.copy()
    base[:, :, 0] = np.clip(base[:, :, 0], np.array(task.action_low) + step, np.array(task.action_high) - step)
    nudged = np.repeat(np.repeat(base[:, :, None, None], size, axis=2), 2, axis=3)
    for c in range(size):
        nudged[:, :, c, 0, 0, c] -= step[c]
        nudged[:, :, c, 1, 0, c] += step[c]
    states, ends = trace(starts, np.repeat(rows, plays * size * 2), nudged.reshape(-1, horizon, size))
    states = states.reshape(n, plays, size, 2, *states.shape[1:])[..., 1:, :, :]
    ends = ends.reshape(n, plays, size, 2).min(axis=-1)
    apart = (nudged[:, :, :, 1, 0] - nudged[:, :, :, 0, 0]).max(axis=-1)  # what float32 made of twice the step
    slope = (states[:, :, :, 1] - states[:, :, :, 0]) / apart[..., None, None, None]
    both = np.arange(1, horizon + 1) < ends[..., None]
    columns = starts.levels.layout.columns.items()
    sizes = np.stack([np.sqrt((slope[..., c : c + f.width] ** 2).sum(axis=-1)) for f, c in columns], axis=-1)
    return np.where(both[..., None, None], sizes, 0.0).sum(axis=(1, 2)), both.sum(axis=(1, 2))


def _by_factor(layout: Layout, columns: np.ndarray) -> np.ndarray:
    """Columns on the last axis -> factors: the larger of a vector's components."""
    return np.stack([columns[..., c : c + f.width].max(axis=-1) for f, c in layout.columns.items()], axis=-1)


def _entries(
    levels: Levels, reach: np.ndarray, moved: np.ndarray, gains: np.ndarray, tolerance: float
) -> tuple[FactorInfluence, ...]:
    entries = []
    for e, entity in enumerate(levels.layout.names):
        for k, (factor, column) in enumerate(levels.layout.columns.items()):
            here = ~np.isnan(levels.values[:, e, column])
            if not here.any():
                continue
            most, change = np.nanmax(reach[here, e, k]), np.nanmax(moved[here, e, k])
            kind = "endogenous" if most > tolerance else "exogenous" if change > tolerance else "constant"
            share, gain = float((reach[here, e, k] > tolerance).mean()), float(np.nan_to_num(gains[e, k]))
            entries.append(FactorInfluence(entity, factor.__name__, kind, gain, float(most), share))
    return tuple(sorted(entries, key=lambda entry: (-entry.share, -entry.reach)))
