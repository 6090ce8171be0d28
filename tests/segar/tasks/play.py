"""What the tests of tasks share: whole episodes, played by a policy."""

from collections.abc import Callable
from typing import Any

import numpy as np

from segar.envs import VectorEnv


def at_random(seed: int = 0) -> Callable[[dict], np.ndarray]:
    """A player that draws its actions uniformly."""
    rng = np.random.default_rng(seed)
    return lambda info: rng.uniform(-1, 1, (len(info["level"]), 2)).astype(np.float32)


def by_script(env: VectorEnv) -> Callable[[dict], np.ndarray]:
    """The scripted player of the environment's task."""
    return lambda info: env.task.demo_actions(env.factors)


def episodes(env: VectorEnv, policy: Callable[[dict], np.ndarray], steps: int = 100) -> dict[str, np.ndarray]:
    """What ``final_info`` says of each environment's first episode, results included; one row per environment."""
    found: list[dict[str, Any]] = [{} for _ in range(env.num_envs)]
    _, info = env.reset(seed=0)
    for _ in range(steps):
        _, _, _, _, info = env.step(policy(info))
        for e in np.flatnonzero(info.get("_final_info", ())):
            final = info["final_info"]
            row = {k: v[e] for k, v in final.items() if isinstance(v, np.ndarray)}
            results = env.task.results_of(env.factors_of(final, [e]))
            found[e] = found[e] or row | {k: v[0] for k, v in results.items()}
    assert all(found), "some first episode has not ended"
    return {key: np.array([row[key] for row in found]) for key in found[0]}
