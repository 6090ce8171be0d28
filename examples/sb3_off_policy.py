"""Two learners off the policy, on Stable-Baselines3, trained on suites and written as ONNX files that make a row.

    pip install 'segar[train,onnx,sb3]' sb3-contrib onnx onnxscript
    python examples/sb3_off_policy.py tqc --suites place-few-v1 number-more-v1 --seeds 1 2 3 4 5 --out tqc
    segar benchmark policy=tqc row=tqc suite=[place-few-v1,number-more-v1] seeds=5

``tqc`` is the quantile learner of sb3-contrib: its critics learn quantiles of the return, of which the highest are left out
(Kuznetsov et al. 2020). ``mbpo`` learns a model of the world: half of what SAC learns from are short episodes that the model
imagines, begun in states that were seen (Janner et al. 2019). A file that is there is not made again. Copy this script and
change it.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from sb3_contrib import TQC
from stable_baselines3 import SAC
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.type_aliases import ReplayBufferSamples
from stable_baselines3.common.vec_env import VecEnvWrapper
from torch import nn
from torch.nn.functional import binary_cross_entropy_with_logits

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
    temperature: float = 0.1  # of the entropy, at first; it is learned
    target_entropy: float = -2.0
    capacity: int = 100_000  # frames that are kept
    warmup: int = 2048  # frames of random actions
    # tqc
    quantiles: int = 10  # of each of two critics; with the library's 25 a step takes half as long again
    left_out: int = 1  # the highest of each critic
    # mbpo
    members: int = 3  # networks of the model, one of which, drawn anew for each step, says what follows
    fit_every: int = 4096  # frames
    fit_steps: int = 200  # of gradient, each on as many steps of the world as the policy learns from
    imagined: float = 0.5  # of the steps that the policy learns from
    horizon: int = 5  # steps of an imagined episode, at most


class RootedRewards(VecEnvWrapper):
    """Rewards as their square roots, with their signs: large ones hide the small ones near the goal."""

    def reset(self):
        return self.venv.reset()

    def step_wait(self):
        seen, rewards, dones, infos = self.venv.step_wait()
        return seen, np.sign(rewards) * np.sqrt(np.abs(rewards)), dones, infos


class Model(nn.Module):
    """What follows an observation and an action: the change of the observation, the reward, and whether the episode ends."""

    def __init__(self, observed: int, acted: int, settings: Settings):
        super().__init__()
        self.settings = settings
        width = settings.width
        self.members = nn.ModuleList()
        for _ in range(settings.members):
            layers = nn.Linear(observed + acted, width), nn.SiLU(), nn.Linear(width, width), nn.SiLU()
            self.members.append(nn.Sequential(*layers, nn.Linear(width, observed + 2)))
        self.optimizer = torch.optim.Adam(self.parameters(), settings.learning_rate)
        for name, size in (("inputs", observed + acted), ("targets", observed + 1)):
            self.register_buffer(f"{name}_mean", torch.zeros(size))
            self.register_buffer(f"{name}_scale", torch.ones(size))

    def scale(self, name: str, seen: torch.Tensor) -> None:
        """Take means and standard deviations of what was seen; what hardly varies is not blown up."""
        setattr(self, f"{name}_mean", seen.mean(0))
        setattr(self, f"{name}_scale", seen.std(0).clamp(min=1e-3))

    def predict(self, observations: torch.Tensor, actions: torch.Tensor) -> torch.Tensor:
        """What each member says, as scaled targets and the logit of an end: [members, steps, observed + 2]."""
        inputs = (torch.cat((observations, actions), 1) - self.inputs_mean) / self.inputs_scale
        return torch.stack([member(inputs) for member in self.members])

    def fit(self, seen: "Imagination") -> None:
        """Learn from what was seen; each member from other steps in other order."""
        settings = self.settings
        large = seen.real(20_000)
        self.scale("inputs", torch.cat((large.observations, large.actions), 1))
        self.scale("targets", torch.cat((large.next_observations - large.observations, large.rewards), 1))
        for _ in range(settings.fit_steps):
            steps = seen.real(settings.batch)
            targets = torch.cat((steps.next_observations - steps.observations, steps.rewards), 1)
            targets = (targets - self.targets_mean) / self.targets_scale
            said = self.predict(steps.observations, steps.actions)
            of_member = torch.rand(said.shape[:2]) < 0.7
            wrong = (said[..., :-1] - targets).square().mean(-1)
            ends = steps.dones[:, 0].expand(said.shape[:2])
            wrong = wrong + binary_cross_entropy_with_logits(said[..., -1], ends, reduction="none")
            self.optimizer.zero_grad()
            (wrong * of_member).mean().backward()
            self.optimizer.step()

    @torch.no_grad()
    def step(self, seen: torch.Tensor, actions: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """What follows by a member drawn for each step: observations, rewards [steps, 1], and ends [steps, 1] as 0 or 1."""
        said = self.predict(seen, actions)[torch.randint(len(self.members), (len(seen),)), torch.arange(len(seen))]
        targets = said[:, :-1] * self.targets_scale + self.targets_mean
        ends = torch.bernoulli(said[:, -1:].sigmoid())
        return seen + targets[:, :-1], targets[:, -1:], ends


class Imagination(ReplayBuffer):
    """What was seen, of which a learner gets a part, and for the rest what a model says of its own actions."""

    def begin(self, learner: SAC, settings: Settings) -> None:
        self.learner, self.settings, self.age = learner, settings, None
        self.model = Model(self.observations.shape[-1], self.actions.shape[-1], settings)

    def add(self, *step, **more) -> None:
        super().add(*step, **more)
        if self.learner.num_timesteps % self.settings.fit_every < self.n_envs:
            self.model.fit(self)

    def real(self, batch_size: int) -> ReplayBufferSamples:
        """Steps that were seen."""
        return super().sample(batch_size)

    def sample(self, batch_size: int, env=None) -> ReplayBufferSamples:
        seen = self.real(batch_size)
        count, horizon = int(self.settings.imagined * batch_size), self.settings.horizon
        if self.learner.num_timesteps < self.settings.fit_every:
            return seen
        if self.age is None:
            self.at, self.age = seen.observations[:count].clone(), torch.randint(horizon, (count, 1))
        with torch.no_grad():
            actions = self.learner.actor(self.at)
        then, rewards, ends = self.model.step(self.at, actions)
        imagined = (self.at, actions, then, ends, rewards)
        both = (torch.cat((one, of[count:])) for one, of in zip(imagined, seen[:5], strict=True))
        self.age += 1
        over = (ends > 0) | (self.age >= horizon)
        self.at, self.age = torch.where(over, seen.observations[:count], then), self.age.masked_fill(over, 0)
        return ReplayBufferSamples(*both)


class Deterministic(nn.Module):
    """What the actor does without noise, in the range of the task."""

    def __init__(self, model: SAC):
        super().__init__()
        self.actor = model.actor
        self.low, self.high = torch.tensor(model.action_space.low), torch.tensor(model.action_space.high)

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        middle = self.actor.get_action_dist_params(observation)[0]
        return self.low + (middle.tanh() + 1) / 2 * (self.high - self.low)


def train(learner: str, side: TrainingSide, seed: int, settings: Settings = Settings()) -> SAC:
    """Learns from the training levels of a side of a suite: a learner ``"tqc"`` or ``"mbpo"``."""
    torch.set_num_threads(1)  # networks as small as these are faster without threads
    env = SB3VecEnv(num_envs=settings.num_envs, seed=seed, **side_options(side, "train", seed))
    quantile, networks = learner == "tqc", {"net_arch": [settings.width, settings.width]}
    own = {"top_quantiles_to_drop_per_net": settings.left_out} if quantile else {"replay_buffer_class": Imagination}
    model = (TQC if quantile else SAC)(
        "MlpPolicy", RootedRewards(env), learning_rate=settings.learning_rate, buffer_size=settings.capacity,
        learning_starts=settings.warmup, batch_size=settings.batch, tau=settings.tau, gamma=settings.gamma,
        train_freq=1, gradient_steps=settings.gradient_steps, seed=seed, device="cpu",
        ent_coef=f"auto_{settings.temperature}", target_entropy=settings.target_entropy,
        policy_kwargs=networks | ({"n_quantiles": settings.quantiles} if quantile else {}), **own,
    )  # fmt: skip
    if not quantile:
        model.replay_buffer.begin(model, settings)
    return model.learn(settings.frames)


def export(model: SAC, path: Path) -> None:
    """Write the policy as an ONNX file, which is there when it is whole."""
    shape, unfinished = (2, *model.observation_space.shape), path.with_suffix(".part")
    program = torch.onnx.export(
        Deterministic(model).eval(), (torch.zeros(shape),), input_names=["observation"], output_names=["action"],
        dynamic_shapes=({0: torch.export.Dim("n")},), dynamo=True, verbose=False,
    )  # fmt: skip
    for node in program.model.graph:
        node.metadata_props.clear()  # they name files of this machine, so that another one would write other bytes
    program.save(unfinished, external_data=False)
    unfinished.replace(path)


def main(arguments: Sequence[str] | None = None) -> None:
    """The command: trains on each suite with each seed and writes a file of each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("learner", choices=("tqc", "mbpo"))
    parser.add_argument("--suites", nargs="+", choices=suites(), default=["place-between-v1"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[1])
    parser.add_argument("--frames", type=int, default=Settings.frames)
    parser.add_argument("--out", type=Path, help="the learner's name by default")
    chosen = parser.parse_args(arguments)
    out = chosen.out or Path(chosen.learner)
    out.mkdir(parents=True, exist_ok=True)
    for name in chosen.suites:
        for seed in chosen.seeds:
            path = out / f"{name}-s{seed}.onnx"
            if not path.exists():
                export(
                    train(chosen.learner, suite(name).training_side(seed), seed, Settings(frames=chosen.frames)), path
                )
                print(path, flush=True)


if __name__ == "__main__":
    main()
