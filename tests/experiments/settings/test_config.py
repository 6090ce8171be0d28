"""Settings: what a user gets wrong is told in one message with the nearest right name, before anything is trained."""

import dataclasses
import pickle
import re
import sys

import pytest

import segar
from segar.envs import VectorEnv
from segar.experiments.commands.hydra_app import compose
from segar.experiments.levels.builders import Prepared, make_levels
from segar.experiments.settings import ConfigError, RunConfig, algorithms, as_data, checks, curricula, run, run_config
from segar.experiments.settings.algorithms import PPOConfig
from segar.observations.pixels.textured import TexturedPixels

OWN_MODULE = """
import segar

ice = segar.family("empty-hard")
number = 3


def sand():
    return segar.family("tilesx1-easy")

"""


# Types of settings, and a value that each refuses.
BEYOND = {
    checks.Count: 0, checks.CountFrom0: -1, checks.Positive: 0.0, checks.PositiveOrNull: 0.0, checks.NotNegative: -1.0,
    checks.Share: 1.5, checks.Widths: (64, 0), checks.Seed: -1, algorithms.Window: 0.0, algorithms.Tau: 0.0,
    algorithms.TauOr1: 0.7,
}  # fmt: skip
GROUPS = (run.LevelsConfig, run.ScaleConfig, run.EvaluationConfig, run.TrackingConfig, RunConfig)


@pytest.mark.parametrize("group", [*algorithms.KINDS.values(), *curricula.CURRICULA.values(), *GROUPS])
def test_every_number_is_held_within_its_bounds(group):
    for name, kind in checks.hints_of(group).items():
        for value in (value for one, value in BEYOND.items() if one == kind):
            place = checks.path_of(group.group, name)
            with pytest.raises(ConfigError, match=f"^{place}: .* is not allowed; it must be"):
                dataclasses.replace(group(), **{name: value})


@pytest.fixture
def own_module(tmp_path, monkeypatch):
    """A module of the user's, outside of the checkout."""
    (tmp_path / "own_levels.py").write_text(OWN_MODULE)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    sys.modules.pop("own_levels", None)


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ("levles=empty-hard", "no setting is called 'levles'. Did you mean 'levels'?"),
        ("levels=empty-hrad", "no levels is called 'empty-hrad'. Did you mean 'empty-hard'?"),
        ("qqq=3", "no setting is called 'qqq'. Known: algorithm, checkpoint_interval, curriculum, determinism,"),
        ("+levels.cuont=3", "no setting is called 'levels.cuont'. Did you mean 'levels.count'?"),
        ("levels.count=2.5", "levels.count: 2.5 is not a whole number"),
        ("algorithm.widths=3", "algorithm.widths: 3 is not a list whose entries are each a whole number"),
        ("algorithm.minibatches=2000", "algorithm.minibatches: 2000 is not allowed; it must be at most half the batch"),
        ("algorithm.min_log_std=3", "algorithm.min_log_std: 3.0 is not allowed; it must be less than max_log_std"),
        ("algorithm.kind=crul", "algorithm.kind: 'crul' is unknown. Did you mean 'curl'?"),
        ("scale.families=[emtpy]", "scale.families[0]: 'emtpy' is unknown. Did you mean 'empty'?"),
        ("tracking.uri=mlruns", "tracking.uri: 'mlruns' is not allowed; it must be an address"),
        ("seed=99999999999999999999", "seed: 99999999999999999999 is not allowed"),
    ],
)
def test_a_wrong_setting_is_named_with_the_nearest_right_one(override, says):
    with pytest.raises(ConfigError, match=re.escape(says)):
        compose([override])


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ("levels.train=empty-hrad", "there is no level family or suite 'empty-hrad'. Did you mean 'empty-hard'?"),
        ("levels.train=own_levels:iec", "levels.train: 'own_levels' has no 'iec'. Did you mean 'ice'?"),
        ("levels.train=own_levels:number", "levels.train: 'own_levels:number' is no level distribution"),
        ("levels.train=own_lvls:ice", "levels.train: 'own_lvls:ice' cannot be imported"),
        ("task.name=putput", "task.name: no task is called 'putput'. Did you mean 'puttputt'?"),
        ("task.options.rewrd=linear", "task.options: puttputt has no 'rewrd'. Did you mean 'reward'?"),
        ("task.options.reward=linaer", "Did you mean 'linear'?"),
        ("observation.name=stat", "observation.name: no observation is called 'stat'. Did you mean 'state'?"),
    ],
)
def test_a_name_that_stands_for_nothing_is_told_with_the_nearest_one(own_module, override, says):
    config = compose([override])
    with pytest.raises(ConfigError, match=re.escape(says)):
        Prepared(config).env_options()
        make_levels(config.levels)


@pytest.mark.parametrize("name", ["own_levels:ice", "own_levels:sand"])
def test_a_distribution_of_the_users_own_makes_levels(own_module, name):
    train, test = make_levels(compose([f"levels.train={name}", "levels.count=3", "levels.test_count=2"]).levels)
    assert (len(train), len(test)) == (3, 2)


def test_settings_survive_being_written_and_read():
    config = compose(["levels=tilesx1-hard", "algorithm=ppo", "levels.count=5e1", "+task.options.reward=linear"])
    assert run_config(as_data(config)) == config
    assert config.levels.count == 50


def test_only_what_decides_results_decides_the_hash():
    config = RunConfig()
    assert pickle.loads(pickle.dumps(config)).hash == config.hash
    for change in ({"progress": False}, {"root": "/elsewhere"}, {"restart": True}, {"num_threads": 2}):
        assert dataclasses.replace(config, **change).hash == config.hash
    assert dataclasses.replace(config, seed=1).hash != config.hash
    assert dataclasses.replace(config, algorithm=PPOConfig(gamma=0.9)).hash != config.hash


def test_a_setting_that_came_later_changes_no_name_until_it_is_changed():
    config = RunConfig()
    assert "overlap" in as_data(config)["algorithm"] and "overlap" not in config.identity()["algorithm"]
    other = dataclasses.replace(config, algorithm=PPOConfig(overlap=True))
    assert other.identity()["algorithm"]["overlap"] is True
    assert other.hash != config.hash


def test_a_named_observation_takes_options():
    config = compose(["observation=textures", "observation.options.textures=five", "observation.options.hidden=[Mass]"])
    seen = Prepared(config).env_options()["observation"]
    assert isinstance(seen, TexturedPixels) and len(seen.texture_set) == 5
    assert seen.shows(segar.Charge) and not seen.shows(segar.Mass)


@pytest.mark.parametrize(
    ("overrides", "names"),
    [
        (["observation.options.hidden=[Mass]"], {"golfball.Mass": False, "golfball.Charge": True}),
        (["observation.options.parameters=[Gravity]"], {"world.Gravity": True}),
        (["observation=state_normalised", "observation.options.scale.Mass=2"], {"golfball.Mass": True}),
        (["observation.options={entities: [goal], parameters: [Gravity]}"], {"world.Gravity": True, "goal.Heat": True}),
    ],
)
def test_options_of_an_observation_need_no_plus_and_keep_its_meaning(overrides, names):
    config = compose(overrides)
    assert config == compose([f"+{one}" if ".options." in one else one for one in overrides])
    env = VectorEnv(segar.family("empty-easy").sample(1, seed=0), 1, seed=0, **Prepared(config).env_options())
    assert {name: name in env.observation.names for name in names} == names


def test_a_wrong_name_beside_an_option_is_the_one_that_is_told():
    with pytest.raises(ConfigError, match=r"no setting is called 'levels\.cuont'"):
        compose(["task.options.reward=linear", "levels.cuont=3"])


def test_few_environments_are_stepped_by_one_thread():
    config = RunConfig(num_threads=4)
    given = [Prepared(config).env_options(num_envs)["num_threads"] for num_envs in (1, 64, 256, 4096, None)]
    assert given == [1, 1, 2, 4, 4]
