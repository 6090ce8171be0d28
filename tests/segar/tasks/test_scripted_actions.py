"""The scripted player has one form: all who play it give it a batch, and actions of another shape are refused."""

import dataclasses

import numpy as np
import pytest

import segar
from segar import GoalTile, GolfBall, SegarError, cli
from segar.envs import Env, VectorEnv
from segar.hardness import hardness
from segar.tasks import TASKS, with_conditions

LEVELS = segar.family("empty-easy").sample(3, seed=0)


def batched(factors):
    """Straight to the goal, for factors with a leading axis of environments only."""
    ball, goal = factors.slots(GolfBall)[0], factors.slots(GoalTile)[0]
    x = factors["Position"]
    assert x.ndim == 3
    return np.clip(x[:, goal] - x[:, ball], -1, 1)


def unbatched(factors):
    ball, goal = factors.slots(GolfBall)[0], factors.slots(GoalTile)[0]
    x = factors["Position"]
    return (x[..., goal, :] - x[..., ball, :]).reshape(-1)[:2]


def task(player) -> segar.Task:
    return dataclasses.replace(segar.puttputt(), name="mine", demo_actions=player)


mine = task(batched)


def test_a_single_environment_and_a_batch_of_one_have_the_same_action():
    single, batch = Env(LEVELS, task=mine, seed=0), VectorEnv(LEVELS, 1, task=mine, seed=0)
    single.reset(seed=0, options={"level": 1})
    batch.reset(seed=0, options={"levels": np.array([1])})
    action, actions = mine.scripted_actions(single.factors), mine.scripted_actions(batch.factors)
    assert action.shape == (2,) and actions.shape == (1, 2) and action.dtype == np.float32
    np.testing.assert_array_equal(action, actions[0])


@pytest.mark.parametrize("name", TASKS)
def test_the_players_of_built_in_tasks_take_batches_and_single_environments(name):
    of = segar.family("billiards" if "billiards" in name else "empty-easy")
    levels = (with_conditions(of) if "conditional" in name else of).sample(2, seed=0)
    env = Env(levels, task=TASKS[name](), seed=0)
    env.reset(seed=0)
    single = env.task.scripted_actions(env.factors)
    np.testing.assert_array_equal(single, env.task.demo_actions(env.factors))


def test_all_callers_give_a_batch(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "minari"))
    found = hardness(LEVELS, mine, rng=np.random.default_rng(0), plays=1, samples=8, iterations=1)
    assert found.scripted is not None and found.scripted.solved.all()
    command = f"record empty-easy -n 1 --policy script --task {__name__}:mine --episodes 1 --size 64"
    for place in (str(tmp_path / "film.gif"), "script/own-v0"):
        assert cli.main([*command.split(), "-o", place]) == 0, capsys.readouterr().err


def test_actions_of_another_shape_are_refused_with_the_one_that_is_wanted():
    env = VectorEnv(LEVELS, 3, task=task(unbatched), seed=0)
    _, info = env.reset()
    with pytest.raises(SegarError, match=r"task mine: demo_actions must return .* of shape \(3, 2\), not \(2,\)"):
        task(unbatched).scripted_actions(env.factors)
    with pytest.raises(SegarError, match=r"task mine has no scripted player\. Give the task demo_actions="):
        task(None).scripted_actions(env.factors)
    with pytest.raises(SegarError, match=r"give env\.factors; info\['factors'\] does not say which entity is what"):
        mine.scripted_actions(info["factors"])
