"""Who is called when: hooks are optional, one by one, and observations of SEGAR 0.1 have those that they had."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest

import segar
from segar.envs import VectorEnv
from segar.observations import (
    Multi,
    OneOf,
    Pixels,
    PreviousActions,
    Stack,
    StateVector,
    TexturedPixels,
    draws_per_episode,
)

LEVELS = segar.family("objectsx1-hard").sample(4, seed=0)
HOOKS = ("forget", "start", "advance", "rewarded", "memory", "recall")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: VectorEnv(LEVELS, 1, observation=StateVector), r"an object with bind\(\), not <class"),  # type: ignore
        (lambda: Pixels("64"), "Pixels: resolution must be a multiple of 4 from 32 to 256, not '64'"),  # type: ignore
    ],
)
def test_what_looks_like_an_observation_is_refused_by_its_name(make, message):
    with pytest.raises(segar.SegarError, match=message):
        make()


def test_one_factor_may_stand_for_a_list_of_one():
    one, several = (VectorEnv(LEVELS, 1, observation=StateVector(hidden=h)) for h in (segar.Mass, [segar.Mass]))  # type: ignore
    assert one.observation.names == several.observation.names and "golfball.Mass" not in one.observation.names  # type: ignore


class Recorder:
    """An observation, and at the same time the bound one, that notes its calls; it has the chosen hooks and no other."""

    def __init__(self, *hooks: str) -> None:
        self.calls: list[str] = []
        self.space = gymnasium.spaces.Box(-1, 1, (1,), np.float32)
        for hook in hooks:
            setattr(self, hook, getattr(self, f"_{hook}"))

    def shows(self, factor: type[segar.Factor]) -> bool:
        return False

    def bind(self, levels: segar.Levels, num_envs: int) -> Recorder:
        return self

    def begin(self, values: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        self.calls.append("begin")

    def write(self, values: np.ndarray, level: np.ndarray, out: np.ndarray, rows: np.ndarray) -> None:
        self.calls.append("write")
        out[rows] = 0.5

    def _start(self, key: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        self.calls.append("start")

    def _advance(self, actions: np.ndarray) -> None:
        self.calls.append("advance")

    def _forget(self, mask: np.ndarray) -> None:
        self.calls.append("forget")

    def _rewarded(self, reward: np.ndarray) -> None:
        self.calls.append("rewarded")

    def _memory(self) -> dict[str, np.ndarray]:
        self.calls.append("memory")
        return {"note": np.ones((2, 1))}

    def _recall(self, memory: Any) -> None:
        self.calls.append("recall")


def calls_of(recorder: Recorder, observation: Any) -> list[str]:
    """The calls in a reset, a step, an intervention, a snapshot and its restoring."""
    env = VectorEnv(LEVELS, 2, observation=observation, seed=0)
    env.reset()
    env.step(np.zeros((2, 2), np.float32))
    env.intervene("golfball", segar.Mass, 2.0)
    env.restore(env.state())
    return recorder.calls


EVERY = ["forget", "start", "begin", "write", "advance", "rewarded", "write", "begin", "write", "memory", "forget", "start",
         "recall", "begin", "write"]  # fmt: skip


@pytest.mark.parametrize("hooks", [HOOKS, (), ("start",), ("advance",), ("memory", "recall"), ("forget", "rewarded")])
@pytest.mark.parametrize(
    "composed", [lambda o: o, lambda o: (o, "state"), lambda o: OneOf([o])], ids=["alone", "tuple", "one"]
)
def test_hooks_are_called_in_order_and_only_those_that_are_there(hooks, composed):
    recorder = Recorder(*hooks)
    assert calls_of(recorder, composed(recorder)) == [c for c in EVERY if c in hooks or c in ("begin", "write")]


class Wrapper:
    """A wrapper of a bound observation that forwards whatever it does not have."""

    def __init__(self, inner: Any) -> None:
        self._inner = inner

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)

    def bind(self, levels: segar.Levels, num_envs: int) -> Wrapper:
        return Wrapper(self._inner.bind(levels, num_envs))


def test_hooks_that_a_wrapper_forwards_are_called():
    recorder = Recorder(*HOOKS)
    assert calls_of(recorder, Wrapper(recorder)) == EVERY
    plain = VectorEnv(LEVELS, 2, observation=PreviousActions(2), seed=0)
    wrapped = VectorEnv(LEVELS, 2, observation=Wrapper(PreviousActions(2)), seed=0)
    for env in (plain, wrapped):
        env.reset()
    for k in range(3):
        action = np.full((2, 2), 0.1 * (k + 1), np.float32)
        np.testing.assert_array_equal(plain.step(action)[0], wrapped.step(action)[0])


ALIKE = TexturedPixels(noise="never", model="level")  # shows every episode of a level alike
DRAWING = {
    "state": (StateVector(), False),
    "textures": (TexturedPixels(), True),
    "noise of levels": (TexturedPixels(noise="level"), False),
    "models of episodes": (TexturedPixels("five", noise="level"), True),
    "stack": (Stack("rgb", 2), False),
    "stacked textures": (Stack(TexturedPixels(), 2), True),
    "actions": (Multi(("rgb", PreviousActions())), False),
    "per episode": (OneOf(["rgb", ALIKE]), True),
    "per level": (OneOf(["rgb", ALIKE], per="level"), False),
    "textures per level": (OneOf([TexturedPixels(), TexturedPixels(seed=1)], per="level"), True),
}


@pytest.mark.parametrize(("observation", "draws"), DRAWING.values(), ids=DRAWING)
def test_an_observation_says_whether_it_shows_two_episodes_of_a_level_alike(observation, draws):
    env = VectorEnv(LEVELS, 40, observation=observation, seed=0)
    seen, _ = env.reset(options={"levels": np.zeros(40, int)})
    alike = all((part == part[:1]).all() for part in (seen if isinstance(seen, tuple) else (seen,)))
    assert (env.is_random, alike) == (draws, not draws)


def test_an_observation_of_ones_own_that_hears_of_episodes_is_taken_to_draw_unless_it_denies_it():
    assert draws_per_episode(Recorder("start")) and not draws_per_episode(Recorder("advance"))
    denies: Any = Recorder("start")
    denies.draws_per_episode = False
    assert not draws_per_episode(denies)
