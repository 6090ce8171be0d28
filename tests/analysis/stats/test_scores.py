"""Scores of few runs: rliable's own answers (recorded, see provenance in the file), and laws."""

import json

import numpy as np
import pandas as pd
import pytest

from segar.analysis.stats.scores import aggregates, performance_profiles, probability_of_improvement, wins
from segar.errors import SegarError
from tests.places import ROOT

RECORDED = json.loads((ROOT / "tests" / "data" / "rliable" / "outputs.json").read_text())
SCORES = {name: np.array(scores) for name, scores in RECORDED["scores"].items()}


def rng(seed=0):
    return np.random.default_rng(seed)


def as_table(scores):
    rows = [
        {"algorithm": name, "seed": seed, "task": f"t{task}", "score": value}
        for name, matrix in scores.items()
        for (seed, task), value in np.ndenumerate(matrix)
    ]
    return pd.DataFrame(rows).sample(frac=1, random_state=0)  # the order of rows means nothing


TABLE = as_table(SCORES)
OPTIONS = {"task": ("task",)}


@pytest.fixture(scope="module")
def many():
    return aggregates(TABLE, "score", rng(), resamples=20_000, **OPTIONS)


@pytest.mark.parametrize("name", ["a", "b"])
@pytest.mark.parametrize("aggregate", ["iqm", "mean", "median", "optimality_gap"])
def test_aggregates_are_rliables(name, aggregate, many):
    row = many[(many.algorithm == name) & (many.metric == aggregate)].iloc[0]
    assert row.estimate == pytest.approx(RECORDED["aggregates"][name][aggregate], rel=1e-12)
    expected = RECORDED["aggregate_intervals"][name][aggregate]  # of 20 000 resamples, too
    assert (row.low, row.high) == pytest.approx(expected, abs=0.004)


def test_profiles_are_rliables():
    found = performance_profiles(TABLE, "score", RECORDED["thresholds"], rng(), resamples=4000, **OPTIONS)
    for name in ("a", "b"):
        part = found[found.algorithm == name]
        assert part.estimate.to_numpy() == pytest.approx(RECORDED["profiles"][name], rel=1e-12)
        low, high = np.array(RECORDED["profile_intervals"][name])
        wide = high > low  # where all runs are on one side, rliable's have no width, and here there are none
        assert 0 < wide.sum() < len(wide) and (part["note"][~wide] != "").all()
        assert part[~wide][["low", "high"]].isna().to_numpy().all()
        assert pytest.approx(np.array([low, high])[:, wide], abs=0.025) == part[wide][["low", "high"]].to_numpy().T


def test_probability_of_improvement_is_rliables():
    found = probability_of_improvement(TABLE, "score", "a", "b", rng(), resamples=4000, **OPTIONS)
    assert found.estimate == pytest.approx(RECORDED["improvement"]["estimate"], rel=1e-12)
    assert (found.low, found.high) == pytest.approx(RECORDED["improvement"]["interval"], abs=0.01)


def test_improvement_over_oneself_is_a_half_and_both_ways_make_one():
    a, b = SCORES["a"], SCORES["b"]
    assert wins(a, a) == 0.5
    assert wins(a, b) + wins(b, a) == pytest.approx(1)


def test_a_missing_run_and_an_unknown_algorithm_are_named():
    less = TABLE[~((TABLE.algorithm == "a") & (TABLE.seed == 2) & (TABLE.task == "t3"))]
    with pytest.raises(SegarError, match="'a' has no row for seed 2 on t3"):
        aggregates(less, "score", rng(), **OPTIONS)
    with pytest.raises(SegarError, match="no row has algorithm 'c'"):
        probability_of_improvement(TABLE, "score", "a", "c", rng(), **OPTIONS)
