"""Evaluation: every level once, every reward counted, whatever the batch."""

import numpy as np
import pytest
import torch

from segar import GolfBall, Gravity, Levels, family
from segar.envs import VectorEnv
from segar.evaluation import episodes
from segar.experiments.evaluation.episodes import (
    distance_figures,
    diversity_figures,
    evaluate_run,
    play_episodes,
    unseen_by_distances,
)
from segar.experiments.levels.builders import Prepared
from segar.experiments.settings import EvaluationConfig, RunConfig
from segar.language import Visible
from segar.metrics import ks, w2


class Linear:
    """A policy that pushes along a part of what it sees."""

    def act(self, observation, *, rng):
        action = np.tanh(observation[:, :2])
        if rng is not None:
            action = action + torch.randn(action.shape, generator=rng).numpy()
        return action.astype(np.float32)


def test_only_where_no_exact_distance_is_asked_for_a_run_says_what_the_others_do_not_see():
    """Exact sees the pull, and stands beside the others; of what it leaves out itself it tells in any case."""
    pull = [Levels.from_entities([[GolfBall()]], parameters={Gravity: value}) for value in (8.0, 12.0)]
    for modes in (["exact"], ["exact", "reference"], ["reference", "exact", "paper"]):
        assert unseen_by_distances(*pull, modes) == []
    (said,) = unseen_by_distances(*pull, ["reference"])
    assert "w2/reference does not see" in said and "parameter Gravity: 8 against 12" in said
    sight = [Levels.from_entities([[GolfBall({Visible: value})]]) for value in (False, True)]
    (said,) = unseen_by_distances(*sight, ["exact", "reference"])
    assert "w2/exact does not see" in said and "factor Visible of GolfBall" in said


LEVELS = family("tilesx1-easy").sample(12, seed=1)


def plain_episode(level, policy):
    """The rewards of one episode, step by step in an environment of its own."""
    env = VectorEnv(LEVELS, 1, autoreset_mode="Disabled")
    observation, _ = env.reset(options={"levels": np.array([level])})
    rewards, over = [], False
    while not over:
        observation, reward, terminated, truncated, info = env.step(policy.act(observation, rng=None))
        rewards.append(reward[0])
        over = terminated[0] or truncated[0]
    return rewards, bool(info["success"][0]), bool(info["death"][0])


def played(policy):
    return play_episodes(policy, LEVELS, np.arange(12), {}, rng=None, seed=0)


@pytest.fixture(scope="module")
def rows():
    """The episodes of a policy on all levels."""
    return played(Linear())


def test_every_level_is_played_as_in_an_environment_of_its_own(rows):
    assert [row["level"] for row in rows] == list(range(12))
    for level, row in enumerate(rows):
        rewards, success, death = plain_episode(level, Linear())
        assert row["return"] == pytest.approx(sum(rewards), rel=1e-12)
        assert row["return_ref"] == pytest.approx(sum(rewards[:-1]), rel=1e-12, abs=1e-9)
        assert (row["length"], row["success"], row["death"]) == (len(rewards), success, death)


def test_results_do_not_depend_on_the_batch(rows, monkeypatch):
    monkeypatch.setattr(episodes, "BATCH", 5)
    assert played(Linear()) == rows


class Counting(Linear):
    """Notes for how many environments it acts; one with ``begin`` knows them all."""

    def __init__(self):
        self.acted = []

    def act(self, observation, *, rng):
        self.acted.append(len(observation))
        return super().act(observation, rng=rng)


class Remembering(Counting):
    def begin(self, env):
        self.number = env.num_envs


def test_only_those_act_whose_episode_goes_on_unless_the_policy_knows_its_environments(rows):
    lengths = np.array([row["length"] for row in rows])
    some, all_of_them = Counting(), Remembering()
    assert played(some) == played(all_of_them) == rows
    assert some.acted == [int((lengths > t).sum()) for t in range(lengths.max())]
    assert all_of_them.acted == [12] * lengths.max()


def test_training_levels_are_played_equally_often_and_test_levels_once():
    config = RunConfig(evaluation=EvaluationConfig(episodes=10))
    train, test = LEVELS[:4], LEVELS[4:]
    rows = evaluate_run(Linear(), Prepared(config), train, test)
    for mode in ("deterministic", "sampled"):
        played = {
            name: [r["level"] for r in rows if r["levels"] == name and r["action_mode"] == mode]
            for name in ("train", "test")
        }
        assert np.bincount(played["train"]).tolist() == [3, 3, 3, 3]  # 10 episodes at least
        assert sorted(played["test"]) == list(range(8))
    assert evaluate_run(Linear(), Prepared(config), train, test) == rows


def test_distances_are_those_of_the_library():
    figures = distance_figures(LEVELS[:4], LEVELS[4:], ("reference", "exact"))
    distances = {f"w2/{mode}": w2(LEVELS[:4], LEVELS[4:], mode=mode) for mode in ("reference", "exact")}
    assert figures == {**distances, "ks": ks(LEVELS[:4], LEVELS[4:])}


def test_levels_that_are_equal_are_worth_one_and_those_far_apart_more():
    one, all_of_them = (diversity_figures(levels, LEVELS[4:]) for levels in (LEVELS[[0] * 4], LEVELS[:4]))
    assert one["diversity/effective_number"] == pytest.approx(1.0)
    assert 1.0 < all_of_them["diversity/effective_number"] <= 4.0
    assert all_of_them["diversity/radius"] <= one["diversity/radius"]
