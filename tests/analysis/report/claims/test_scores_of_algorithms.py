"""Algorithms compared by scores: planted returns have the scores that they must have, and what is missing is said."""

import numpy as np
import pandas as pd
import pytest

from segar.analysis.report.claims.evidence import Evidence
from segar.analysis.report.claims.scores import (
    COMPARED,
    IMPROVEMENT,
    IQM,
    REGRET,
    SUCCESS,
    comparison,
    profiles,
    scored,
)
from segar.analysis.report.document.blocks import Bullets, Table
from segar.analysis.report.document.tables import compared
from segar.analysis.report.figures.agents import THRESHOLDS, performance_profiles
from segar.analysis.report.figures.drawing import NoFigure
from segar.analysis.report.results import read_results
from tests.synthetic_results import player_rows, run_rows, write_players, write_results

FLOOR, ORACLE, SEEDS = -10.0, -2.0, 4
REACHED = {"ppo_fast": (-8.0, -4.0), "ppo_fast_five_epochs": (FLOOR, FLOOR), "spr_fast": (ORACLE, ORACLE)}


def planted(experiment="figure_5a", seeds=SEEDS, reached=None):
    """Runs whose return on test levels is drawn from a range."""
    rng = np.random.default_rng(0)
    parts = []
    for algorithm, (low, high) in (reached or REACHED).items():
        part = run_rows(rng, experiment, algorithm=algorithm, seeds=seeds, families=("empty",), counts=(1, 10))
        part["eta_test_deterministic"] = rng.uniform(low, high, len(part))
        part["success_train_deterministic"] = 0.0  # none is above the gate
        parts.append(part)
    return pd.concat(parts, ignore_index=True)


def results_of(folder, runs, players=None):
    write_results(folder, {"runs": runs})
    write_players(folder, player_rows(FLOOR, ORACLE) if players is None else players)
    return read_results(folder)


def value(table, algorithm, measure, name="estimate"):
    (row,) = table[(table["algorithm"] == algorithm) & (table["measure"] == measure)].to_dict("records")
    return row[name]


def test_the_floor_scores_0_and_the_oracle_1_and_a_mixture_lies_between(tmp_path):
    results = results_of(tmp_path, planted())
    table = comparison(results)
    assert value(table, "ppo_fast_five_epochs", IQM) == 0.0 and value(table, "spr_fast", IQM) == 1.0
    assert value(table, "ppo_fast_five_epochs", REGRET) == ORACLE - FLOOR and value(table, "spr_fast", REGRET) == 0.0
    assert value(table, "spr_fast", IMPROVEMENT) == 1.0 and value(table, "ppo_fast_five_epochs", IMPROVEMENT) == 0.0
    low, middle, high = (value(table, "ppo_fast", IQM, name) for name in ("low", "estimate", "high"))
    assert 0.25 < low < middle < high < 0.75
    runs = scored(results, "figure_5a")
    np.testing.assert_allclose(runs["score"], 1 - runs["regret"] / (ORACLE - FLOOR))
    assert value(table, "ppo_fast", SUCCESS) == pytest.approx(runs["success_test_deterministic"].mean())
    assert set(table["n"]) == {SEEDS * 6, 2 * SEEDS * 6}  # of an algorithm: seeds in six cells; of a comparison: of two


def test_a_profile_begins_at_all_runs_and_falls(tmp_path):
    results = results_of(tmp_path, planted())
    table = profiles(results, THRESHOLDS)
    for algorithm, part in table.groupby("algorithm"):
        assert part["estimate"].iloc[0] == 1.0 and (part["estimate"].diff().dropna() <= 0).all(), algorithm
        assert part["estimate"].iloc[-1] == 0.0
    drawn = performance_profiles(Evidence(results))
    assert len(drawn.table) == len(table)
    assert [axes.get_title() for axes in drawn.figure.axes] == ["Self-supervised losses"]


def test_a_seed_without_one_of_the_runs_is_left_out_for_all_and_this_is_said(tmp_path):
    results = results_of(tmp_path, planted().iloc[1:])
    assert set(scored(results, "figure_5a")["seed"]) == {2, 3, 4}
    said, table = compared(Evidence(results))
    assert isinstance(said, Bullets) and isinstance(table, Table)
    assert said.items[0] == (
        "Self-supervised losses: 3 algorithms with 18 runs each, of 3 seeds in 6 cells; 17 runs of seeds that lack others are"
        " left out."
    )
    assert said.items[1].startswith("SAC and PPO: several algorithms were not run")
    assert [row[1:4] for row in table.rows][1:] == [
        ["PPO, more gradient steps", "18", "0.00"],
        ["PPO with SPR", "18", "1.00"],
    ]
    assert table.rows[0][-1] == "–"  # PPO is not compared with itself


def test_two_seeds_have_no_interval_and_no_profile(tmp_path):
    results = results_of(tmp_path, planted("appendix_sac", 2, {"drq": (-9.0, -8.0), "ppo_fast": (-8.0, -7.0)}))
    table = comparison(results)
    assert set(table["experiment"]) == {"appendix_sac"} and set(table["note"]) == {"2 seeds: no interval"}
    assert table[["low", "high", "p"]].isna().all(axis=None) and np.isfinite(table["estimate"]).all()
    with pytest.raises(NoFigure, match="no experiment has scores"):
        performance_profiles(Evidence(results))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (
            lambda players: players[players["player"] != "floor"],
            "the floor and the oracle were not measured in empty-easy",
        ),
        (lambda players: players.assign(**{"return": -1.0}), "the planner is no better than idle or random play"),
    ],
)
def test_without_a_scale_there_are_no_scores_and_the_reason_is_said(tmp_path, change, reason):
    results = results_of(tmp_path, planted(), change(player_rows(FLOOR, ORACLE)))
    assert reason in scored(results, "figure_5a")
    (said,) = compared(Evidence(results))
    assert reason in said.items[0] and len(said.items) == len(COMPARED)
