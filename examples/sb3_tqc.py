"""A quantile learner off the policy, TQC of sb3-contrib, trained on suites and written as ONNX files that make a row.

    pip install 'segar[train,onnx,sb3]' sb3-contrib onnx onnxscript
    python examples/sb3_tqc.py --suites place-few-v1 number-more-v1 --seeds 1 2 3 4 5 --out tqc
    segar benchmark policy=tqc row=tqc suite=[place-few-v1,number-more-v1] seeds=5

Its critics learn quantiles of the return, of which the highest are left out (Kuznetsov et al. 2020). A file that is there
is not made again. Copy this script and change it.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from sb3_contrib import TQC
from stable_baselines3.common.vec_env import VecEnvWrapper
from torch import nn

from segar.envs import SB3VecEnv
from segar.suites import TrainingSide, side_options, suite, suites


@dataclass(frozen=True)
class Settings:
    """What a run depends on; the values are those of ``algorithm=sac_fast``, where it has them."""

    frames: int = 200_000
    num_envs: int = 64
    gradient_steps: int = 2  # for each step of all environments
    batch: int = 512
    width: int = 128
    learning_rate: float = 1e-3
    gamma: float = 0.9
    tau: float = 0.02
    temperature: float = 0.1  # of the entropy
    warmup: int = 2048  # frames of random actions
    quantiles: int = 10  # of each of two critics; with the library's 25 a step takes twice as long
    left_out: int = 1  # the highest of each critic


class RootedRewards(VecEnvWrapper):
    """Rewards as their square roots, with their signs: large ones hide the small ones near the goal."""

    def reset(self):
        return self.venv.reset()

    def step_wait(self):
        seen, rewards, dones, infos = self.venv.step_wait()
        return seen, np.sign(rewards) * np.sqrt(np.abs(rewards)), dones, infos


class Deterministic(nn.Module):
    """What the actor does without noise, in the range of the task."""

    def __init__(self, model: TQC):
        super().__init__()
        self.actor = model.actor
        self.low, self.high = torch.tensor(model.action_space.low), torch.tensor(model.action_space.high)

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        middle = self.actor.get_action_dist_params(observation)[0]
        return self.low + (middle.tanh() + 1) / 2 * (self.high - self.low)


def train(side: TrainingSide, seed: int, settings: Settings = Settings()) -> TQC:
    """Learns from the training levels of a side of a suite."""
    torch.set_num_threads(1)  # networks as small as these are faster without threads
    env = SB3VecEnv(num_envs=settings.num_envs, seed=seed, **side_options(side, "train", seed))
    model = TQC(
        "MlpPolicy", RootedRewards(env), learning_rate=settings.learning_rate, buffer_size=settings.frames,
        learning_starts=settings.warmup, batch_size=settings.batch, tau=settings.tau, gamma=settings.gamma,
        train_freq=1, gradient_steps=settings.gradient_steps, ent_coef=settings.temperature, seed=seed, device="cpu",
        top_quantiles_to_drop_per_net=settings.left_out,
        policy_kwargs={"net_arch": [settings.width, settings.width], "n_quantiles": settings.quantiles},
    )  # fmt: skip
    return model.learn(settings.frames)


def export(model: TQC, path: Path) -> None:
    """Write the policy as an ONNX file, which is there when it is whole."""
    shape, unfinished = (2, *model.observation_space.shape), path.with_suffix(".part")
    torch.onnx.export(
        Deterministic(model).eval(), (torch.zeros(shape),), unfinished, input_names=["observation"], output_names=["action"],
        dynamic_shapes=({0: torch.export.Dim("n")},), external_data=False, dynamo=True, verbose=False,
    )  # fmt: skip
    unfinished.replace(path)


def main(arguments: Sequence[str] | None = None) -> None:
    """The command: trains on each suite with each seed and writes a file of each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--suites", nargs="+", choices=suites(), default=["place-between-v1"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[1])
    parser.add_argument("--frames", type=int, default=Settings.frames)
    parser.add_argument("--out", type=Path, default=Path("tqc"))
    chosen = parser.parse_args(arguments)
    chosen.out.mkdir(parents=True, exist_ok=True)
    for name in chosen.suites:
        for seed in chosen.seeds:
            path = chosen.out / f"{name}-s{seed}.onnx"
            if not path.exists():
                export(train(suite(name).training_side(seed), seed, Settings(frames=chosen.frames)), path)
                print(path, flush=True)


if __name__ == "__main__":
    main()
