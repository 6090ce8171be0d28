"""Wrong arguments of environments end in one error of SEGAR that names the argument and what is right."""

import dataclasses

import gymnasium
import numpy as np
import pytest

import segar
from segar.envs import Env, VectorEnv
from segar.errors import ActionError, SegarError


def test_a_result_of_another_length_is_refused_with_its_name_where_it_is_read():
    env = VectorEnv(LEVELS, 3)
    env.reset(seed=0)
    for wrong, shape in ((np.zeros(7), r"\(7,\)"), (1.0, r"\(\)")):
        task = dataclasses.replace(segar.puttputt(), results={"left": lambda factors, wrong=wrong: wrong})
        with pytest.raises(SegarError, match=f"the result 'left' of the task has the shape {shape} for 3"):
            task.results_of(env.factors)


LEVELS = segar.family("empty-easy").sample(5, seed=0)
masked = np.ma.masked_array
ACTIONS = {  # neither for a batch of two nor for a single environment
    "text": ["left", "right"],
    "ragged": [[0.0, 1.0], [0.0]],
    "None": None,
    "masked": masked(np.zeros((2, 2)), True),
    "complex": np.zeros((2, 2), complex),
    "truths": np.zeros((2, 2), bool),
    "a number": 1.0,
    "too few": np.zeros((2, 1)),
    "other batch": np.zeros((3, 2)),
    "nan": [[0.0, 0.0], [np.nan, 0.0]],
    "infinite": np.full((2, 2), np.inf),
    "beyond float32": np.full((2, 2), 1e300),
}
OPTIONS = {  # values that an argument cannot have
    "levels": (None, "empty-easy"),
    "num_envs": (0, True, "2", 1.5, 2.0, 10**15),
    "num_threads": (0, 10**8),
    "trials": (0, -1, 1.5, True, "2", None),
    "max_steps": (0, True),
    "sub_steps": (0,),
    "observation": ("stat", 3),
    "task": ("puttputt",),
    "world": (segar.DEFAULT_RULES,),
    "seed": (-1, "1", True, 2**64),
    "autoreset_mode": ("sometimes", 1),
    "copy": ("yes",),
    "unit_actions": (1,),
    "render_mode": ("rgb",),
    "view": (64,),
}
RESETS = {
    "text for the seed": ({"seed": "1"}, "seed"),
    "too many seeds": ({"seed": [1, 2, 3]}, "give one seed, or 2, not 3"),
    "a negative seed": ({"seed": [1, -4]}, "a seed is a whole number"),
    "a list of options": ({"options": [1]}, "options"),
    "unknown option": ({"options": {"lavels": [0, 0]}}, "lavels"),
    "a number for an option's name": ({"options": {1: 2}}, "1"),
    "too few levels": ({"options": {"levels": [0]}}, "levels"),
    "levels beyond": ({"options": {"levels": [0, 5]}}, "must lie in 0..4, and that of environment 1 is 5"),
    "negative levels": ({"options": {"levels": [-1, 5]}}, "environment 0 is -1; 2 environments have a wrong one"),
    "fractions of levels": ({"options": {"levels": [0.0, 1.0]}}, "levels"),
    "ragged levels": ({"options": {"levels": [[0], [1, 2]]}}, "levels"),
    "masked levels": ({"options": {"levels": masked([0, 1], [True, False])}}, "levels"),
    "numbers for a mask": ({"options": {"reset_mask": [0, 1]}}, "reset_mask"),
    "a mask of another batch": ({"options": {"reset_mask": [True]}}, "reset_mask"),
}
SINGLE_RESETS = {
    "text for the level": ({"options": {"level": "1"}}, "level"),
    "a level beyond": ({"options": {"level": 5}}, "level"),
    "the option of batches": ({"options": {"levels": [1]}}, "levels"),
    "a list of options": ({"options": [1]}, "options"),
}


def by_name(table):
    return pytest.mark.parametrize("case", table.values(), ids=table.keys())


@pytest.fixture(scope="module")
def batch():
    env = VectorEnv(LEVELS, 2, seed=0)
    env.reset()
    return env


@pytest.fixture(scope="module")
def single():
    env = Env(LEVELS, seed=0)
    env.reset()
    return env


SAID = {"other batch": r"shape \(2, 2\), not \(3, 2\)", "nan": "environment 1 is not finite"}


@pytest.mark.parametrize("name", ACTIONS)
def test_wrong_actions_of_a_batch_change_nothing(batch, name):
    before = batch.state().state.values
    with pytest.raises(ActionError, match=SAID.get(name, "action")):
        batch.step(ACTIONS[name])
    np.testing.assert_array_equal(batch.state().state.values, before)


@by_name(ACTIONS)
def test_wrong_actions_of_a_single_environment_are_refused(single, case):
    with pytest.raises(ActionError, match="action"):
        single.step(case)


@pytest.mark.parametrize("dtype", ["f2", "f4", "f8", "i1", "i8", "u1", "longdouble"])
def test_every_kind_of_real_number_is_an_action(batch, dtype):
    batch.step(np.zeros((2, 2), dtype))
    batch.step(np.zeros((2, 2), dtype).tolist())


@pytest.mark.parametrize(
    ("name", "value"), [(name, value) for name, values in OPTIONS.items() for value in values], ids=str
)
def test_wrong_arguments_are_refused(name, value):
    with pytest.raises(SegarError, match=name):
        VectorEnv(**{"levels": LEVELS, "num_envs": 2, name: value})


@by_name(RESETS)
def test_wrong_resets_are_refused(batch, case):
    arguments, named = case
    with pytest.raises(SegarError) as refused:
        batch.reset(**arguments)
    assert named in str(refused.value)


@by_name(SINGLE_RESETS)
def test_wrong_resets_of_a_single_environment_are_refused(single, case):
    arguments, named = case
    with pytest.raises(SegarError) as refused:
        single.reset(**arguments)
    assert named in str(refused.value)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"num_level": 3}, "num_levels"),
        ({"num_levels": 0}, "0"),
        ({"num_levels": "3"}, "'3'"),
        ({"split": 3}, "3"),
        ({"seed": "x"}, "'x'"),
        ({"num_threads": -1}, "num_threads"),
    ],
)
def test_wrong_options_of_gymnasium_s_ids_are_refused(options, named):
    with pytest.raises(SegarError) as refused:
        gymnasium.make("Segar-empty-easy-state-linear-v0", **options)
    assert named in str(refused.value)


@pytest.mark.parametrize("name", ["num_envs", "autoreset_mode", "colour"])
def test_a_single_environment_names_options_that_it_does_not_have(name):
    with pytest.raises(SegarError, match=f"unexpected keyword argument '{name}'"):
        Env(LEVELS, **{name: 2})


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("golfbal", segar.Mass, 1.0), "Did you mean 'golfball'"),
        ((3, segar.Mass, 1.0), "3"),
        (("golfball", "Mass", 1.0), "segar.Mass"),
        (("golfball", [segar.Mass], 1.0), "segar.Mass"),
        (("golfball", segar.Mass, "heavy"), "heavy"),
        (("golfball", segar.Mass, float("nan")), "finite"),
        (("golfball", segar.Mass, 1.0, [True]), "where"),
        (("golfball", segar.Mass, 1.0, [0, 1]), "where"),
    ],
)
def test_wrong_interventions_are_refused(batch, arguments, named):
    with pytest.raises(SegarError) as refused:
        batch.intervene(*arguments)
    assert named in str(refused.value)


@pytest.mark.parametrize("snapshot", [None, "file.npz", {}], ids=repr)
def test_what_is_no_snapshot_is_refused(batch, snapshot):
    with pytest.raises(SegarError, match=r"snapshot must be a segar\.envs\.Snapshot"):
        batch.restore(snapshot)
