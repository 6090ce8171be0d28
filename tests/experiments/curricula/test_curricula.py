"""Endless levels and curricula: the same to the bit again and after an interruption, and what they choose."""

import dataclasses

import numpy as np
import pytest

from segar.envs import VectorEnv
from segar.experiments.curricula import Explorer, LevelRows, ScoredRows
from segar.experiments.curricula.accel import ACCEL
from segar.experiments.curricula.level_rows import MADE
from segar.experiments.levels.builders import Prepared
from segar.experiments.levels.endless import stream_of
from segar.experiments.runs.run_folder import read_metrics, read_played
from segar.experiments.settings import (
    KINDS,
    ACCELConfig,
    ConfigError,
    LevelsConfig,
    ObservationConfig,
    PLRConfig,
    RobustPLRConfig,
    RunConfig,
    ScaleConfig,
    SFLConfig,
    UniformConfig,
    run_config,
)
from segar.experiments.settings.run import as_data
from segar.experiments.training.run import run
from segar.levels import check_levels, near_levels
from segar.suites import suite
from tests.experiments.short_runs import FRAMES, ITERATIONS, run_killed, same_results, short_run

ENDLESS = LevelsConfig(train="empty-easy", count="endless", test_count=3)
PPO = KINDS["ppo"](num_envs=8, num_steps=8, widths=(8,), head_width=0)
RECURRENT = KINDS["ppo_recurrent"](num_envs=8, num_steps=8, widths=(8,), head_width=0, core_width=4, minibatches=2)
SMALL = {"capacity": 16, "min_scored": 0.25, "log_interval": FRAMES}
TRIED = {**SMALL, "batch": 8, "counts_tried": False}
ROLLOUT = {"num_envs": 4, "num_steps": 16, "widths": (8,)}
REPLAY = {**ROLLOUT, "warmup": 8, "capacity": 500, "batch_size": 4}
AUXILIARY = {**ROLLOUT, "head_width": 0, "encoder": "small", "auxiliary_minibatches": 1}
CHOSEN = {
    "endless": (None, PPO),
    "endless, collected ahead": (None, dataclasses.replace(PPO, overlap=True)),
    "uniform": (UniformConfig(log_interval=FRAMES), RECURRENT),
    "plr": (PLRConfig(**SMALL), PPO),
    "plr, recurrent": (PLRConfig(**SMALL, score="max_mc"), RECURRENT),
    "plr, normalised": (PLRConfig(**SMALL, score="value_l1"), dataclasses.replace(PPO, reward_normalise=True)),
    "plr, regret": (PLRConfig(**SMALL, score="regret", planner_samples=8, planner_iterations=1), PPO),
    "plr_robust": (RobustPLRConfig(**TRIED), PPO),
    "accel": (ACCELConfig(**TRIED), RECURRENT),
    "sfl": (SFLConfig(candidates=4, kept=2, episodes=2, batch=8, interval=FRAMES, counts_tried=False), PPO),
    "sac": (None, KINDS["sac"](**REPLAY)),
    "drq": (None, KINDS["drq"](**REPLAY, encoder="small")),
    "curl": (None, KINDS["curl"](**AUXILIARY)),
    "spr": (None, KINDS["spr"](**AUXILIARY)),
}


QUICK = ("endless", "accel", "sfl")  # the others are variants of these


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name not in QUICK)) for name in CHOSEN]
)
def test_an_interrupted_run_ends_like_one_that_was_not_interrupted_to_the_bit(name, tmp_path):
    curriculum, algorithm = CHOSEN[name]
    seen = ObservationConfig("rgb" if name in ("drq", "curl", "spr") else "state")
    config = {"levels": ENDLESS, "curriculum": curriculum, "algorithm": algorithm, "observation": seen}
    whole, parts = (short_run(tmp_path / one, **config) for one in ("whole", "parts"))
    run(whole, say=lambda _: None)
    run_killed(parts, ITERATIONS // 2)
    run(parts, say=lambda _: None)
    assert same_results(tmp_path / "whole", tmp_path / "parts")
    assert read_played(tmp_path / "whole").equals(read_played(tmp_path / "parts"))


@pytest.mark.slow
def test_each_episode_of_endless_training_is_on_another_level(tmp_path):
    run(short_run(tmp_path, levels=ENDLESS, scale=ScaleConfig(frames=40 * FRAMES)), say=lambda _: None)
    played = read_played(tmp_path)
    assert set(played["episodes"].to_pylist()) == {1}
    levels = played["level"].to_pylist()
    assert len(set(levels)) == len(levels) > 20


def test_a_stream_gives_the_levels_of_the_training_split_in_their_order():
    stream, at_once = (
        stream_of(Prepared(RunConfig(levels=ENDLESS))),
        stream_of(Prepared(RunConfig(levels=ENDLESS))).take(12),
    )
    assert [*stream.take(5).provenance.indices, *stream.take(7).provenance.indices] == [*at_once.provenance.indices]
    assert at_once == stream_of(Prepared(RunConfig(levels=ENDLESS))).distribution.sample(12, seed=0, split="train")


def test_a_stream_of_a_suite_has_no_level_of_its_test():
    of_suite, name = suite("place-few-v1"), "place-few-v1"
    levels = stream_of(Prepared(RunConfig(levels=LevelsConfig(train=name, count="endless")))).take(300)
    assert not near_levels(levels, of_suite.test_levels, 0.0, of_suite.train).any()


def test_a_uniform_curriculum_on_a_fixed_set_changes_no_bit(tmp_path, trained_once):
    run(short_run(tmp_path / "uniform", curriculum=UniformConfig()), say=lambda _: None)
    columns = [read_metrics(folder).to_pylist() for folder in (trained_once, tmp_path / "uniform")]
    none, uniform = (
        [(row["name"], row["value"]) for row in rows if row["name"].split("/")[0] not in ("speed", "played")]
        for rows in columns
    )
    assert none == uniform


def test_a_run_without_a_curriculum_keeps_its_name_and_settings():
    config = RunConfig()
    assert "curriculum" not in config.identity()
    assert run_config(as_data(config)) == config
    chosen = dataclasses.replace(config, curriculum=ACCELConfig(), levels=ENDLESS)
    assert run_config(as_data(chosen)) == chosen
    assert chosen.label().startswith("empty-easy-nendless-state-ppo-accel-s0-")


def test_replay_prefers_ranks_and_stale_levels_as_published():
    rows = ScoredRows(4)
    rows.score[:3], rows.episodes, rows.played[:3] = (0.1, 0.3, 0.2), 10, (10, 8, 2)
    found = rows.replay_probabilities(PLRConfig(temperature=0.5, staleness=0.2))
    by_score = np.array([1 / 9, 1.0, 1 / 4]) / (1 + 1 / 4 + 1 / 9)
    by_time = np.array([0.0, 2.0, 8.0]) / 10
    np.testing.assert_allclose(found, [*(0.8 * by_score + 0.2 * by_time), 0.0])


def test_the_highest_scores_stay_whatever_comes_in_which_order():
    rng = np.random.default_rng(0)
    scores, rows = rng.permutation(40).astype(float), ScoredRows(10)
    for block in scores.reshape(8, 5):
        taken, places = rows.places_for(block)
        rows.score[places] = block[taken]
    assert sorted(rows.score) == list(range(30, 40))


@pytest.mark.slow
def test_plr_plays_rare_hard_levels_more_than_uniform_does_and_the_log_shows_it(tmp_path, monkeypatch):
    """The scores are planted: every tenth level of the set is hard."""
    hard, shares = {*range(0, 40, 10)}, {}

    def planted(name, ended, levels, known, explorer):
        return np.array([float(row in hard) for row in ended.row])

    monkeypatch.setattr("segar.experiments.curricula.scores.scores_of", planted)
    levels = LevelsConfig(train="empty-easy", count=40, test_count=3)
    for curriculum in (UniformConfig(log_interval=FRAMES), PLRConfig(log_interval=FRAMES, staleness=0.1)):
        folder = tmp_path / curriculum.name
        config = short_run(folder, levels=levels, curriculum=curriculum, scale=ScaleConfig(frames=100 * FRAMES))
        run(config, say=lambda _: None)
        late = [row for row in read_played(folder).to_pylist() if row["frames"] > 50 * FRAMES]
        of_hard = sum(row["episodes"] for row in late if row["level"] in hard)
        shares[curriculum.name] = of_hard / sum(row["episodes"] for row in late)
    assert shares["uniform"] < 0.3
    assert shares["plr"] > 0.7


@pytest.mark.parametrize("name", ["place-few-v1", "property-heavy-v1", "number-more-v1"])
def test_children_of_accel_are_levels_of_the_distribution_and_none_of_the_test(name):
    of_suite = suite(name)
    stream = stream_of(Prepared(RunConfig(levels=LevelsConfig(train=name, count="endless"))))
    rows = LevelRows(VectorEnv(stream.take(32), 4, seed=0, task=of_suite.task), stream)
    accel = ACCEL(ACCELConfig(changes=2), rows, Explorer(VectorEnv, 4, (8, 1), 0), seed=0)
    accel.known.score[:] = np.arange(32)
    for _ in range(3):  # children have children
        children = accel.children(32)
        assert children is not None
        check_levels(children)
        assert np.isfinite(of_suite.train.log_prob(children, normalised=False)).all()
        assert not near_levels(children, of_suite.test_levels, 0.0, of_suite.train).any()
        rows.put(np.arange(len(children)), children, made=True)
    assert (rows.number[: len(children)] == MADE).all()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"curriculum": ACCELConfig()}, "plays levels beyond any fixed set; give levels.count=endless"),
        (
            {"curriculum": PLRConfig(), "algorithm": KINDS["sac"](num_envs=4, warmup=8)},
            "SAC has none, because it learns",
        ),
        ({"curriculum": PLRConfig(), "algorithm": dataclasses.replace(PPO, overlap=True)}, "algorithm.overlap=false"),
    ],
)
def test_what_does_not_fit_is_refused_and_leaves_no_folder(changes, message, tmp_path):
    with pytest.raises(ConfigError, match=message):
        run(short_run(tmp_path / "run", **changes), say=lambda _: None)
    assert not (tmp_path / "run").exists()


def test_a_level_file_is_not_endless(tmp_path):
    path = tmp_path / "levels.npz"
    suite("place-few-v1").train.sample(3).save(path)
    levels = LevelsConfig(train=str(path), test="empty-easy", count="endless")
    with pytest.raises(ConfigError, match="has 3 levels and no others, so they are not endless"):
        run(short_run(tmp_path / "run", levels=levels), say=lambda _: None)
