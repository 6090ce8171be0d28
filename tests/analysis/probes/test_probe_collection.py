"""Frames for probes: as many as asked for, aligned in time, of all that varies; and a run's probes in one table."""

import dataclasses
from unittest import mock

import numpy as np
import pandas as pd
import pytest

import segar
from segar.analysis.probes.collection import collect, collect_run, varying_columns
from segar.analysis.probes.factors import COLUMNS
from segar.analysis.probes.table import probe_run, represent
from segar.errors import SegarError
from segar.evaluation import Random, Scripted
from segar.experiments.evaluation.probing import ProbeConfig
from segar.experiments.settings import LevelsConfig
from segar.experiments.training.run import run
from tests.experiments.short_runs import short_run

TRAINING_LEVELS, TEST_LEVELS = 2, 12


@pytest.fixture(scope="module", autouse=True)
def few_scouts():
    with mock.patch("segar.analysis.probes.collection.SCOUT_STEPS", 20):
        yield


@pytest.fixture(scope="module")
def easy():
    return segar.family("empty-easy")


@pytest.fixture(scope="module")
def columns(easy):
    return varying_columns(easy)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    levels = LevelsConfig("empty-easy", count=TRAINING_LEVELS, test_count=TEST_LEVELS)
    return run(short_run(tmp_path_factory.mktemp("runs") / "one", levels=levels), say=lambda line: None).folder


def test_what_varies_does_not_depend_on_the_sample(columns):
    names = [column.name for column in columns]
    moving = [f"golfball.{factor}.{axis}" for factor in ("Position", "Velocity") for axis in "xy"]
    assert names == [*moving, "goal.Position.x", "goal.Position.y"]
    static = {column.name: column.is_static for column in columns}
    assert static["goal.Position.x"] and not static["golfball.Position.x"]


def test_types_and_missing_factors_have_columns():
    found = {column.name: column for column in varying_columns(segar.family("tilesx1-hard"))}
    assert found["tile1.type"].is_category and found["tile1.type"].law.entropy() == pytest.approx(np.log(4))
    assert {"tile1.Friction", "tile1.Heat", "golfball.Mass"} <= set(found)


@pytest.mark.parametrize("agent", [Random(0), Scripted()])
def test_a_good_agent_gives_as_many_frames_as_a_bad_one(agent, easy, columns):
    levels = easy.sample(5, seed=0, split="train")
    frames = collect(agent, levels, columns, {"observation": "state"}, frames=700, num_envs=16)
    assert len(frames) == 700 and set(frames.level) == set(range(5))
    for episode in np.unique(frames.episode):
        mine = frames.episode == episode
        assert np.array_equal(np.sort(frames.step[mine]), np.arange(mine.sum())) and len(set(frames.level[mine])) == 1


def test_factors_are_those_of_the_frame_and_late_ones_of_the_next(easy, columns):
    levels = easy.sample(5, seed=0, split="train")
    frames = collect(Random(0), levels, columns, {"observation": "state"}, frames=600, num_envs=8)
    assert frames.factors.astype(np.float32)[:, :2] == pytest.approx(frames.observation[:, :2])  # the ball's place
    for episode in np.unique(frames.episode):
        mine = np.flatnonzero(frames.episode == episode)
        mine = mine[np.argsort(frames.step[mine])]
        assert np.array_equal(frames.late[mine][:-1], frames.factors[mine][1:])
    start = frames.factors[frames.step == 0]
    assert (start[:, :4] == 0).all()  # in the centre, at rest


def test_after_the_last_step_the_late_factors_are_of_another_level(easy, columns):
    """What 2022 paired the last frame with: the first state of the next episode."""
    frames = collect(Scripted(), easy.sample(20, seed=0, split="train"), columns, {"observation": "state"}, num_envs=20)
    last = np.array([np.flatnonzero(frames.episode == e)[-1] for e in range(20)])
    goal = [k for k, column in enumerate(columns) if column.slot == "goal"]
    moved = (frames.late[last][:, goal] != frames.factors[last][:, goal]).any(axis=1)
    assert moved.mean() > 0.8
    assert (frames.late[last][:, :4] == 0).all()


def test_collecting_repeats_itself(easy, columns):
    levels = easy.sample(3, seed=0, split="test")
    a, b = (collect(Random(3), levels, columns, {"observation": "state"}, frames=100, num_envs=4) for _ in range(2))
    assert np.array_equal(a.observation, b.observation) and np.array_equal(a.factors, b.factors)


def test_a_run_s_policy_represents_its_own_levels(folder):
    policy, frames = collect_run(folder, "test", frames=200, num_envs=8)
    pairs = frames.pairs(policy.represent)
    assert pairs.representation.shape == (200, 8) and len(pairs.columns) == pairs.factors.shape[1] == 6
    assert np.array_equal(pairs.representation[:5], policy.represent(frames.observation[:5]))


def test_representations_differ_and_frames_do_not(folder):
    policy, frames = collect_run(folder, "train", frames=200, num_envs=8)
    trained = frames.pairs(policy.represent)
    for kind in ("random encoder", "pixel PCA"):
        found = represent(kind, frames, trained, folder, np.random.default_rng(0))
        assert np.array_equal(found.factors, frames.factors)
        assert not np.array_equal(found.representation, trained.representation)


FEW = ProbeConfig(
    frames=300, num_envs=16, replicates=2, steps=100, paper_frames=100, paper_replicates=1,
    representations={"trained": ["jsd", "ridge"], "identity": ["jsd"]},
)  # fmt: skip


def test_all_probes_of_a_run_make_one_table(folder):
    table = probe_run(folder, FEW)
    assert list(table.columns[:3]) == ["run", "levels", "representation"] and set(COLUMNS) <= set(table.columns)
    assert set(table.probe) == {"jsd", "ridge", "paper", "paper, joint marginal"}
    asked = table[["levels", "representation", "probe"]].drop_duplicates()
    assert len(asked) == 2 * (2 + 1 + 2)  # on both level sets two of the trained one, one of identity, two of 2022
    accuracy = table[(table.probe == "jsd") & (table.quantity == "accuracy") & (table.levels == "test")]
    by = accuracy.set_index("representation").estimate
    assert by["identity"] > 0.9 and by["trained"] > 0.6
    assert table[table.probe == "paper"].levels.tolist() == ["train", "test"]


def test_test_levels_are_not_divided_and_training_levels_are(folder):
    """Split by episodes, levels that are seen again and again are known by heart, and so is all that is hidden there."""
    table = probe_run(folder, dataclasses.replace(FEW, paper_replicates=0, representations={"trained": ["ridge"]}))
    units = table.groupby("levels").n.max()
    assert units["test"] <= TEST_LEVELS and units["train"] > TRAINING_LEVELS


@pytest.mark.slow
def test_what_is_asked_of_one_representation_changes_nothing_about_another(folder):
    alone = probe_run(folder, dataclasses.replace(FEW, paper_replicates=0, representations={"identity": ["jsd"]}))
    among = probe_run(folder, FEW)
    among = among.loc[among.representation == "identity"].reset_index(drop=True)
    pd.testing.assert_frame_equal(alone[["estimate"]], among[["estimate"]])


def test_errors_name_the_culprit(folder):
    with pytest.raises(SegarError, match="levels must be 'train' or 'test', not 'tets'"):
        collect_run(folder, "tets")
    with pytest.raises(SegarError, match=r"representations: 'trainde' is unknown. Did you mean 'trained'"):
        ProbeConfig(representations={"trainde": ["jsd"]})
    with pytest.raises(SegarError, match=r"frames of 1 test levels.*4 are needed.*probes.<scale>.frames"):
        probe_run(folder, dataclasses.replace(FEW, num_envs=1, frames=4))
