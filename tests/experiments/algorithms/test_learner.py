"""What does not fit an algorithm is refused at start by name: what a learner lacks, settings, and observations."""

import dataclasses
from dataclasses import dataclass
from typing import ClassVar

import pytest
from torch import nn

import segar
from segar.experiments.algorithms.learner import learner_class, make_learner
from segar.experiments.settings import KINDS, AlgorithmConfig, ConfigError
from segar.experiments.training.run import run
from tests.experiments.short_runs import short_run


class WithoutSteps:
    """Has a policy, and nothing that trains it."""

    def __init__(self, config, env, frames, seed):
        self.policy, self.frames = nn.Linear(2, 2), 0

    @staticmethod
    def make_policy(config, observation_shape, actions):
        return nn.Linear(2, 2)

    def state_dict(self):
        return {}


class WithPolicyThatCannotAct(WithoutSteps):
    def iterate(self):
        return {}

    def load_state_dict(self, state):
        pass


class WithoutFrames(WithPolicyThatCannotAct):
    def __init__(self, config, env, frames, seed):
        self.policy = nn.Linear(2, 2)


@dataclass(frozen=True)
class OwnConfig(AlgorithmConfig):
    name: str = "own"
    learner: ClassVar[str] = f"{__name__}:WithoutSteps"


@dataclass(frozen=True)
class NamelessConfig(AlgorithmConfig):
    name: str = "nameless"


def test_a_run_names_the_methods_that_its_learner_lacks_and_leaves_no_folder(tmp_path):
    lacking = r"algorithm: .*test_learner:WithoutSteps is no learner: it lacks iterate, load_state_dict\. "
    with pytest.raises(ConfigError, match=lacking + r"segar\.experiments\.algorithms\.learner says what each is for"):
        run(short_run(tmp_path / "run", algorithm=OwnConfig()))
    assert not (tmp_path / "run").exists()


def test_settings_that_name_no_learner_are_refused():
    with pytest.raises(ConfigError, match=r"names no learner; learner: ClassVar\[str\] = 'module:Class' does"):
        learner_class(NamelessConfig())


@pytest.mark.parametrize(
    ("kind", "lacking"),
    [
        (WithPolicyThatCannotAct, r"the policy of .*CannotAct is none: it lacks act, represent\."),
        (WithoutFrames, r"WithoutFrames is no learner: it lacks frames\."),
    ],
)
def test_attributes_are_asked_for_once_the_learner_is_made(kind, lacking):
    with pytest.raises(ConfigError, match=lacking):
        make_learner(kind, OwnConfig(), None, 100, 0)


SMALL = {"num_envs": 4, "num_steps": 8}
REPLAY = {**SMALL, "warmup": 12, "capacity": 200}
TRANSITION = {**SMALL, "model": "transition"}


@pytest.mark.parametrize(
    ("kind", "settings", "wrong", "wanted"),
    [
        ("sac", REPLAY, {"capacity": 15}, "at least 16, 4 x num_envs"),
        ("sac", REPLAY, {"warmup": 7}, "at least 2 x num_envs, 8"),
        ("ppg", SMALL, {"shared": True}, "false: policy and value have networks of their own"),
        ("ppg", SMALL, {"shared": None}, "false: policy and value have networks of their own"),
        ("ppg", SMALL, {"auxiliary_minibatches": 33}, "at most the 32 pieces of steps_together=1 in a rollout"),
        ("drac", SMALL, {"augmentations": ()}, "one or more of crop, .*each once"),
        ("drac", SMALL, {"augmentations": ("crop", "crop")}, "each once"),
        ("drac", SMALL, {"compile": True}, "false: torch cannot trace how keypoints are found in augmented frames"),
        ("curl", SMALL, {"auxiliary_minibatches": 17}, "half a rollout's frames, 16"),
        ("spr", SMALL, {"horizon": 2}, "from 1 to 1"),
        ("spr", TRANSITION, {"horizon": 8}, "from 1 to 7"),
        ("ppo_recurrent", SMALL, {"minibatches": 5}, "at most num_envs, 4"),
        ("ppo_recurrent", SMALL, {"shared": False}, "true"),
        ("ppo_recurrent", SMALL, {"compile": True}, "false"),
    ],
)
def test_settings_that_make_no_sense_are_refused_by_name(kind, settings, wrong, wanted):
    config, (setting,) = KINDS[kind](**{"minibatches": 2, **settings} if kind != "sac" else settings), wrong
    with pytest.raises(ConfigError, match=rf"algorithm\.{setting}: .*{wanted}"):
        dataclasses.replace(config, **wrong)


@pytest.mark.parametrize(("kind", "shown"), [("curl", "state"), ("drac", "state"), ("drq", "state"), ("sac", "rgb")])
def test_observations_that_an_algorithm_cannot_read_are_refused_with_those_that_it_reads(kind, shown):
    config = KINDS[kind](num_envs=2)
    env = learner_class(config).make_env(segar.family("empty-easy").sample(1), 2, seed=0, observation=shown)
    reads = "vectors, not .*; algorithm=drq reads frames" if shown == "rgb" else "frames, not .*; .*rgb shows frames"
    with pytest.raises(ConfigError, match=f"algorithm: {kind} reads {reads}"):
        make_learner(learner_class(config), config, env, 10_000, 0)
