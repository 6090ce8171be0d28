"""Imitation of the planner in one file: a network learns the actions of plans, then of plans from where it went itself.

    python examples/imitation.py --suite place-between-v1 --seed 1
    segar benchmark policy=examples.imitation:policy row=imitation seeds=5

The first is behaviour cloning. The rounds after it are DAgger (Ross, Gordon and Bagnell 2011), in which the planner says what
it would do in the states that the network reaches. The planner has the simulator, on training levels alone. Copy this file and
change it. It needs torch and segar.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from torch import nn

import segar
from segar.envs import VectorEnv
from segar.hardness import plan
from segar.suites import TrainingSide, side_options, suite, suites

Act = Callable[[np.ndarray], np.ndarray]  # of observations [n, numbers] to actions [n, components]


@dataclass(frozen=True)
class Settings:
    """What a run depends on."""

    rounds: int = 3  # in which the planner is asked again
    samples: int = 64  # candidates per level and iteration of the planner
    iterations: int = 5
    width: int = 128
    steps: int = 2000  # of gradients, after each round
    batch: int = 256
    learning_rate: float = 1e-3


def policy(side: TrainingSide, seed: int, settings: Settings = Settings()) -> Act:
    """Learns from the training levels of a side of a suite."""
    torch.manual_seed(seed)
    torch.set_num_threads(1)  # the same sums on any number of cores, and as fast for networks this small
    rng, options = np.random.default_rng(seed), side_options(side, "train", seed)
    env = VectorEnv(num_envs=len(options["levels"]), seed=seed, **options)
    seen, wanted = shown_by_planner(env, rng, settings)
    for _ in range(settings.rounds):
        reached = states_of(env, learned(seen, wanted, env, rng, settings), rng)
        if len(reached) == 0:
            break
        there = VectorEnv(num_envs=len(reached), seed=seed, **{**options, "levels": reached})
        more = shown_by_planner(there, rng, settings)
        seen, wanted = (np.concatenate(both) for both in zip((seen, wanted), more, strict=True))
    return learned(seen, wanted, env, rng, settings)


def shown_by_planner(env: VectorEnv, rng: np.random.Generator, settings: Settings) -> tuple[np.ndarray, np.ndarray]:
    """Observations and actions of the planner's episodes that succeed, one on each level of the environments."""
    plans = plan(env.levels, env.task, rng=rng, samples=settings.samples, iterations=settings.iterations)
    seen, _ = env.reset(options={"levels": np.arange(env.num_envs)})
    pairs = [(seen[:0], plans.actions[:0, 0])]
    for step in range(plans.steps.max()):
        shows = plans.solved & (step < plans.steps)
        pairs.append((seen[shows], plans.actions[shows, step]))
        seen = env.step(plans.actions[:, step])[0]
    seen, wanted = zip(*pairs, strict=True)
    return np.concatenate(seen), np.concatenate(wanted)


def states_of(env: VectorEnv, agent: Act, rng: np.random.Generator) -> segar.Levels:
    """Levels that begin where the agent is after a random number of steps, of those whose episodes are not over then."""
    seen, _ = env.reset(options={"levels": np.arange(env.num_envs)})
    values, runs = env.state().state.values.copy(), np.ones(env.num_envs, bool)
    last = rng.integers(1, env.task.max_steps // 2, env.num_envs)
    for step in range(1, last.max() + 1):
        seen, _, terminated, truncated, _ = env.step(agent(seen))
        runs &= ~((terminated | truncated) & (step <= last))
        values[last == step] = env.state().state.values[last == step]
    return replace(env.levels, values=values)[runs]


def learned(seen: np.ndarray, wanted: np.ndarray, env: VectorEnv, rng: np.random.Generator, settings: Settings) -> Act:
    """A network that was fitted to these actions."""
    low, high = env.single_action_space.low, env.single_action_space.high
    middle, half = (low + high) / 2, (high - low) / 2
    sizes = (seen.shape[1], settings.width, settings.width)
    layers = [part for a, b in pairwise(sizes) for part in (nn.Linear(a, b), nn.Tanh())]
    network = nn.Sequential(*layers, nn.Linear(settings.width, wanted.shape[1]), nn.Tanh())
    adam = torch.optim.Adam(network.parameters(), settings.learning_rate)
    x, y = torch.as_tensor(seen), torch.as_tensor(((wanted - middle) / half).astype(np.float32))
    for _ in range(settings.steps):
        rows = torch.as_tensor(rng.integers(len(x), size=min(settings.batch, len(x))))
        adam.zero_grad()
        nn.functional.mse_loss(network(x[rows]), y[rows]).backward()
        adam.step()

    def act(observations: np.ndarray) -> np.ndarray:
        with torch.no_grad():
            return middle + half * network(torch.as_tensor(observations)).numpy()

    return act


def main(arguments: Sequence[str] | None = None) -> Any:
    """The command: trains, prints success on both sides of the suite, and returns what was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--suite", choices=suites(), default="place-between-v1")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=Settings.rounds)
    parser.add_argument("--steps", type=int, default=Settings.steps)
    chosen = parser.parse_args(arguments)
    of = suite(chosen.suite)
    agent = policy(of.training_side(chosen.seed), chosen.seed, Settings(rounds=chosen.rounds, steps=chosen.steps))
    found = segar.evaluate_on_suite(agent, of, seed=chosen.seed)
    for name, result in (("training", found.train), ("test", found.test)):
        print(f"success in {name}: {result.mean('success').value:.2f}")
    return found


if __name__ == "__main__":
    main()
