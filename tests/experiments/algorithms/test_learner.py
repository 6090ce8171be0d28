"""An algorithm that does not fit the protocol is refused at start, with the list of what it lacks."""

from dataclasses import dataclass
from typing import ClassVar

import pytest
from torch import nn

from segar.experiments.algorithms.learner import learner_class, make_learner
from segar.experiments.settings import AlgorithmConfig, ConfigError
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
