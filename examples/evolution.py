"""Evolution strategies in one file of numpy: each environment plays a candidate of its own, and the better half votes.

    python examples/evolution.py --suite place-between-v1 --seed 1
    segar benchmark policy=examples.evolution:policy row=evolution seeds=5

Antithetic candidates around a mean, whose returns are compared by ranks (Salimans et al. 2017). Copy this file and change it.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import segar
from segar.envs import VectorEnv
from segar.suites import TrainingSide, side_options, suite, suites


@dataclass(frozen=True)
class Settings:
    """What a run depends on."""

    generations: int = 100
    pairs: int = 64  # of candidates, each with its mirror image
    episodes: int = 4  # that a candidate plays, on levels of its own
    width: int = 16  # of the hidden layer
    spread: float = 0.1  # standard deviation of candidates
    learning_rate: float = 0.03
    decay: float = 0.005  # of weights, in each generation


def policy(side: TrainingSide, seed: int, settings: Settings = Settings()) -> Callable[[np.ndarray], np.ndarray]:
    """Learns from the training levels of a side of a suite; gives actions [n, components] for observations [n, numbers]."""
    rng, candidates = np.random.default_rng(seed), 2 * settings.pairs
    env = VectorEnv(num_envs=candidates * settings.episodes, seed=seed, **side_options(side, "train", seed))
    inputs, outputs = env.single_observation_space.shape[0], env.single_action_space.shape[0]
    shapes = [(inputs + 1, settings.width), (settings.width + 1, outputs)]
    middle = (env.single_action_space.high + env.single_action_space.low) / 2
    half = env.single_action_space.high - middle
    mean, momentum = np.zeros(sum(map(np.prod, shapes))), 0.0

    def act(weights: np.ndarray, seen: np.ndarray) -> np.ndarray:
        """Actions [candidates, n, components] of observations [candidates, n, numbers]."""
        first, last = np.split(weights, [np.prod(shapes[0])], axis=1)
        for part, shape in ((first, shapes[0]), (last, shapes[1])):
            matrix = part.reshape(-1, *shape) / np.sqrt(shape[0])
            seen = np.tanh(seen @ matrix[:, :-1] + matrix[:, -1:])
        return (middle + half * seen).astype(np.float32)

    for _ in range(settings.generations):
        noise = rng.normal(size=(settings.pairs, len(mean)))
        noise = np.concatenate([noise, -noise])
        weights = mean + settings.spread * noise
        returns = returns_of(env, lambda seen, weights=weights: act(weights, seen.reshape(candidates, -1, inputs)))
        ranks = returns.reshape(candidates, -1).mean(axis=1).argsort().argsort() / (candidates - 1) - 0.5
        momentum = 0.9 * momentum + ranks @ noise / (candidates * settings.spread)
        mean = (1 - settings.decay) * mean + settings.learning_rate * momentum
    return lambda seen: act(mean[None], seen[None])[0]


def returns_of(env: VectorEnv, act: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """The return of one episode of each environment."""
    seen, _ = env.reset()
    total, runs = np.zeros(env.num_envs), np.ones(env.num_envs, bool)
    while runs.any():
        seen, reward, terminated, truncated, _ = env.step(act(seen).reshape(env.num_envs, -1))
        total += reward * runs
        runs &= ~(terminated | truncated)
    return total


def main(arguments: Sequence[str] | None = None) -> Any:
    """The command: trains, prints success on both sides of the suite, and returns what was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--suite", choices=suites(), default="place-between-v1")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--generations", type=int, default=Settings.generations)
    chosen = parser.parse_args(arguments)
    of = suite(chosen.suite)
    agent = policy(of.training_side(chosen.seed), chosen.seed, Settings(generations=chosen.generations))
    found = segar.evaluate_on_suite(agent, of, seed=chosen.seed)
    for name, result in (("training", found.train), ("test", found.test)):
        print(f"success in {name}: {result.mean('success').value:.2f}")
    return found


if __name__ == "__main__":
    main()
