"""Entities without a position, and world parameters, which a state does not show by default, are told of where they matter,
with the way out."""

import pytest

from segar.envs import VectorEnv
from segar.errors import LevelError
from segar.experiments.levels.builders import Prepared, make_levels
from segar.experiments.settings import LevelsConfig, ObservationConfig, RunConfig, TaskConfig
from segar.experiments.training.advice import (
    advice_on_entities,
    advice_on_parameters,
    unseen_entities,
    unseen_parameters,
)
from segar.experiments.training.run import run
from segar.observations import StateVector
from tests.experiments.short_runs import short_run, weights
from tests.experiments.training import moons

HERE = "tests.experiments.training.moons"
WAY_OUT = {"entities": ["golfball", "goal", "moon"]}


def config_of(levels, options=None, name="state", **more):
    return RunConfig(
        levels=LevelsConfig(f"{HERE}:{levels}" if hasattr(moons, levels) else levels, count=3, test_count=3, **more),
        observation=ObservationConfig(name, options or {}),
        task=TaskConfig("puttputt"),
    )


def found(levels, options=None, name="state", **more):
    config = config_of(levels, options, name, **more)
    prepared = Prepared(config)
    return unseen_entities(prepared), prepared


@pytest.mark.parametrize(
    ("levels", "more"), [("different", {}), ("turning", {}), ("still", {"test": f"{HERE}:different"})]
)
def test_an_entity_that_differs_or_turns_is_named_with_the_setting_that_shows_it(levels, more):
    unseen, prepared = found(levels, **more)
    config, train = prepared.config, prepared.level_sets[0]
    assert unseen == {"moon": ["Phase"]}
    said = advice_on_entities(unseen, prepared)
    assert "the agent does not see Phase of moon" in said and "\n" not in said
    assert said.endswith("observation.options.entities=[golfball,goal,moon]")
    assert found(levels, WAY_OUT, **more)[0] == {}
    shown = RunConfig(levels=config.levels, observation=ObservationConfig("state", WAY_OUT), task=config.task)
    names = VectorEnv(train, 1, **Prepared(shown).env_options()).observation.names
    hidden = VectorEnv(train, 1, **Prepared(config).env_options()).observation.names
    assert set(names) == {*hidden, "moon.Phase"}


@pytest.mark.parametrize(
    ("levels", "options", "name"),
    [
        ("still", {}, "state"), ("different", {"hidden": ["Phase"]}, "state"), ("different", {}, "rgb"),
        ("different", {"entities": ["golfball"]}, "state"), ("empty-hard", {}, "state"), ("tilesx1-hard", {}, "state"),
    ],
)  # fmt: skip
def test_nothing_is_said_where_nothing_differs_or_all_is_chosen_and_of_named_families(levels, options, name):
    assert found(levels, options, name)[0] == {}


@pytest.mark.slow
def test_a_run_says_it_once_and_has_the_results_that_it_has_without_the_look(tmp_path, monkeypatch):
    said, levels = [], LevelsConfig(f"{HERE}:turning", count=2, test_count=2)
    run(short_run(tmp_path / "a", levels=levels), said.append)
    assert sum("does not see Phase of moon" in line for line in said) == 1
    monkeypatch.setattr("segar.experiments.training.advice.unseen_entities", lambda *given: {})
    run(short_run(tmp_path / "b", levels=levels), said.append)
    assert all((weights(tmp_path / "b")[name] == value).all() for name, value in weights(tmp_path / "a").items())


def test_a_factor_that_no_entity_shown_has_comes_with_the_entities_that_have_it():
    with pytest.raises(LevelError, match=r"has a factor 'Phase'; .* entities=\[golfball, goal, moon\]"):
        StateVector(factors=[moons.Phase]).bind(moons.still.sample(1), 1)


def unseen_airs(levels, options=None, name="state", **more):
    config = config_of(levels, options, name, **more)
    prepared = Prepared(config)
    return unseen_parameters(prepared), prepared


@pytest.mark.parametrize(
    ("levels", "options", "more", "names", "shown"),
    [
        ("airs", {}, {}, ["AirSpeed"], "[AirSpeed]"),
        ("airs", {"entities": ["golfball"]}, {}, ["AirSpeed"], "[AirSpeed]"),
        ("calm", {}, {"test": f"{HERE}:stormy"}, ["AirSpeed"], "[AirSpeed]"),
        ("planets", {}, {}, ["AirSpeed", "Gravity"], "[AirSpeed,Gravity]"),
        ("planets", {"parameters": ["Gravity"]}, {}, ["AirSpeed"], "[Gravity,AirSpeed]"),
    ],
)
def test_a_parameter_that_differs_is_named_with_the_settings_that_show_it_or_end_the_line(
    levels, options, more, names, shown
):
    unseen, prepared = unseen_airs(levels, options, **more)
    config = prepared.config
    assert sorted(unseen) == names
    said = advice_on_parameters(sorted(unseen), prepared)
    assert f"does not see {', '.join(names)}, which differ" in said and "\n" not in said
    assert f"only if they are named: observation.options.parameters={shown}." in said
    assert f"observation.options.hidden=[{','.join(names)}] says so" in said
    shows = {**options, "parameters": [*options.get("parameters", []), *names]}
    assert unseen_airs(levels, shows, **more)[0] == []
    seen = RunConfig(levels=config.levels, observation=ObservationConfig("state", shows), task=config.task)
    shown_names = VectorEnv(make_levels(seen.levels)[0], 1, **Prepared(seen).env_options()).observation.names
    assert {f"world.{name}" for name in names} <= {*shown_names}
    assert unseen_airs(levels, {**options, "hidden": names}, **more)[0] == []


@pytest.mark.parametrize(
    ("levels", "name"), [("calm", "state"), ("airs", "rgb"), ("empty-hard", "state"), ("tilesx1-hard", "state")]
)
def test_nothing_is_said_of_parameters_where_none_differs_nor_of_pixels_and_named_families(levels, name):
    assert unseen_airs(levels, name=name)[0] == []


def test_of_a_table_the_way_out_is_an_observation_beside_it():
    unseen, prepared = unseen_airs("airs", {"form": "table"})
    assert "named: StateVector(entities=[], parameters=[AirSpeed]) beside the table." in advice_on_parameters(
        unseen, prepared
    )


def test_a_run_says_which_parameters_its_agent_does_not_see(tmp_path):
    said = []
    run(short_run(tmp_path, levels=LevelsConfig(f"{HERE}:airs", count=2, test_count=2)), said.append)
    (line,) = (line for line in said if "does not see AirSpeed" in line)
    assert line.startswith("warning: ")
