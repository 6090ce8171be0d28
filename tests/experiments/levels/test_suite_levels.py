"""Runs on suites: which levels, task and observation they have."""

import dataclasses

import pytest

from segar.experiments.commands.config_store import register_settings
from segar.experiments.commands.hydra_app import compose
from segar.experiments.levels.builders import Prepared, make_levels
from segar.experiments.settings import ConfigError, LevelsConfig, ObservationConfig, RunConfig, TaskConfig
from segar.language import Mass
from segar.levels import hash_of_levels
from segar.observations import TexturedPixels
from segar.suites import suite

NAME = "place-few-v1"


def config_of(name=NAME, **levels):
    return RunConfig(levels=LevelsConfig(train=name, **levels))


def test_training_levels_are_drawn_and_test_levels_are_frozen():
    frozen = suite(NAME)
    train, test = make_levels(LevelsConfig(train=NAME, count=7, seed=3, test_count=200))
    assert train == frozen.sample(3, 7) and len(train) == 7
    assert hash_of_levels(test) == hash_of_levels(frozen.test_levels)
    other = make_levels(LevelsConfig(train="empty-hard", test=NAME, count=2, test_count=20))[1]
    assert other == frozen.test_levels[:20]
    with pytest.raises(ConfigError, match=f"levels.test_seed: the test levels of the suite {NAME} are frozen"):
        make_levels(LevelsConfig(train="empty-hard", test=NAME, count=2, test_count=20, test_seed=5))


def test_the_task_is_that_of_the_suite_unless_another_one_is_chosen():
    assert Prepared(config_of()).env_options()["task"].max_steps == 50 and Prepared(config_of()).task_name == "puttputt"
    chosen = dataclasses.replace(config_of(), task=TaskConfig("puttputt", {"max_steps": 30}))
    assert Prepared(chosen).env_options()["task"].max_steps == 30


def test_hidden_factors_are_hidden_from_states():
    config = config_of("sight-mass-v1")
    train, _ = make_levels(config.levels)
    for options in ({}, {"hidden": ["Charge"]}):
        one = dataclasses.replace(config, observation=ObservationConfig("state", options))
        names = Prepared(one).env_options(train=train)["observation"].bind(train, 1).names
        assert not any(
            name.endswith((".Mass", *(f".{other}" for other in options.get("hidden", ())))) for name in names
        )
    shown = Prepared(config_of("property-heavy-v1")).env_options(train=train)["observation"].bind(train, 1).names
    assert any(name.endswith(f".{Mass.__name__}") for name in shown)


@pytest.mark.parametrize(
    ("config", "message"),
    [
        (config_of(variation="ball_mass"), "levels.variation: the suite place-few-v1 is frozen and cannot be varied"),
        (config_of(test_variation="ball_mass"), "levels.test_variation: the suite place-few-v1 is frozen"),
        (config_of(design="clustered"), "levels.design: the suite place-few-v1 draws its training levels"),
        (config_of(test_count=201), "levels.test_count: the suite place-few-v1 has 200 test levels, not 201"),
    ],
)
def test_what_a_suite_does_not_allow_is_told(config, message):
    with pytest.raises(ConfigError, match=message):
        make_levels(config.levels)


def test_options_of_a_task_and_textures_are_told():
    options = dataclasses.replace(config_of(), task=TaskConfig(options={"max_steps": 30}))
    with pytest.raises(ConfigError, match=r"task\.options: the suite place-few-v1 says what is played"):
        Prepared(options).env_options()
    message = (
        "the suite look-far-v1 shows the set of textures baseline in training and the set of textures far in the test"
    )
    for observation in (ObservationConfig("state"), ObservationConfig("textures", {"textures": "close"})):
        with pytest.raises(ConfigError, match=message):
            Prepared(dataclasses.replace(config_of("look-far-v1"), observation=observation)).env_options()


@pytest.mark.parametrize("name", ["rgb", "textures"])
def test_training_and_test_levels_of_a_suite_about_looks_look_different(name):
    config = dataclasses.replace(config_of("look-far-v1"), observation=ObservationConfig(name))
    for which, shown in (("train", "baseline"), ("test", "far")):
        assert Prepared(config).env_options(which=which)["observation"] == TexturedPixels(textures=shown)


def test_hydra_knows_suites():
    register_settings()
    found = compose(["suite=sight-charge-v1"])
    assert (found.levels.train, found.levels.count, found.levels.test_count) == ("sight-charge-v1", 25, 200)
    assert compose(["suite=sight-charge-v1", "levels.count=3"]).levels.count == 3
    assert compose([]).levels.train == "empty-hard"
