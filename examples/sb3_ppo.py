"""PPO of Stable-Baselines3 on many SEGAR environments at once, and at the end the generalization gap.

pip install 'segar[sb3]'
python examples/sb3_ppo.py --levels empty-hard --count 50 --frames 400000
python examples/sb3_ppo.py --levels place-between-v1 --seed 1
"""

import argparse
from typing import Any

import stable_baselines3
import torch

import segar
from segar.suites import suite, suites


def main(arguments: list[str] | None = None) -> segar.evaluation.Evaluation:
    """Train, evaluate on training and test levels, and print the gap."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--levels", default="empty-hard", help="a name of segar.families(), or a suite's")
    parser.add_argument("--count", type=int, default=50, help="training levels")
    parser.add_argument("--test-count", type=int, default=100, help="test levels, of the same distribution")
    parser.add_argument("--frames", type=int, default=400_000, help="steps of environments")
    parser.add_argument("--num-envs", type=int, default=64)
    parser.add_argument("--seed", type=int, default=0, help="of network and episodes, and of a suite's training levels")
    chosen = parser.parse_args(arguments)
    train, test, options = level_sets(chosen)

    torch.set_num_threads(1)  # networks as small as these are faster without threads
    env = segar.envs.SB3VecEnv(train, chosen.num_envs, seed=chosen.seed, **options)
    model = stable_baselines3.PPO(
        "MlpPolicy", env, n_steps=64, batch_size=8 * chosen.num_envs, n_epochs=4, learning_rate=1e-3, seed=chosen.seed,
        device="cpu", verbose=1,
    )  # fmt: skip
    model.learn(chosen.frames, log_interval=10)
    env.close()

    found = segar.evaluate_policy(
        lambda seen: model.predict(seen, deterministic=True)[0], train, test, distances=("exact",), **options
    )
    print(found)
    return found


def level_sets(chosen: argparse.Namespace) -> tuple[segar.Levels, segar.Levels, dict[str, Any]]:
    """Training levels, test levels, and the options of environments in which they are played; a suite says them all."""
    if chosen.levels in suites():
        of = suite(chosen.levels)
        seen = segar.observations.StateVector(hidden=of.hidden)
        options = {"task": of.task, "observation": seen, "unit_actions": True}
        return of.sample(seed=chosen.seed), of.test_levels, options
    family = segar.family(chosen.levels)
    train = family.sample(chosen.count, seed=0, split="train")
    return train, family.sample(chosen.test_count, seed=0, split="test"), {}


if __name__ == "__main__":
    main()
