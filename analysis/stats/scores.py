"""Scores of few runs on several tasks, as Agarwal et al. (2021) report them: IQM, profiles, probability of improvement.

Scores are normalised, one per run and task. Intervals are of the stratified bootstrap: runs are drawn anew within each
task, tasks are not. Estimates agree with the package rliable, whose bootstrap draws from numpy's global generator.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from math import comb
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from segar.analysis.stats.association import keys, labels, require
from segar.analysis.stats.estimate import Estimate, difference
from segar.analysis.stats.resampling import FEWEST_UNITS
from segar.analysis.tables import Floats, column
from segar.errors import SegarError, did_you_mean

RESAMPLES = 2000
TASK = ("family", "difficulty")
Scores = Floats
"""float64 ``[..., runs, tasks]``; aggregates are over the last two axes."""


def iqm(scores: Scores) -> Scores:
    """Mean of the middle half of all runs on all tasks."""
    flat = scores.reshape(*scores.shape[:-2], -1)
    return np.asarray(stats.trim_mean(flat, 0.25, axis=-1))


def mean(scores: Scores) -> Scores:
    """Mean of all runs on all tasks."""
    return scores.mean(axis=(-2, -1))


def median(scores: Scores) -> Scores:
    """Median over tasks of the mean over runs."""
    return np.median(scores.mean(axis=-2), axis=-1)


def optimality_gap(scores: Scores, target: float = 1.0) -> Scores:
    """How far runs stay below ``target`` on average; scores above it count as it."""
    return target - np.minimum(scores, target).mean(axis=(-2, -1))


AGGREGATES = {one.__name__: one for one in (iqm, mean, median, optimality_gap)}


def aggregates(
    table: pd.DataFrame, score: str, rng: np.random.Generator, *, task: Sequence[str] = TASK, resamples: int = RESAMPLES
) -> pd.DataFrame:
    """Aggregates of each algorithm: columns ``algorithm``, ``metric``, ``estimate``, ``low``, ``high`` (95 %), ``n``
    (runs times tasks), ``p`` (nan), ``level``, ``note``; the metrics are "iqm", "mean", "median", "optimality_gap". Of fewer
    than three runs, or of runs that are all alike, there is no interval.

    Raises:
        SegarError: a column is missing, or a task lacks a run.
    """
    return interval_rows(matrices(table, score, task), AGGREGATES, "metric", rng, resamples)


def performance_profiles(
    table: pd.DataFrame,
    score: str,
    thresholds: Sequence[float],
    rng: np.random.Generator,
    *,
    task: Sequence[str] = TASK,
    resamples: int = RESAMPLES,
) -> pd.DataFrame:
    """Share of runs, over all tasks, that score above each threshold: columns ``algorithm``, ``threshold``, ``estimate``,
    ``low``, ``high`` (95 %, of each point by itself), ``n``, ``p`` (nan), ``level``, ``note``. Of fewer than three runs, or
    where all resamples have one share, there is no interval. Raises as :func:`aggregates`."""
    shares = {float(at): lambda runs, at=at: (runs > at).mean(axis=(-2, -1)) for at in thresholds}
    return interval_rows(matrices(table, score, task), shares, "threshold", rng, resamples)


def interval_rows(
    scores: Mapping[Any, Scores],
    functions: Mapping[Any, Callable[[Scores], Scores]],
    column: str,
    rng: np.random.Generator,
    resamples: int,
) -> pd.DataFrame:
    """Each function of each scores ``[runs, tasks]``, with its 95 % interval, where there are three runs; ``column``
    says which function."""
    rows = []
    for name, values in scores.items():
        drawn = resampled(values, rng, resamples)
        for label, function in functions.items():
            value, few = float(function(values)), too_few(values)
            low, high = (float(end) for end in np.quantile(function(drawn), (0.025, 0.975)))
            one = Estimate.between(value, low, high, values.size)
            if few:
                one = Estimate(value, np.nan, np.nan, values.size, note=few)
            rows.append(one.row(**{"algorithm": name, column: label}))
    return pd.DataFrame(rows)


def probability_of_improvement(
    table: pd.DataFrame,
    score: str,
    better: str,
    worse: str,
    rng: np.random.Generator,
    *,
    task: Sequence[str] = TASK,
    resamples: int = RESAMPLES,
) -> Estimate:
    """P(a run of ``better`` scores above one of ``worse``), mean over tasks; ties count half.

    ``p`` is that of 0.5, two-sided, from the bootstrap, and not below what dealing the runs of each task anew could give;
    ``n`` the runs of both on all tasks. Of fewer than three runs there is neither interval nor p.

    Raises:
        SegarError: as :func:`aggregates`, or one of the two is not in the table, or they did different tasks.
    """
    found = matrices(table, score, task)
    for name in (better, worse):
        if name not in found:
            raise SegarError(f"no row has algorithm '{name}'.{did_you_mean(str(name), map(str, found))}")
    done, words = keys(table, task), labels(table, task)
    tasks = [set(done[(table["algorithm"] == name).to_numpy()]) for name in (better, worse)]
    if tasks[0] != tasks[1]:
        alone = ", ".join(sorted(words[done == one][0] for one in tasks[0] ^ tasks[1]))
        raise SegarError(f"{better} and {worse} did different tasks: {alone}")
    a, b = found[better], found[worse]
    drawn = wins(resampled(a, rng, resamples), resampled(b, rng, resamples))
    value, n = float(wins(a, b)), a.size + b.size
    if few := too_few(a, b):
        return Estimate(value, np.nan, np.nan, n, note=few)
    low, high = np.quantile(drawn, (0.025, 0.975))
    side = min((drawn <= 0.5).mean(), (drawn >= 0.5).mean())
    deals = float(comb(len(a) + len(b), len(a))) ** a.shape[1]
    p = float(min(1.0, max(2 * side, 1 / resamples, 2 / deals)))
    return dataclasses.replace(Estimate.between(value, float(low), float(high), n), p=p)


def too_few(*scores: Scores) -> str:
    """Why scores [runs, tasks] have no interval: of one or two runs a bootstrap has next to no width; empty of more."""
    count = min(map(len, scores))
    return f"{count} seed{'s' * (count > 1)}: no interval" if count < FEWEST_UNITS else ""


def wins(a: Scores, b: Scores) -> Scores:
    """Share of pairs of runs in which ``a`` is above ``b``, ties half; runs may be of different number."""
    above = np.sign(difference(a[..., :, None, :], b[..., None, :, :]))
    return ((above + 1) / 2).mean(axis=(-3, -2, -1))


def matrices(table: pd.DataFrame, score: str, task: Sequence[str]) -> dict[str, Scores]:
    """Scores [runs, tasks] of each algorithm, tasks in the order of their names."""
    require(table, score, "algorithm", "seed", *task)
    found: dict[str, Scores] = {}
    whose, tasks, _ = (keys(table, names) for names in (("algorithm",), task, ("seed",)))
    for _, part in table.assign(task=tasks, **{score: column(table, score)}).groupby(whose, dropna=False):
        name = part["algorithm"].iloc[0]
        wide = part.pivot_table(score, "seed", "task", aggfunc=list, dropna=False)
        ragged = [(r, t) for r, row in wide.iterrows() for t, v in row.items() if not isinstance(v, list) or len(v) > 1]
        if ragged:
            (r, t), cell = ragged[0], wide.loc[ragged[0]]
            what, where = "several rows" if isinstance(cell, list) else "no row", labels(table, task)[tasks == t][0]
            raise SegarError(
                f"algorithm '{name}' has {what} for seed {r} on {where}; every run must have one score on every task"
            )
        found[name] = np.array([[v[0] for v in row] for row in wide.to_numpy()], np.float64)
        if not np.isfinite(found[name]).all():
            raise SegarError(f"algorithm '{name}' has a {score} that is not finite")
    return found


def resampled(scores: Scores, rng: np.random.Generator, resamples: int) -> Scores:
    """[resamples, runs, tasks]: runs drawn anew, with replacement, in each task by itself."""
    runs, tasks = scores.shape
    return scores[rng.integers(runs, size=(resamples, runs, tasks)), np.arange(tasks)]
