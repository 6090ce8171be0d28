"""Hardness of levels: shares with honest intervals, and laws of who solves more than whom."""

import json

import numpy as np
import pytest
from scipy import stats

import segar
from segar.errors import SegarError
from segar.hardness import hardness, random_episodes, replay, wilson_interval
from segar.hardness.rollouts import OpenLoop, make_starts, play_forks, uniform_actions


def test_wilson_s_interval_is_the_one_of_scipy():
    for hits, trials in ((0, 10), (3, 10), (200, 200), (77, 1000)):
        expected = stats.binomtest(hits, trials).proportion_ci(method="wilson")
        assert wilson_interval(hits / trials, trials) == pytest.approx((expected.low, expected.high), abs=1e-12)


def test_random_success_grows_with_the_goal():
    levels = segar.family("empty-hard").sample(10, seed=0)
    small, large = (
        random_episodes(make_starts(levels, segar.puttputt(goal_distance=d)), 15, np.random.default_rng(0))[0].mean()
        for d in (0.01, 0.1)
    )
    assert small > 0.05 and small + 0.2 < large


def test_a_level_s_report_says_who_solved_it_and_the_oracle_solves_what_the_script_does():
    levels = segar.family("objectsx1-hard").sample(12, seed=0)
    found = hardness(levels, rng=np.random.default_rng(0), plays=20, samples=32, iterations=3)
    assert found.scripted is not None
    assert (found.oracle.solved >= found.scripted.solved).all() and replay(levels, found.oracle).all()
    rows = json.loads(json.dumps(found.rows()))
    assert all(row["random_success_95"][0] <= row["random_success"] <= row["random_success_95"][1] for row in rows)
    assert [row["level"] for row in rows] == list(range(12))
    assert all((row["oracle_steps"] is not None) == row["oracle_solved"] for row in rows)


def test_the_summary_is_of_all_levels():
    levels = segar.family("empty-hard").sample(10, seed=0)
    with pytest.raises(SegarError, match="at least 1 random play per level, not 0"):
        hardness(levels, rng=np.random.default_rng(0), plays=0)
    found = hardness(levels, rng=np.random.default_rng(0), plays=10, samples=16, iterations=1)
    summary = json.loads(json.dumps(found.summary()))
    assert summary["levels"] == 10 and summary["task"] == "puttputt-squared"
    assert summary["scripted_success"] == summary["oracle_success"] == 1.0
    assert summary["oracle_success_95"] == pytest.approx([0.7225, 1.0], abs=1e-3)  # Wilson, 10 of 10
    assert summary["oracle_rollouts"] == 10 * (2 + 16)
    assert summary["oracle_return"] >= summary["scripted_return"] > summary["random_return"]


def test_episodes_in_a_batch_go_as_in_an_environment():
    levels = segar.family("objectsx1-hard").sample(16, seed=0)
    starts = make_starts(levels, seed=3)
    actions = uniform_actions(starts.task, 16, 100, np.random.default_rng(0))
    played = play_forks(starts, np.arange(16), OpenLoop(actions))
    env = segar.envs.VectorEnv(levels, 16, seed=3)
    env.reset(options={"levels": np.arange(16)})
    seen = np.zeros(16, bool)
    for t in range(100):
        _, _, _, _, info = env.step(actions[:, t])
        for e in np.flatnonzero(info.get("_final_info", np.zeros(16, bool)) & ~seen):
            final = info["final_info"]
            assert (final["length"][e], final["return"][e]) == (played.steps[e], played.returns[e])
            assert (final["success"][e], final["death"][e]) == (played.solved[e], played.died[e])
            seen[e] = True
    assert seen.all() and 0 < played.solved.sum() < 16
