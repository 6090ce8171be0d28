"""The plan of the nearest training level in one file: what memory alone earns on levels that it has not seen.

    python examples/nearest.py --suite place-between-v1 --seed 1
    segar benchmark policy=examples.nearest:policy row=nearest_plan seeds=5

The planner finds actions for each training level. In an episode, the plan of the training level whose first observation is
nearest is played to its end, whatever happens. A method that learned to act does better. It needs segar alone.
"""

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial import KDTree

import segar
from segar.envs import VectorEnv
from segar.hardness import plan
from segar.suites import TrainingSide, side_options, suite, suites


class NearestPlan:
    """Plays stored actions [levels, steps, components], chosen by the first observation of an episode."""

    def __init__(self, firsts: np.ndarray, actions: np.ndarray) -> None:
        self.spread = firsts.std(axis=0) + 1e-6
        self.tree, self.actions = KDTree(firsts / self.spread), actions
        self.step = 0

    def begin(self, episodes: Any) -> None:
        """Episodes have begun."""
        self.step = 0

    def __call__(self, observations: np.ndarray) -> np.ndarray:
        if self.step == 0:
            self.chosen = self.tree.query(observations / self.spread)[1]
        self.step += 1
        return self.actions[self.chosen, self.step - 1]


def policy(side: TrainingSide, seed: int) -> NearestPlan:
    """Plans on the training levels of a side of a suite."""
    env = VectorEnv(num_envs=len(side.sample(seed)), seed=seed, **side_options(side, "train", seed))
    found = plan(env.levels, env.task, rng=np.random.default_rng(seed), samples=64, iterations=5)
    return NearestPlan(env.reset(options={"levels": np.arange(env.num_envs)})[0], found.actions)


def main(arguments: Sequence[str] | None = None) -> Any:
    """The command: plans, prints success on both sides of the suite, and returns what was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--suite", choices=suites(), default="place-between-v1")
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args(arguments)
    of = suite(chosen.suite)
    found = segar.evaluate_on_suite(policy(of.training_side(chosen.seed), chosen.seed), of, seed=chosen.seed)
    for name, result in (("training", found.train), ("test", found.test)):
        print(f"success in {name}: {result.mean('success').value:.2f}")
    return found


if __name__ == "__main__":
    main()
