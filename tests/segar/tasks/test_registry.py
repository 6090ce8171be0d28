"""Tasks by name, and the task that levels name."""

import dataclasses

import numpy as np
import pytest

import segar
from segar import GoalTile, GolfBall, LevelDistribution, Levels, SegarError
from segar.envs import VectorEnv
from segar.errors import LevelError
from segar.tasks.registry import TASKS, make_task, task_of

mine = dataclasses.replace(segar.puttputt("linear"), name="mine")
NUMBERS = [(GolfBall, 1), (GoalTile, 1)]
APART = [(GolfBall, [(0.0, 0.0)]), (GoalTile, [(0.5, 0.5)])]


def test_every_task_has_a_name_levels_and_a_scripted_player():
    for name in TASKS:
        made = make_task(name)
        assert made.name.startswith(name.split("_")[0]) and made.demo_actions is not None and made.results
        if name != "conditional_puttputt":  # whose levels are those of a family with a ball that remembers
            assert task_of(segar.family(name).sample(1)).name == made.name


def test_levels_that_name_no_task_are_for_puttputt():
    levels = segar.family("empty-hard").sample(1)
    assert levels.task is None and task_of(levels).name == "puttputt-squared"


@pytest.mark.parametrize(
    ("attribute", "name"),
    [("tests.segar.tasks.test_registry:mine", "mine"), ("segar.tasks.puttputt_task:puttputt", "puttputt-squared")],
)
def test_levels_can_name_a_task_of_ones_own_as_an_object_or_a_function(attribute, name):
    levels = LevelDistribution(NUMBERS, positions=APART, task=attribute).sample(1)
    assert VectorEnv(levels, 1).task.name == name


def test_a_given_task_goes_before_the_one_that_the_levels_name():
    levels = segar.family("invisiball").sample(1)
    assert VectorEnv(levels, 1, task=segar.puttputt("linear")).task.name == "puttputt-linear"


def test_rules_are_replaced_without_the_task_being_lost_and_the_task_decides_no_level():
    dist = segar.family("billiards")
    assert dist.with_rules(segar.DEFAULT_RULES).task == "billiards"
    other = LevelDistribution(NUMBERS, positions=APART)
    assert other.hash == LevelDistribution(NUMBERS, positions=APART, task="invisiball").hash


def test_a_file_names_a_task_but_brings_no_code(tmp_path):
    levels = LevelDistribution(NUMBERS, positions=APART, task="tests.segar.tasks.test_registry:mine").sample(2)
    levels.save(tmp_path / "mine.npz")
    loaded = Levels.load(tmp_path / "mine.npz")
    assert loaded.task == levels.task
    segar.family("billiards").sample(1).save(tmp_path / "tables.npz")
    assert VectorEnv(Levels.load(tmp_path / "tables.npz"), 1).task.name == "billiards-distance"
    with pytest.raises(SegarError, match=r"the task 'tests\..*test_registry:mine' is not built in.* by task="):
        VectorEnv(loaded, 1)
    assert VectorEnv(loaded, 1, task=mine).task.name == "mine"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("biliards", r"no task is called 'biliards'. Did you mean 'billiards'\? One of your own is 'module:attribute'"),
        ("no.such.module:task", "'no.such.module:task' cannot be imported: No module named 'no'"),
        ("segar:GolfBall", "'segar:GolfBall' is no segar.Task, nor a function that makes one, but <class"),
        ("segar.tasks.puttputt_task:putput", "'segar.tasks.puttputt_task' has no 'putput'. Did you mean 'puttputt'"),
    ],
)
def test_a_task_that_is_not_found_gets_the_nearest_name(name, said):
    with pytest.raises(SegarError, match=said):
        make_task(name)


def test_a_distribution_takes_a_name_not_a_task():
    with pytest.raises(LevelError, match="task must be a name such as 'billiards' or 'module:attribute', not Task"):
        LevelDistribution(NUMBERS, positions=APART, task=mine)


@pytest.mark.parametrize("name", ["act", "reward", "terminated", "success", "death"])
@pytest.mark.parametrize("wrong", [None, 3.0, ("no function",)])
def test_what_is_no_function_of_a_task_is_told_with_the_argument_and_the_task(name, wrong):
    with pytest.raises(SegarError, match=rf"task sailing: {name} must be a function, or a tuple of functions, not"):
        dataclasses.replace(segar.puttputt(), name="sailing", **{name: wrong})


@pytest.mark.parametrize("wrong", [float("-inf"), float("nan"), "a", None])
@pytest.mark.parametrize("end", ["action_low", "action_high"])
def test_a_range_of_actions_that_is_no_finite_number_is_told(end, wrong):
    with pytest.raises(SegarError, match=rf"task sailing: {end} must be finite numbers, not {wrong!r}"):
        dataclasses.replace(segar.puttputt(), name="sailing", **{end: (0.5, wrong)})


@pytest.mark.parametrize(("low", "high"), [((-1.0, 0.5), (1.0, 0.5)), ((-1.0, 2.0), (1.0, -2.0))])
def test_a_component_of_an_action_that_cannot_vary_is_told(low, high):
    with pytest.raises(SegarError, match=r"task sailing: .* component 1 of the action goes from"):
        dataclasses.replace(segar.puttputt(), name="sailing", action_low=low, action_high=high)


def test_an_action_range_of_unequal_lengths_is_refused_with_both():
    with pytest.raises(segar.SegarError, match=r"action_low \(-2.0,\) has 1, action_high \(5.0, 1.0\) has 2"):
        dataclasses.replace(segar.puttputt(), action_low=(-2.0,), action_high=(5.0, 1.0))


@pytest.mark.parametrize("option", ["goal_distance", "goal_speed"])
def test_a_goal_that_no_ball_reaches_is_refused(option):
    with pytest.raises(SegarError, match=f"no ball arrives at .*{option}=-1"):
        segar.puttputt(**{option: -1})


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, None, "2"])
@pytest.mark.parametrize("task", ["puttputt", "invisiball", "billiards"])
@pytest.mark.parametrize("option", ["impulse", "death_penalty", "goal_distance", "goal_speed"])
def test_options_of_built_in_tasks_are_finite_numbers(task, option, value):
    if (option, value) == ("goal_speed", None):
        assert segar.puttputt(goal_speed=None).name == segar.puttputt(goal_speed=0.5).name
    elif option[:4] != "goal" or task != "billiards":
        with pytest.raises(SegarError, match=rf"{option} must be a finite number, not {value!r}"):
            TASKS[task](**{option: value})
