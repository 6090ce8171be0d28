"""PPO in one file: plain torch over ``segar.envs.VectorEnv``, and at the end the generalization gap.

    python examples/ppo.py --levels empty-hard --count 50 --frames 400000
    python examples/ppo.py --levels place-between-v1 --seed 1

Copy this file and change it. It needs torch and segar. The trainer of this repository, ``segar train``, has more
algorithms, run folders and sweeps.
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.distributions import Normal

import segar
from segar.errors import did_you_mean
from segar.suites import side_options, suite, suites


@dataclass(frozen=True)
class Settings:
    """What a run depends on; each is an option of the command line."""

    levels: str = "empty-hard"  # a name of segar.families(), or a suite's
    count: int | None = None  # training levels of a family, 50 by default
    test_count: int | None = None  # test levels of a family, from a disjoint stream of it, 100 by default
    frames: int = 400_000  # steps of environments
    seed: int = (
        0  # of the network, the minibatches and the episodes, and of a suite's training levels; others have seed 0
    )
    num_envs: int = 64
    num_steps: int = 64  # of each environment between two updates
    epochs: int = 4
    minibatches: int = 8
    learning_rate: float = 1e-3  # at the start; it falls linearly to 0
    gamma: float = 0.99
    gae_lambda: float = 0.95
    clip: float = 0.2
    entropy_coef: float = 0.0
    critic_coef: float = 0.5
    max_grad_norm: float = 0.5


class Agent(nn.Module):
    """Two small networks: the mean of a Gaussian policy, and the value."""

    def __init__(self, observations: int, actions: int) -> None:
        super().__init__()
        self.mean = network(observations, actions, last_gain=0.01)
        self.value = network(observations, 1, last_gain=1.0)
        self.log_std = nn.Parameter(torch.zeros(actions))

    def policy(self, seen: Tensor) -> Normal:
        """The distribution of actions, ``[..., actions]``."""
        return Normal(self.mean(seen), self.log_std.exp())


def network(inputs: int, outputs: int, last_gain: float) -> nn.Sequential:
    """Two hidden layers of 64 with orthogonal weights."""
    sizes = [(inputs, 64, 2**0.5), (64, 64, 2**0.5), (64, outputs, last_gain)]
    layers = []
    for rows, columns, gain in sizes:
        layer = nn.Linear(rows, columns)
        nn.init.orthogonal_(layer.weight, gain)
        nn.init.zeros_(layer.bias)
        layers += [layer, nn.Tanh()]
    return nn.Sequential(*layers[:-1])


@dataclass
class Rollout:
    """Steps of all environments, ``[time, environment, ...]``."""

    seen: Tensor
    actions: Tensor
    log_probs: Tensor
    advantages: Tensor
    returns: Tensor


def problem(settings: Settings) -> tuple[dict[str, Any], Callable[..., segar.evaluation.Evaluation]]:
    """The options of environments for training, and what evaluates a policy; a suite says its levels, task and observation.

    Raises:
        SegarError: an option makes no sense, or the suite is about textures, which states do not show.
    """
    for name in ("count", "test_count", "frames", "num_envs"):
        number = getattr(settings, name)
        if number is not None and number < 1:
            raise segar.SegarError(f"--{name.replace('_', '-')} must be 1 or more, not {number}")
    same = {"unit_actions": True}
    if settings.levels in suites():
        if settings.count is not None or settings.test_count is not None:
            raise segar.SegarError(
                f"the suite {settings.levels} has its own levels; leave --count and --test-count out"
            )
        of = suite(settings.levels)
        options = side_options(of, "train", settings.seed) | same
        return options, partial(segar.evaluate_on_suite, suite=of, seed=settings.seed, **same)
    if settings.levels not in segar.families():
        hint = did_you_mean(settings.levels, (*segar.families(), *suites()))
        raise segar.SegarError(f"--levels: no family and no suite is called '{settings.levels}'.{hint}")
    family = segar.family(settings.levels)
    train = family.sample(settings.count or 50, seed=0, split="train")
    test = family.sample(settings.test_count or 100, seed=0, split="test")
    return {"levels": train, **same}, partial(segar.evaluate_policy, train=train, test=test, **same)


def train(settings: Settings, levels: segar.Levels, **options: Any) -> Agent:
    """An agent that was trained on these levels; prints how it fares."""
    torch.set_num_threads(1)  # networks as small as these are faster without threads
    torch.manual_seed(settings.seed)
    # With unit_actions, actions lie in [-1, 1] whatever the range of the task. Finished episodes are followed by the next.
    env = segar.envs.VectorEnv(levels, settings.num_envs, seed=settings.seed, **options)
    agent = Agent(env.single_observation_space.shape[0], env.single_action_space.shape[0])
    optimizer = torch.optim.Adam(agent.parameters(), settings.learning_rate, eps=1e-5)
    updates = max(settings.frames // (settings.num_envs * settings.num_steps), 1)
    seen, began = env.reset()[0], time.perf_counter()
    for update in range(updates):
        optimizer.param_groups[0]["lr"] = settings.learning_rate * (1 - update / updates)
        rollout, seen, ended = collect(settings, env, agent, seen)
        learn(settings, agent, optimizer, rollout)
        if ended and (update % 10 == 0 or update == updates - 1):
            frames = (update + 1) * settings.num_envs * settings.num_steps
            rate = frames / (time.perf_counter() - began)
            print(f"{frames:>9,} frames  return {np.mean(ended):8.3f}  {rate:,.0f} frames/s", flush=True)
    env.close()
    return agent


def collect(
    settings: Settings, env: segar.envs.VectorEnv, agent: Agent, seen: np.ndarray
) -> tuple[Rollout, np.ndarray, list[float]]:
    """A rollout that begins at the observations ``seen``; the observations after it; and the returns of ended episodes."""
    shape = (settings.num_steps, settings.num_envs)
    observations = torch.empty(*shape, seen.shape[1])
    actions = torch.empty(*shape, env.single_action_space.shape[0])
    log_probs, values, next_values, rewards, terminal, over = (torch.zeros(shape) for _ in range(6))
    returns: list[float] = []
    with torch.no_grad():
        for t in range(settings.num_steps):
            observations[t] = torch.from_numpy(seen)
            policy = agent.policy(observations[t])
            actions[t] = policy.sample()
            log_probs[t] = policy.log_prob(actions[t]).sum(-1)
            values[t] = agent.value(observations[t]).squeeze(-1)
            seen, reward, terminated, truncated, info = env.step(actions[t].numpy())
            rewards[t], terminal[t] = torch.from_numpy(reward), torch.from_numpy(terminated)
            over[t] = torch.from_numpy(terminated | truncated)
            next_values[t] = agent.value(torch.from_numpy(seen)).squeeze(-1)
            if over[t].any():
                # The value after a time-out is that of the last observation, not of the next episode's first.
                rows = np.flatnonzero(info["_final_obs"])
                next_values[t, rows] = agent.value(torch.from_numpy(info["final_obs"][rows])).squeeze(-1)
                returns += info["final_info"]["return"][rows].tolist()
    advantages = generalized_advantages(settings, rewards, values, next_values, terminal, over)
    return Rollout(observations, actions, log_probs, advantages, advantages + values), seen, returns


def generalized_advantages(
    settings: Settings, rewards: Tensor, values: Tensor, next_values: Tensor, terminal: Tensor, over: Tensor
) -> Tensor:
    """Advantages ``[time, environment]`` (Schulman et al. 2016); nothing passes from one episode to the one before."""
    errors = rewards + settings.gamma * next_values * (1 - terminal) - values
    advantages, later = torch.empty_like(errors), torch.zeros(errors.shape[1])
    for t in reversed(range(len(errors))):
        later = errors[t] + settings.gamma * settings.gae_lambda * (1 - over[t]) * later
        advantages[t] = later
    return advantages


def learn(settings: Settings, agent: Agent, optimizer: torch.optim.Optimizer, rollout: Rollout) -> None:
    """Several passes over a rollout with the clipped objective (Schulman et al. 2017)."""
    flat = {name: part.flatten(0, 1) for name, part in vars(rollout).items()}
    size = len(flat["returns"])
    for _ in range(settings.epochs):
        for rows in torch.randperm(size).tensor_split(settings.minibatches):
            batch = Rollout(**{name: part[rows] for name, part in flat.items()})
            policy = agent.policy(batch.seen)
            ratio = (policy.log_prob(batch.actions).sum(-1) - batch.log_probs).exp()
            advantages = (batch.advantages - batch.advantages.mean()) / (batch.advantages.std() + 1e-8)
            clipped = ratio.clamp(1 - settings.clip, 1 + settings.clip)
            gain = torch.minimum(ratio * advantages, clipped * advantages).mean()
            value_loss = 0.5 * (agent.value(batch.seen).squeeze(-1) - batch.returns).square().mean()
            entropy = policy.entropy().sum(-1).mean()
            loss = settings.critic_coef * value_loss - gain - settings.entropy_coef * entropy
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(agent.parameters(), settings.max_grad_norm)
            optimizer.step()


def main(arguments: list[str] | None = None) -> segar.evaluation.Evaluation:
    """Train, evaluate on training and test levels, and print the gap."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name, default in vars(Settings()).items():
        kind = int if default is None else type(default)
        parser.add_argument(f"--{name.replace('_', '-')}", type=kind, default=default)
    settings = Settings(**vars(parser.parse_args(arguments)))
    try:
        options, evaluate = problem(settings)
    except segar.SegarError as error:
        parser.error(str(error))
    agent = train(settings, **options)

    def most_likely(seen: np.ndarray) -> np.ndarray:
        with torch.no_grad():
            return agent.mean(torch.from_numpy(seen)).numpy()

    found = evaluate(most_likely, distances=("exact",))
    print(found)
    return found


if __name__ == "__main__":
    main()
