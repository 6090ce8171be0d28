"""Distances between levels by what they do and by how they are played: metric laws and exact recursions."""

import dataclasses

import numpy as np
import pytest

import segar
from segar import GoalTile, GolfBall, Levels, Mass, Position, World
from segar.errors import LevelError, SegarError
from segar.hardness import Plan, dynamics_distances, hardness, policy_similarity
from segar.language import Framerate


def played(*paths: list[list[float]]) -> Plan:
    """A plan of these actions, one path per level."""
    actions = np.zeros((len(paths), 10, 2), np.float32)
    for i, path in enumerate(paths):
        actions[i, : len(path)] = path
    n, steps = len(paths), np.array([len(path) for path in paths])
    done = np.ones(n, bool)
    return Plan(done, ~done, steps, np.zeros(n), actions, np.zeros((n, 1, 1)), "puttputt-squared", 0, 0)


def masses(*kilograms: float) -> Levels:
    goal = GoalTile({Position: [0.9, 0.9]})
    entities = [[GolfBall({Position: [0, 0], Mass: m}), goal] for m in kilograms]
    return Levels.from_entities(entities, world=World(rules=[segar.move]))


@pytest.mark.slow
def test_the_response_of_a_free_ball_is_as_one_over_its_mass():
    levels = masses(20.0, 40.0, 80.0)
    d = dynamics_distances(levels, levels, rng=np.random.default_rng(0), horizon=10)
    assert d[0, 1] / d[0, 2] == pytest.approx((1 / 20 - 1 / 40) / (1 / 20 - 1 / 80), rel=1e-6)
    assert 0.001 < d[0, 1] < 2.0 / 20 * 10 * 10 * 5 / float(Framerate.default)


def test_levels_that_differ_in_nothing_that_moves_are_alike():
    ball = GolfBall({Position: [0, 0]})
    levels = Levels.from_entities([[ball, GoalTile({Position: [0.9, 0.9]})], [ball, GoalTile({Position: [-0.9, 0.9]})]])
    assert dynamics_distances(levels, levels, rng=np.random.default_rng(0), horizon=3).max() == 0
    moved = Levels.from_entities([[GolfBall({Position: [0.95, 0]}), GoalTile({Position: [-0.9, 0.9]})]])
    assert dynamics_distances(levels, moved, rng=np.random.default_rng(0)).min() > 0.01  # a wall is near


def test_distances_of_dynamics_keep_the_laws_of_a_metric():
    levels = segar.family("objectsx1-hard").sample(12, seed=0)
    d = dynamics_distances(levels, levels, rng=np.random.default_rng(0), sequences=4)
    assert np.array_equal(d, d.T) and (np.diag(d) == 0).all() and d.max() > 0.1
    assert (d[:, None, :] <= d[:, :, None] + d[None] + 1e-12).all()
    with pytest.raises(LevelError, match="different entities; compare sets of one layout"):
        dynamics_distances(levels, segar.family("empty-hard").sample(2), rng=np.random.default_rng(0))
    with pytest.raises(LevelError, match="no entity has a factor 'Gravity'"):
        dynamics_distances(levels, levels, rng=np.random.default_rng(0), factors=[segar.Gravity])


def test_policy_similarity_is_the_fixed_point_of_its_recursion():
    rng = np.random.default_rng(0)
    plan = played(rng.uniform(-1, 1, (4, 2)).tolist(), rng.uniform(-1, 1, (7, 2)).tolist())
    gamma = 0.9
    x, y = (np.concatenate([plan.actions[i, :n], np.zeros((1, 2))]) for i, n in ((0, 4), (1, 7)))
    cost = np.linalg.norm(x[:, None] - y[None], axis=-1)
    next_x, next_y = np.minimum(np.arange(5) + 1, 4), np.minimum(np.arange(8) + 1, 7)
    iterated = np.zeros((5, 8))
    for _ in range(500):
        iterated = cost + gamma * iterated[np.ix_(next_x, next_y)]
    assert policy_similarity(plan, plan, gamma)[0, 1] == pytest.approx(iterated[0, 0], abs=1e-12)


def test_a_difference_counts_less_the_later_it_comes():
    path = [[0.5, 0.0], [0.0, 0.5], [0.5, 0.5]]
    early, late = [[0.5, 1.0], *path[1:]], [*path[:2], [0.5, 1.0]]
    plan = played(path, early, late)
    d = policy_similarity(plan, plan, gamma=0.5)
    assert d[0] == pytest.approx([0.0, 1.0, 0.5**3], abs=1e-12)
    assert np.array_equal(d, d.T)


def test_levels_that_are_played_alike_are_near_under_the_scripted_oracle():
    goal = [0.0, 0.5]
    shifted = [([0.0, -0.5], goal), ([0.1, -0.5], [0.1, 0.5]), ([0.0, 0.5], [0.0, -0.5])]
    levels = Levels.from_entities([[GolfBall({Position: b}), GoalTile({Position: g})] for b, g in shifted])
    by_script = hardness(levels, rng=np.random.default_rng(0), plays=1, samples=8, iterations=1).scripted
    d = policy_similarity(by_script, by_script)
    assert d[0, 1] < 1e-4 < 1 < d[0, 2]


def test_discounts_and_actions_that_make_no_sense_are_refused():
    plan = played([[0.5, 0.0]])
    with pytest.raises(SegarError, match="gamma must be at least 0 and less than 1, not 1"):
        policy_similarity(plan, plan, gamma=1)
    with pytest.raises(SegarError, match="actions of 2 and of 1 numbers"):
        policy_similarity(plan, dataclasses.replace(plan, actions=plan.actions[..., :1]))
