"""PPO of Stable-Baselines3 on many SEGAR environments at once, and at the end the generalization gap.

pip install 'segar[sb3]'
python examples/sb3_ppo.py --levels empty-hard --count 50 --frames 400000
python examples/sb3_ppo.py --levels place-between-v1 --seed 1
"""

import argparse
from collections.abc import Callable
from functools import partial
from typing import Any

import stable_baselines3
import torch

import segar
from segar.errors import did_you_mean
from segar.suites import side_options, suite, suites


def main(arguments: list[str] | None = None) -> segar.evaluation.Evaluation:
    """Train, evaluate on training and test levels, and print the gap."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--levels", default="empty-hard", help="a name of segar.families(), or a suite's")
    parser.add_argument("--count", type=int, help="training levels of a family, 50 by default")
    parser.add_argument("--test-count", type=int, help="test levels of a family, 100 by default")
    parser.add_argument("--frames", type=int, default=400_000, help="steps of environments")
    parser.add_argument("--num-envs", type=int, default=64)
    parser.add_argument("--seed", type=int, default=0, help="of network and episodes, and of a suite's training levels")
    chosen = parser.parse_args(arguments)
    try:
        options, evaluate = problem(chosen)
    except segar.SegarError as error:
        parser.error(str(error))

    torch.set_num_threads(1)  # networks as small as these are faster without threads
    env = segar.envs.SB3VecEnv(num_envs=chosen.num_envs, seed=chosen.seed, **options)
    model = stable_baselines3.PPO(
        "MlpPolicy", env, n_steps=64, batch_size=8 * chosen.num_envs, n_epochs=4, learning_rate=1e-3, seed=chosen.seed,
        device="cpu", verbose=1,
    )  # fmt: skip
    model.learn(chosen.frames, log_interval=10)
    env.close()

    found = evaluate(lambda seen: model.predict(seen, deterministic=True)[0], distances=("exact",))
    print(found)
    return found


def problem(chosen: argparse.Namespace) -> tuple[dict[str, Any], Callable[..., segar.evaluation.Evaluation]]:
    """The options of environments for training, and what evaluates a policy; a suite says its levels, task and observation.

    Raises:
        SegarError: an option makes no sense, or the suite is about textures, which states do not show.
    """
    for name in ("count", "test_count", "frames", "num_envs"):
        number = getattr(chosen, name)
        if number is not None and number < 1:
            raise segar.SegarError(f"--{name.replace('_', '-')} must be 1 or more, not {number}")
    if chosen.levels in suites():
        if chosen.count is not None or chosen.test_count is not None:
            raise segar.SegarError(f"the suite {chosen.levels} has its own levels; leave --count and --test-count out")
        of, same = suite(chosen.levels), {"unit_actions": True}
        options = side_options(of, "train", chosen.seed) | same
        return options, partial(segar.evaluate_on_suite, suite=of, seed=chosen.seed, **same)
    if chosen.levels not in segar.families():
        hint = did_you_mean(chosen.levels, (*segar.families(), *suites()))
        raise segar.SegarError(f"--levels: no family and no suite is called '{chosen.levels}'.{hint}")
    family = segar.family(chosen.levels)
    train = family.sample(chosen.count or 50, seed=0, split="train")
    test = family.sample(chosen.test_count or 100, seed=0, split="test")
    return {"levels": train}, partial(segar.evaluate_policy, train=train, test=test)


if __name__ == "__main__":
    main()
