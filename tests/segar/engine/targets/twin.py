"""Plays an environment on another target beside the processor's, and says where they differ."""

from functools import reduce
from typing import Any

import numpy as np

from segar.engine import Call
from segar.envs import VectorEnv, build_environment, environment_calls
from segar.observations import empty_batch
from tests.segar.engine.targets.machines import MACHINES

BATCH = ("values", "level", "key", "tick", "contacts", "unresolved_contacts")
EPISODES = ("returns", "lengths", "episodes")


class Twin:
    """The same environment on a machine for another target.

    Args:
        env: after its first reset; its states are taken over.
    """

    def __init__(self, env: VectorEnv, target: str) -> None:
        self.env, self.calls = env, environment_calls(env)
        self.kernel = build_environment(env, target)
        self.machine = MACHINES[target](self.kernel)
        levels = env.simulator.arrays_of(env.levels)
        self.state = env.state()
        self.sizes = {"envs": env.num_envs, "levels": len(env.levels), "rows": env.num_envs}
        self.sizes["corners"] = levels.vertex.shape[2]
        batch = {f"state_{name}": getattr(self.state.state, name) for name in BATCH}
        results = {f"result_{name}": array for name, array in vars(env._episodes._outcome).items()}
        fixed = {f"level_{name}": array for name, array in vars(levels).items()}
        episodes = {name: getattr(self.state, name) for name in EPISODES}
        rows = {"rows": np.arange(env.num_envs), "chosen": np.full(env.num_envs, -1)}
        action = {
            "actions": np.zeros(env.action_space.shape, np.float32),
            "errors": np.zeros((env.num_envs, 5), np.int64),
        }
        observation = empty_batch(env.single_observation_space, env.num_envs)
        self.seen = {call.part: part_of(observation, call.part) for call in self.calls.write}
        seen = {f"seen{part}": array for part, array in self.seen.items()}
        self.machine.place({**batch, **results, **fixed, **episodes, **rows, **action, **seen})
        for call in (*self.calls.start, *self.calls.advance, *self.calls.write):
            self.machine.place({self._named(call, name): array for name, array in call.arrays.items()})

    def _named(self, call: Call, name: str) -> str:
        """The name of an array of a call in memory: arrays that calls share are one."""
        return f"{id(call.arrays[name])}" if name in call.arrays else name

    def _names(self, call: Call) -> dict[str, str]:
        names = {name: self._named(call, name) for name in call.arrays}
        names |= {name: f"state_{name}" for name in BATCH if name not in call.arrays}
        names |= dict.fromkeys(("out", "mask", "frames"), f"seen{call.part}")
        return names | {"unresolved": "state_unresolved_contacts"}

    def make(self, call: Call, rows: np.ndarray, **numbers: Any) -> None:
        """Make a call for these environments."""
        self.machine.place({"rows": np.resize(rows, self.env.num_envs)})
        seen = [call.arrays.get("drawn"), self.seen.get(call.part)]
        sizes = self.sizes | {"bytes": next((array.size for array in seen if array is not None), 0)}
        self.machine.call(call.entry, self._names(call), sizes, numbers, len(rows))

    def start(self, rows: np.ndarray) -> None:
        """Start new episodes in these rows."""
        for call in self.calls.start:
            self.make(call, rows, seed=np.uint64(self.state.seed))

    def step(self, actions: np.ndarray) -> None:
        """A step of all environments."""
        self.machine.place({"actions": actions})
        numbers = {"sub_steps": self.env.task.sub_steps, "with_task": 1}
        self.machine.call(self.calls.step, {}, self.sizes, numbers, self.env.num_envs)
        for call in self.calls.advance:
            self.make(call, np.arange(self.env.num_envs))

    def observe(self) -> dict[tuple[Any, ...], np.ndarray]:
        """The observations of the present states, each part by its keys."""
        rows = np.arange(self.env.num_envs)
        for call in self.calls.write:
            self.make(call, rows)
        return {part: self.machine[f"seen{part}"] for part in self.seen}

    def observes(self, observation: Any) -> bool:
        """Whether the observations of the present states have the bytes of these."""
        return all(part_of(observation, part).tobytes() == array.tobytes() for part, array in self.observe().items())

    def differences(self) -> list[str]:
        """Names of the arrays of states and results whose bytes differ now."""
        state = self.env._episodes.now.state
        expected = {f"state_{name}": getattr(state, name) for name in BATCH}
        expected |= {f"result_{name}": array for name, array in vars(self.env._episodes._outcome).items()}
        return [name for name, array in expected.items() if array.tobytes() != self.machine[name].tobytes()]


def part_of(observation: Any, keys: tuple[Any, ...]) -> Any:
    """A part of an observation by keys from the outside in."""
    return reduce(lambda part, key: part[key], keys, observation)
