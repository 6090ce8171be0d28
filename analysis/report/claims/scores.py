"""Algorithms compared by normalised scores on test levels, as Agarwal et al. (2021) advise, with success and regret beside.

A score is 0 for the better of idle and random play on each test level of a panel, and 1 for the planner. All runs count,
also those below the gate: that a run learned nothing is a result of its algorithm.
"""

import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from segar.analysis.report.claims.evidence import SEED
from segar.analysis.report.claims.rows import is_plain_ppo
from segar.analysis.report.results import ETA, Results
from segar.analysis.stats.association import keys
from segar.analysis.stats.estimate import Estimate
from segar.analysis.stats.resampling import FEWEST_UNITS
from segar.analysis.stats.scores import aggregates, performance_profiles, probability_of_improvement
from segar.analysis.tables import Floats, column, count_of, keep, select

COMPARED = {"figure_5a": "Self-supervised losses", "appendix_sac": "SAC and PPO"}  # experiments with several algorithms
CELLS = ("family", "difficulty", "n")  # the tasks: in each, the runs of an algorithm differ by their seeds
IQM, SUCCESS, REGRET, IMPROVEMENT = "iqm of scores", "success", "regret", "improvement"
COLUMNS = {IQM: ("score", "iqm"), SUCCESS: ("success_test_deterministic", "mean"), REGRET: ("regret", "mean")}


def scored(results: Results, experiment: str) -> pd.DataFrame | str:
    """The runs of an experiment with ``score`` and ``regret`` on test levels, of the seeds that all algorithms have in all
    cells; or why there are none."""
    runs = results.of(experiment)
    if count_of(runs, "algorithm") < 2:
        return f"several algorithms were not run (`experiments=[{experiment}]`)"
    floor, oracle = (results.player(name, "return") for name in ("floor", "oracle"))
    missing = sorted(set(runs["panel"]) - (set(floor) & set(oracle)))
    if missing:
        return f"the floor and the oracle were not measured in {', '.join(missing)} (`experiments=[anchors]`)"
    low, high = (np.array([player[panel] for panel in runs["panel"]]) for player in (floor, oracle))
    if useless := sorted(set(keep(runs, high <= low)["panel"])):
        return f"in {', '.join(useless)} the planner is no better than idle or random play, so there are no scores"
    reached = column(runs, ETA)
    whole = complete(runs.assign(score=(reached - low) / (high - low), regret=high - reached))
    return whole if len(whole) else "there is no seed that every algorithm has in every cell"


def complete(runs: pd.DataFrame) -> pd.DataFrame:
    """The runs of the seeds that have one run of each algorithm in each cell."""
    wanted = count_of(runs, "algorithm") * len(runs.groupby(list(CELLS), dropna=False))
    places = {seed: keys(of_seed, ["algorithm", *CELLS]) for seed, of_seed in runs.groupby("seed", dropna=False)}
    seeds = [seed for seed, there in places.items() if len(there) == len(set(there)) == wanted]
    return keep(runs, runs["seed"].isin(seeds))


def comparison(results: Results) -> pd.DataFrame:
    """One row per experiment, algorithm and ``measure`` (:data:`IQM`, :data:`SUCCESS`, :data:`REGRET`, and
    :data:`IMPROVEMENT` over plain PPO): the estimate with the interval of the stratified bootstrap over runs."""
    rows = []
    for experiment, runs in comparable(results):
        found = [*means_of(experiment, runs), *improvements(experiment, runs)]
        rows += [{"experiment": experiment, **row} for row in found]
    return pd.DataFrame(rows)


def comparable(results: Results) -> Iterator[tuple[str, pd.DataFrame]]:
    """The experiments of :data:`COMPARED` that have scores, each with its scored runs."""
    for experiment in COMPARED:
        runs = scored(results, experiment)
        if not isinstance(runs, str):
            yield experiment, runs


def means_of(experiment: str, runs: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """The rows of IQM, success and regret of each algorithm."""
    for measure, (value, metric) in COLUMNS.items():
        found = aggregates(runs, value, generator(experiment, measure), task=CELLS)
        for row in select(found, metric=metric).to_dict("records"):
            yield Estimate.of_row(row).row(algorithm=row["algorithm"], measure=measure)


def improvements(experiment: str, runs: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """The rows of the probability that a run of an algorithm scores above one of plain PPO; none where there is not one PPO."""
    names = sorted(set(map(str, runs["algorithm"])))
    plain = [name for name in names if is_plain_ppo(name)]
    for name in names if len(plain) == 1 else ():
        if name != plain[0]:
            rng = generator(experiment, f"{IMPROVEMENT} {name}")
            found = probability_of_improvement(runs, "score", name, plain[0], rng, task=CELLS)
            yield found.row(algorithm=name, measure=IMPROVEMENT)


def profiles(results: Results, thresholds: Floats) -> pd.DataFrame:
    """The share of runs of each algorithm that score above each threshold, per experiment with enough seeds for intervals."""
    parts = []
    for experiment, runs in comparable(results):
        if count_of(runs, "seed") >= FEWEST_UNITS:
            found = performance_profiles(runs, "score", list(thresholds), generator(experiment, "profiles"), task=CELLS)
            parts.append(found.assign(experiment=experiment))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()


def generator(experiment: str, what: str) -> np.random.Generator:
    """The generator of a bootstrap: the same for the same question, whatever else is asked."""
    return np.random.default_rng([SEED, zlib.crc32(f"{experiment} {what}".encode())])
