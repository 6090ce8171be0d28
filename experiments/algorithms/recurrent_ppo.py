"""PPO with a memory: TorchRL's GRU or LSTM between the encoder and the heads, trained through whole rollouts.

A minibatch holds all steps of some environments. The memory is set to 0 where an episode begins on another level. With
``trials=k`` it is kept over the k episodes on a level, and so are returns: what is maximised is the discounted sum of the
rewards of all trials (RL²: Duan et al. 2016, Wang et al. 2016), for which exploring in an early trial can pay in a later one.
A trial that ends, also by its time limit, is then no end of the return; the value of the next trial's first observation
follows. With ``algorithm.joins_trials=false``, the return ends with each trial.
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import torch
from tensordict import TensorDict
from torch import Tensor, nn
from torchrl.modules import GRUModule, LSTMModule, set_recurrent_mode

from segar.envs import VectorEnv
from segar.experiments.algorithms.ppo import PPO, clipped_loss
from segar.experiments.collection.collector import Rollout
from segar.experiments.networks.encoders import initialize, make_encoder
from segar.experiments.networks.policies import make_head, representation_of, squashed_actions
from segar.experiments.settings import RecurrentPPOConfig

CORES = {"gru": GRUModule, "lstm": LSTMModule}
STATES = {"gru": ("h",), "lstm": ("h", "c")}  # what each core remembers


class RecurrentPolicy(nn.Module):
    """Encoder, core, and heads of policy and value.

    Parameters of a core of width w: 3 (GRU) or 4 (LSTM) times w (w + phi + 2), phi being the representation's width.

    :meth:`act` keeps the memory of the episodes that :meth:`begin` started; :meth:`step` takes and returns a memory.
    """

    def __init__(self, config: RecurrentPPOConfig, observation_shape: tuple[int, ...], actions: int) -> None:
        super().__init__()
        self.states = STATES[config.core]
        self.memory_width = len(self.states) * config.core_width
        self.encoder = make_encoder(config, observation_shape)
        self.core = CORES[config.core](
            self.encoder.width,
            config.core_width,
            in_keys=["phi", *self.states, "is_init"],
            out_keys=["hidden", *(("next", state) for state in self.states)],
        )
        self.mean = make_head(config, config.core_width, actions)
        self.log_std = make_head(config, config.core_width, actions)
        self.value = make_head(config, config.core_width, 1)
        self.log_std_range = (config.min_log_std, config.max_log_std)
        self.initial_log_std = math.log(config.initial_std)
        self.acting = torch.empty(0)

    @property
    def cells(self) -> nn.Module:
        """Torch's own GRU or LSTM."""
        return getattr(self.core, "gru" if len(self.states) == 1 else "lstm")

    def initialize(self, rng: torch.Generator) -> None:
        """Draws all weights; those of the core are uniform within 1 / sqrt(width), as torch has them."""
        initialize(self, rng)
        nn.init.constant_(self.log_std[-1].bias, self.initial_log_std)  # type: ignore[arg-type]
        bound = int(self.cells.hidden_size) ** -0.5  # type: ignore[arg-type]
        for weights in self.cells.parameters():
            nn.init.uniform_(weights, -bound, bound, generator=rng)

    def heads(self, hidden: Tensor) -> tuple[Tensor, Tensor]:
        """``loc`` and ``scale`` [..., actions]."""
        return self.mean(hidden), self.log_std(hidden).clamp(*self.log_std_range).exp()

    def step(self, observation: Tensor, memory: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """See :class:`segar.experiments.collection.collector.ActorCritic`."""
        states = [part.contiguous()[None] for part in memory.chunk(len(self.states), -1)]
        hidden, after = self.cells(self.encoder(observation)[:, None], states[0] if len(states) == 1 else tuple(states))
        hidden = hidden[:, 0]
        memory = torch.cat([after] if isinstance(after, Tensor) else list(after), -1)[0]
        return (*self.heads(hidden), self.value(hidden), memory)

    def begin(self, env: VectorEnv) -> None:
        """Sets the memory to 0, because episodes start in ``env``."""
        self.acting = torch.zeros(env.num_envs, self.memory_width, device=next(self.parameters()).device)

    def prepare(self, observation: Tensor, done: Tensor) -> Tensor:
        """A rollout's observations [T, N, ...] in the form in which the encoder reads them several times."""
        return self.encoder.prepare(observation, done)

    @torch.no_grad()
    def act(self, observation: np.ndarray, *, rng: torch.Generator | None) -> np.ndarray:
        """Actions float32 [n, actions] of the next step; sampled with ``rng``, deterministic where it is None."""
        loc, scale, _, self.acting = self.step(torch.from_numpy(observation).to(self.acting.device), self.acting)
        return squashed_actions(loc, scale, rng)

    def represent(self, observation: np.ndarray) -> np.ndarray:
        """The representation phi, float32 [n, width]: the encoder's output for one observation, without memory."""
        return representation_of(self.encoder, observation)


class RecurrentPPO(PPO):
    """The learner, see :class:`segar.experiments.algorithms.learner.Learner`."""

    config: RecurrentPPOConfig

    make_policy = RecurrentPolicy

    def losses(self, minibatch: TensorDict) -> dict[str, Tensor]:
        """The loss's figures on sequences [n, T]; policy and critic read the core's output."""
        policy: Any = self.policy
        with set_recurrent_mode(True):
            steps = policy.core(minibatch.copy().update({"phi": policy.encoder(minibatch["observation"])}))
        loc, scale = policy.heads(steps["hidden"])
        return clipped_loss(self.config, minibatch, loc, scale, policy.value(steps["hidden"]))

    def make_batch(self, rollout: Rollout) -> TensorDict:
        """PPO's batch [T, N], with marks where memories began, and the memory before the first step."""
        batch = super().make_batch(rollout)
        batch["is_init"] = torch.cat([torch.zeros_like(rollout.level_done[:1]), rollout.level_done[:-1]])
        for name, first in zip(self.policy.states, rollout.memory.chunk(len(self.policy.states), -1), strict=True):
            # The core reads the memory where a sequence begins, and nowhere else.
            batch[name] = first.new_zeros(*batch.shape, 1, first.shape[-1])
            batch[name][0] = first[:, None]
        return batch

    def minibatches(self, batch: TensorDict) -> Iterator[TensorDict]:
        """Random disjoint groups of environments with all their steps [n, T], ``epochs`` times over."""
        for _ in range(self.config.epochs):
            order = torch.randperm(batch.shape[1], generator=self.rng).to(self.device)
            for rows in order.tensor_split(self.config.minibatches):
                parts = {key: value.index_select(1, rows).transpose(0, 1) for key, value in batch.items()}
                yield TensorDict(parts, [len(rows), batch.shape[0]])
