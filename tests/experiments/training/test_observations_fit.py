"""What an agent observes in training is what it observes in the test, or the run does not begin."""

import pytest

from experiments.levels.builders import check_observations, make_levels
from experiments.settings import ConfigError, LevelsConfig, ObservationConfig, RunConfig

FEW = {"count": 2, "test_count": 2}


def check(train, test, observation="state", **options):
    levels = LevelsConfig(train=train, test=test, **FEW)
    config = RunConfig(levels=levels, observation=ObservationConfig(observation, options))
    check_observations(config, *make_levels(levels))


@pytest.mark.parametrize(
    ("train", "test", "only"),
    [
        ("empty-easy", "objectsx1-easy", "object1.Position.x in the test"),
        ("tilesx1-easy", "empty-easy", "tile1.Position.x in training"),
    ],
)
def test_a_state_of_other_entities_is_refused_with_the_first_that_differs(train, test, only):
    with pytest.raises(ConfigError, match=f"levels.test: observation=state .* in levels of {test} .*{only}"):
        check(train, test)


@pytest.mark.parametrize("test", ["empty-hard", "empty-easy"])
def test_levels_with_the_same_entities_fit(test):
    check("empty-easy", test)


def test_pixels_and_states_of_chosen_entities_fit_all_levels():
    check("empty-easy", "objectsx1-easy", "rgb")
    check("empty-easy", "objectsx1-easy", "state", entities=["golfball", "goal"])


def test_test_levels_are_the_training_ones_where_none_are_named():
    config = RunConfig(levels=LevelsConfig(train="empty-easy", **FEW))
    check_observations(config, *make_levels(config.levels))
