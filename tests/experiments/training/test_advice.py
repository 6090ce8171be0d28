"""Large numbers in a state, entities without a position and world parameters that it does not show are told of where they
matter, before training, by name and with the settings that are the way out."""

import numpy as np
import pytest

from segar.envs import VectorEnv
from segar.errors import LevelError
from segar.experiments.levels.builders import Prepared
from segar.experiments.settings import LevelsConfig, ObservationConfig, RunConfig, TaskConfig
from segar.experiments.training import advice
from segar.experiments.training.advice import (
    advice_on_entities,
    advice_on_numbers,
    advice_on_parameters,
    large_numbers,
    unseen_entities,
    unseen_parameters,
)
from segar.experiments.training.run import run
from segar.observations import StateVector
from tests.experiments.short_runs import figures, short_run, weights
from tests.experiments.training import moons

MOONS, CLOCK = "tests.experiments.training.moons", "tests.experiments.training.clock_task"
WAY_OUT = {"entities": ["golfball", "goal", "moon"]}


def prepared_of(levels, options=None, name="state", count=3, task="puttputt", **more):
    """What a run on levels of ``moons``, or of any other name, is made of."""
    train = f"{MOONS}:{levels}" if hasattr(moons, levels) else levels
    levels_of = LevelsConfig(train, count=count, test_count=count, **more)
    return Prepared(
        RunConfig(levels=levels_of, observation=ObservationConfig(name, options or {}), task=TaskConfig(task))
    )


def on_the_clock(options=None, name="state"):
    return prepared_of(f"{CLOCK}:levels", options, name, count=20, task=f"{CLOCK}:task")


def names_seen(prepared):
    """The names of the numbers that an agent observes."""
    return {*VectorEnv(prepared.level_sets[0], 1, **prepared.env_options()).observation.names}


@pytest.mark.parametrize(
    ("options", "name", "largest"),
    [({}, "state", 195.0), ({}, "state_normalised", 195.0), ({"scale": {"Clock": 2}}, "state", 97.5)],
)
def test_a_counter_is_found_with_its_largest_value_and_the_setting_that_divides_it(options, name, largest):
    prepared = on_the_clock(options, name)
    large = large_numbers(prepared)
    assert large == {"golfball.Clock": largest}  # the last of 40 steps of 5 sub-steps starts another episode
    assert f"golfball.Clock up to {largest:.0f} in random play" in advice_on_numbers(large, prepared)
    assert advice_on_numbers(large, prepared).endswith("observation.options.scale.Clock=200")


@pytest.mark.parametrize("options", [{"scale": {"Clock": 200}}, {"hidden": ["Clock"]}])
def test_nothing_is_said_of_a_counter_that_is_divided_or_hidden(options):
    assert large_numbers(on_the_clock(options)) == {}


@pytest.mark.parametrize(("share", "is_named"), [(0.005, False), (0.02, True)])
def test_a_number_is_named_that_is_large_in_more_than_a_hundredth_of_the_states(monkeypatch, share, is_named):
    prepared, name = prepared_of("empty-hard", count=10), "golfball.Velocity.x"
    env, played = advice.random_play(prepared, advice.NUMBER_STEPS)
    sizes = np.abs(np.concatenate([now.observation for now in played])[:, env.observation.names.index(name)])
    monkeypatch.setattr(advice, "LARGE", np.quantile(sizes, 1 - share))
    assert (name in large_numbers(prepared)) == is_named


@pytest.mark.parametrize("levels", ["empty-easy", "empty-hard", "objectsx1-medium", "tilesx1-hard"])
def test_nothing_is_said_of_named_families_whose_balls_are_fast_only_now_and_then(levels):
    prepared = prepared_of(levels, count=10)
    assert not (large_numbers(prepared) or unseen_entities(prepared) or unseen_parameters(prepared))
    assert large_numbers(prepared_of(levels, {"missing": -1000.0}, count=10)) == {}


@pytest.mark.parametrize(
    ("look", "levels", "options", "name"),
    [
        (large_numbers, f"{CLOCK}:levels", {}, "rgb"),
        (unseen_entities, "still", {}, "state"),
        (unseen_entities, "different", {"hidden": ["Phase"]}, "state"),
        (unseen_entities, "different", {}, "rgb"),
        (unseen_entities, "different", {"entities": ["golfball"]}, "state"),
        (unseen_parameters, "calm", {}, "state"),
        (unseen_parameters, "airs", {}, "rgb"),
    ],
)
def test_nothing_is_said_where_nothing_differs_nor_of_pixels_nor_of_what_is_chosen(look, levels, options, name):
    assert not look(prepared_of(levels, options, name))


@pytest.mark.parametrize(
    ("levels", "more"), [("different", {}), ("turning", {}), ("still", {"test": f"{MOONS}:different"})]
)
def test_an_entity_that_differs_or_turns_is_named_with_the_setting_that_shows_it(levels, more):
    prepared, shown = prepared_of(levels, **more), prepared_of(levels, WAY_OUT, **more)
    unseen = unseen_entities(prepared)
    assert unseen == {"moon": ["Phase"]}
    said = advice_on_entities(unseen, prepared)
    assert "the agent does not see Phase of moon" in said and "\n" not in said
    assert said.endswith("observation.options.entities=[golfball,goal,moon]")
    assert unseen_entities(shown) == {}
    assert names_seen(shown) == names_seen(prepared) | {"moon.Phase"}


def test_a_factor_that_no_entity_shown_has_comes_with_the_entities_that_have_it():
    with pytest.raises(LevelError, match=r"has a factor 'Phase'; .* entities=\[golfball, goal, moon\]"):
        StateVector(factors=[moons.Phase]).bind(moons.still.sample(1), 1)


@pytest.mark.parametrize(
    ("levels", "options", "more", "names", "shown"),
    [
        ("airs", {}, {}, ["AirSpeed"], "[AirSpeed]"),
        ("airs", {"entities": ["golfball"]}, {}, ["AirSpeed"], "[AirSpeed]"),
        ("calm", {}, {"test": f"{MOONS}:stormy"}, ["AirSpeed"], "[AirSpeed]"),
        ("planets", {}, {}, ["AirSpeed", "Gravity"], "[AirSpeed,Gravity]"),
        ("planets", {"parameters": ["Gravity"]}, {}, ["AirSpeed"], "[Gravity,AirSpeed]"),
    ],
)
def test_a_parameter_that_differs_is_named_with_the_settings_that_show_it_or_end_the_line(
    levels, options, more, names, shown
):
    prepared = prepared_of(levels, options, **more)
    assert sorted(unseen_parameters(prepared)) == names
    said = advice_on_parameters(names, prepared)
    assert f"does not see {', '.join(names)}, which differ" in said and "\n" not in said
    assert f"only if they are named: observation.options.parameters={shown}." in said
    assert f"observation.options.hidden=[{','.join(names)}] says so" in said
    shows = prepared_of(levels, {**options, "parameters": [*options.get("parameters", []), *names]}, **more)
    assert unseen_parameters(shows) == []
    assert {f"world.{name}" for name in names} <= names_seen(shows)
    assert unseen_parameters(prepared_of(levels, {**options, "hidden": names}, **more)) == []


def test_of_a_table_the_way_out_is_an_observation_beside_it():
    prepared = prepared_of("airs", {"form": "table"})
    said = advice_on_parameters(unseen_parameters(prepared), prepared)
    assert "named: StateVector(entities=[], parameters=[AirSpeed]) beside the table." in said


@pytest.mark.parametrize(
    ("look", "levels", "task", "words"),
    [
        ("large_numbers", f"{CLOCK}:levels", f"{CLOCK}:task", "large numbers"),
        ("unseen_parameters", f"{MOONS}:airs", "puttputt", "does not see AirSpeed"),
        pytest.param("unseen_entities", f"{MOONS}:turning", "puttputt", "Phase of moon", marks=pytest.mark.slow),
    ],
)
def test_a_run_warns_once_and_has_the_results_that_it_has_without_the_look(
    tmp_path, monkeypatch, look, levels, task, words
):
    said, config = [], {"levels": LevelsConfig(levels, count=2, test_count=2), "task": TaskConfig(task)}
    run(short_run(tmp_path / "a", **config), said.append)
    (line,) = (line for line in said if words in line)
    assert line.startswith("warning: ")
    monkeypatch.setattr(f"segar.experiments.training.advice.{look}", lambda prepared: ())
    run(short_run(tmp_path / "b", **config), said.append)
    assert figures(tmp_path / "a") == figures(tmp_path / "b")
    assert all((weights(tmp_path / "b")[name] == value).all() for name, value in weights(tmp_path / "a").items())
