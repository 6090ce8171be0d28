"""Compiled bookkeeping of episodes: on which level they start, how long they last, the sum of their rewards."""

import numpy as np

from segar.support import GOLDEN, cached, mix, uniform

_options = {"nogil": True, "error_model": "numpy", "_nrt": False}


@cached(**_options)
def start_episodes(
    rows, seed, trials, chosen, level_values, values, level, key, tick, contacts, unresolved, returns, lengths, episodes
):
    """Start episodes in ``rows``: on ``chosen[env]`` where it is not negative, else on a level drawn uniformly.

    ``trials`` episodes in a row are on one level: those whose number, divided by ``trials``, gives the same whole number. A
    chosen level begins such a row. The draws depend on (seed, environment, episode) alone, so environment e meets the same
    levels in any batch.
    """
    for r in range(len(rows)):
        e = rows[r]
        at = chosen[e]
        if at >= 0:
            episodes[e] += -episodes[e] % trials
        k = mix(np.uint64(seed) + mix(np.uint64(e) * np.uint64(GOLDEN) + np.uint64(episodes[e])))
        if at < 0:
            at = level[e] if episodes[e] % trials else np.int64(uniform(k) * len(level_values))
        level[e] = at
        for i in range(values.shape[1]):
            for c in range(values.shape[2]):
                values[e, i, c] = level_values[at, i, c]
        key[e] = mix(k + np.uint64(at))
        tick[e] = contacts[e] = unresolved[e] = lengths[e] = 0
        returns[e] = 0.0
        episodes[e] += 1


def moved_seed(seed: int, place: int, to: int, number: int) -> np.uint64:
    """The seed by which environment ``to`` of a batch starts its episode of this number as environment ``place`` does by
    ``seed``."""
    drawn = [int(mix(np.uint64((e * int(GOLDEN) + number) % 2**64))) for e in (place, to)]
    return np.uint64((seed + drawn[0] - drawn[1]) % 2**64)


@cached(**_options)
def draw_levels(rows, seed, trials, count, cumulative, episodes, chosen):
    """Write into ``chosen[env]``, where it is negative, the level on which the episode that starts there begins.

    It is one of the first ``count`` levels, drawn uniformly where ``cumulative`` is empty, and else with probabilities that
    sum up to ``cumulative``. It stays negative where another trial on the last level follows. A uniform draw is that of
    :func:`start_episodes`.
    """
    for r in range(len(rows)):
        e = rows[r]
        if chosen[e] >= 0 or episodes[e] % trials:
            continue
        u = uniform(mix(np.uint64(seed) + mix(np.uint64(e) * np.uint64(GOLDEN) + np.uint64(episodes[e]))))
        if len(cumulative) == 0:
            chosen[e] = np.int64(u * count)
            continue
        total, low, high = cumulative[count - 1], 0, count - 1
        while low < high:  # the first level whose sum exceeds the draw, or reaches all there is
            middle = (low + high) // 2
            if cumulative[middle] > u * total or cumulative[middle] == total:
                high = middle
            else:
                low = middle + 1
        chosen[e] = low


@cached(patient=True, **_options)
def copy_numbers(values, out):
    """Copy states ``[env, entity, column]``, with 0 where an entity lacks a factor (nan)."""
    for e in range(len(values)):
        for i in range(values.shape[1]):
            for c in range(values.shape[2]):
                out[e, i, c] = values[e, i, c] if values[e, i, c] == values[e, i, c] else 0.0


@cached(patient=True, **_options)
def count_step(reward, terminated, max_steps, returns, lengths, truncated, ended):
    """Count one step and mark episodes whose time is up; list the environments whose episode ended, return how many."""
    n = 0
    for e in range(len(reward)):
        if count_one(e, reward, terminated, max_steps, returns, lengths, truncated):
            ended[n] = e
            n += 1
    return n


@cached(**_options)
def count_rows(rows, reward, terminated, max_steps, returns, lengths, truncated, ended):
    """:func:`count_step` of the environments ``rows``; ``ended``, bool ``[N]``, says which episodes ended."""
    for r in range(len(rows)):
        ended[rows[r]] = count_one(rows[r], reward, terminated, max_steps, returns, lengths, truncated)


@cached(patient=True, **_options)
def count_one(e, reward, terminated, max_steps, returns, lengths, truncated):
    """Count one step of an environment; return whether its episode ended."""
    lengths[e] += 1
    returns[e] += reward[e]
    truncated[e] = lengths[e] >= max_steps and not terminated[e]
    return truncated[e] or terminated[e]


ACTION_NOT_FINITE = 4
"""What the first of an environment's five errors says where its action was not finite; see the compiler's ``kernel`` module."""


@cached(**_options)
def check_actions(rows, actions, errors):
    """Note in ``errors``, int64 ``[N, 5]``, which of the environments ``rows`` have actions that are not finite."""
    for r in range(len(rows)):
        for c in range(actions.shape[1]):
            if errors[rows[r], 0] == 0 and not abs(actions[rows[r], c]) < np.inf:
                errors[rows[r], 0] = ACTION_NOT_FINITE
