"""A counter in the state is told of before training, by name and with the setting that divides it, and PPO then learns."""

import pytest

from segar.experiments.levels.builders import Prepared
from segar.experiments.settings import LevelsConfig, ObservationConfig, RunConfig, TaskConfig
from segar.experiments.training.advice import advice_on_numbers, large_numbers
from segar.experiments.training.run import run
from tests.experiments.short_runs import figures, short_run, weights

HERE = "tests.experiments.training.clock_task"
LEVELS = LevelsConfig(train=f"{HERE}:levels", count=20, test_count=20)
TASK = TaskConfig(f"{HERE}:task")


def found(options=None, name="state", levels=LEVELS, task=TASK):
    config = RunConfig(levels=levels, task=task, observation=ObservationConfig(name, options or {}))
    return large_numbers(Prepared(config)), Prepared(config)


@pytest.mark.parametrize("name", ["state", "state_normalised"])
def test_a_counter_is_found_with_its_largest_value_and_the_setting_that_divides_it(name):
    large, config = found(name=name)
    assert large == {"golfball.Clock": 195.0}  # the last of 40 steps of 5 sub-steps starts another episode
    assert "golfball.Clock up to 195 in random play" in advice_on_numbers(large, config)
    assert advice_on_numbers(large, config).endswith("observation.options.scale.Clock=200")


def test_a_constant_that_is_too_small_is_raised():
    large, config = found({"scale": {"Clock": 2}})
    assert large == {"golfball.Clock": 97.5}
    assert advice_on_numbers(large, config).endswith("observation.options.scale.Clock=200")


@pytest.mark.parametrize("options", [{"scale": {"Clock": 200}}, {"hidden": ["Clock"]}])
def test_nothing_is_said_of_a_counter_that_is_divided_or_hidden(options):
    assert found(options)[0] == {}


@pytest.mark.parametrize("levels", ["empty-easy", "objectsx1-medium", "tilesx1-hard"])
def test_nothing_is_said_of_the_named_families_whose_balls_are_fast_only_now_and_then(levels):
    named = LevelsConfig(train=levels, count=10, test_count=2)
    assert found(levels=named, task=TaskConfig())[0] == {}
    assert found({"missing": -1000.0}, levels=named, task=TaskConfig())[0] == {}


def test_pixels_are_not_looked_at():
    assert found(name="rgb")[0] == {}


def test_a_run_warns_once_and_has_the_results_that_it_has_without_the_look(tmp_path, monkeypatch):
    said = []
    run(short_run(tmp_path / "a", levels=LEVELS, task=TASK), said.append)
    assert sum("large numbers" in line for line in said) == 1
    monkeypatch.setattr("segar.experiments.training.advice.large_numbers", lambda prepared: {})
    run(short_run(tmp_path / "b", levels=LEVELS, task=TASK), said.append)
    assert figures(tmp_path / "a") == figures(tmp_path / "b")
    assert all((weights(tmp_path / "b")[name] == value).all() for name, value in weights(tmp_path / "a").items())
