"""What a page cannot hold is refused before a file is written, by a message that names it and says what to do."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

import segar
from segar.engine import Given, Rows, call_of
from segar.errors import LevelError, SegarError
from segar.observations import StateVector
from segar.playground import make_playground
from segar.policies import NetworkPolicy
from tests.segar.engine.targets.functions import foreign
from tests.segar.playground.test_policies import LEVELS, convolutional, perceptron


@dataclass(frozen=True)
class Seen:
    """An observation that Python writes."""

    def shows(self, factor: type) -> bool:
        return True

    def bind(self, levels: segar.Levels, num_envs: int) -> Any:
        return StateVector().bind(levels, num_envs)


class Foreign(Seen):
    """An observation whose function calls what no browser has."""

    def bind(self, levels: segar.Levels, num_envs: int) -> Any:
        found = super().bind(levels, num_envs)
        numbers = Given("float64", ("envs",))
        call = call_of("foreign", foreign, [numbers, Rows(), numbers], {})
        found.calls = lambda when, in_rows=False: [call] if when == "write" else []
        return found


def refused(match: str, *arguments: Any, error: type[Exception] = SegarError, **options: Any) -> None:
    with pytest.raises(error, match=match):
        make_playground(*(arguments or (LEVELS,)), **options)


@pytest.mark.slow
def test_functions_that_browsers_lack_are_named() -> None:
    refused("lgamma", observations=[Foreign()])


def test_observations_of_several_parts_are_refused() -> None:
    refused(r"one array, and Multi gives Tuple\(.*one", observations=[segar.observations.Multi(["state", "rgb"])])
    refused(r"sequence of at least one, such as \('rgb',\), not 'rgb'", observations="rgb")
    refused(r"sequence of at least one.*not \(\)", observations=())


def test_too_many_levels_and_what_is_none_are_refused() -> None:
    many = segar.family("empty-easy").sample(2001)
    refused(r"at most 2,000 levels.*2,001.*levels\[:100\]", many, error=LevelError)
    refused("at most 2,000 levels", LEVELS, many, error=LevelError)
    refused(r"not LevelDistribution; sample", segar.family("empty-easy"), error=LevelError)


def test_a_policy_for_other_observations_is_refused_with_both() -> None:
    policy = convolutional("rgb")
    refused(r"reads uint8 of shape \(64, 64, 3\).*\(state, in the levels 'levels'\) is float32 of shape \(\d+,\)",
            observations=["state"], policy=policy)  # fmt: skip
    refused("in the levels 'test'", LEVELS, segar.family("empty-hard").sample(3), observations=["state"],
            policy=perceptron("state"))  # fmt: skip


@pytest.mark.slow
def test_a_policy_for_other_actions_is_refused_with_both() -> None:
    policy = replace(convolutional("rgb"), action_low=(-3.0, -3.0))
    refused(r"acts from \[-3.0, -3.0\] to .* and the task .*takes actions from", policy=policy)
    refused("without unit_actions", policy=NetworkPolicy(convolutional("rgb"), unit_actions=True))


def test_what_is_no_policy_and_weights_that_do_not_fit_are_refused() -> None:
    network, seen = perceptron("state"), {"observations": ["state"]}
    refused(r"not function; make one of a run by segar evaluate", **seen, policy=lambda seen: seen)
    refused("weights must be float32, float16 or float8, not 'int8'", **seen, policy=network, weights="int8")
    layer = network.layers[1]
    large = replace(layer, arrays={**layer.arrays, "weight": layer.arrays["weight"] * np.float32(1e6)})
    network = replace(network, layers=(network.layers[0], large, *network.layers[2:]))
    refused(r"layer 1 \(dense\): some numbers of 'weight' are larger than 65,504",
            **seen, policy=network, weights="float16")  # fmt: skip
