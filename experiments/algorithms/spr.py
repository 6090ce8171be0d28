"""SPR (Schwarzer et al. 2020) on PPO: from a frame and the next actions it predicts the representations of the next frames.

The defaults follow the paper's protocol, which predicts one step by one network of representation and action.
``spr_original`` predicts five by a transition model, as Schwarzer et al. did, where PPO leaves room for it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping

import torch
from tensordict import TensorDict
from torch import Tensor, nn
from torch.nn import functional as F

from segar.experiments.algorithms.auxiliary import Auxiliary, CodeLoss
from segar.experiments.collection.collector import Rollout


class SPR(Auxiliary):
    """The learner, see :class:`segar.experiments.algorithms.learner.Learner`."""

    def make_loss(self, actions: int) -> SPRLoss:
        """The loss of the predictions."""
        model = MODELS[self.config.model](self.encoder.width, self.config.model_width, actions)  # type: ignore[call-arg]
        return SPRLoss(self.encoder, self.with_fresh_weights(model), self.config.weight, self.config.tau)

    def batches(self, rollout: Rollout) -> Iterator[TensorDict]:
        """Disjoint parts of all sequences in a rollout."""
        horizon, (steps, envs) = self.config.horizon, rollout.done.shape[:2]
        order = torch.randperm((steps - horizon) * envs, generator=self.rng).to(rollout.done.device)
        for starts in order.tensor_split(self.config.auxiliary_minibatches):
            time, env = starts // envs, starts % envs
            part = sequences(rollout, time, env, horizon)
            views = self.augmented(part["observation"].flatten(0, 1)).unflatten(0, (-1, horizon + 1))
            yield part.set("first", self.augmented(part["observation"][:, 0])).set("following", views[:, 1:])


def sequences(rollout: Rollout, time: Tensor, env: Tensor, horizon: int) -> TensorDict:
    """Pieces of a rollout that begin at step ``time`` (int [n]) of environments ``env`` (int [n]).

    ``observation`` [n, horizon + 1, ...], ``action`` [n, horizon, d], and ``valid`` bool [n, horizon]: whether
    observation k + 1 belongs to the episode of observation 0.
    """
    steps = time[:, None] + torch.arange(horizon + 1, device=time.device)
    done = rollout.done.squeeze(-1)[steps[:, :-1], env[:, None]]
    entries = {
        "observation": rollout.observation[steps, env[:, None]],
        "action": rollout.u[steps[:, :-1], env[:, None]].tanh(),
        "valid": ~done.cumsum(1).bool(),
    }
    return TensorDict(entries, [len(time)])


class SPRLoss(CodeLoss):
    """Twice the cosine distance between predicted codes and the target network's codes of the frames that followed.

    Args:
        model: predicts codes, and projects representations to codes; the projection has targets, as the encoder does.
        weight: of the loss.
        tau: see :class:`segar.experiments.algorithms.auxiliary.CodeLoss`.
    """

    def __init__(self, encoder: nn.Module, model: Model, weight: float, tau: float) -> None:
        super().__init__(nn.Sequential(encoder, model), tau)
        self.weight = weight

    def forward(self, tensordict: TensorDict) -> dict[str, Tensor]:
        """``loss``, and ``cosine`` between predicted and seen, of what :meth:`SPR.batches` yields."""
        horizon = tensordict["action"].shape[1]
        encoder, model = self.network
        predicted = model.predict(encoder(tensordict["first"]), tensordict["action"])
        seen = self.target_codes(tensordict["following"].flatten(0, 1)).unflatten(0, (-1, horizon))
        cosine = F.cosine_similarity(predicted, seen, dim=-1)
        valid = tensordict["valid"].float()
        mean = (cosine * valid).sum() / valid.sum().clamp(min=1.0)
        return {"loss": self.weight * (2.0 - 2.0 * mean), "cosine": mean.detach()}


class Model(nn.Module, ABC):
    """A model that predicts codes of the next representations."""

    @abstractmethod
    def predict(self, representation: Tensor, actions: Tensor) -> Tensor:
        """Codes [n, k, d] of the k next representations, from the first one [n, width] and actions [n, k, actions]."""

    @abstractmethod
    def forward(self, representation: Tensor) -> Tensor:
        """The code [n, d] of a representation."""


class ActionProjection(Model):
    """The 2022 code's model: one projection of representation and action, and a predictor. Targets have the action 0.

    Each layer is dense with tanh. For 256 wide and two actions: 197 888 parameters.
    """

    def __init__(self, inputs: int, width: int, actions: int) -> None:
        super().__init__()
        self.width = width
        self.action = nn.Sequential(nn.Linear(actions, width), nn.Tanh())
        self.projection = nn.Sequential(nn.Linear(inputs + width, width), nn.Tanh())
        self.predictor = nn.Sequential(nn.Linear(width, width), nn.Tanh())

    def predict(self, representation: Tensor, actions: Tensor) -> Tensor:
        """See :class:`Model`; k is 1."""
        action = self.action(actions.squeeze(1))
        return self.predictor(self.projection(torch.cat([representation, action], -1)))[:, None]

    def forward(self, representation: Tensor) -> Tensor:
        """See :class:`Model`."""
        no_action = representation.new_zeros(len(representation), self.width)
        return self.projection(torch.cat([representation, no_action], -1))


class Transition(Model):
    """Schwarzer et al.'s model: a transition model that is applied once per step, a projection, and a linear predictor.

    Their transition model is convolutional, because their representation is an image; this one is a residual MLP.
    For 256 wide and two actions: 263 936 parameters.
    """

    def __init__(self, inputs: int, width: int, actions: int) -> None:
        super().__init__()
        self.change = nn.Sequential(nn.Linear(inputs + actions, width), nn.ReLU(), nn.Linear(width, inputs))
        self.projection = nn.Linear(inputs, width)
        self.predictor = nn.Linear(width, width)

    def predict(self, representation: Tensor, actions: Tensor) -> Tensor:
        """See :class:`Model`."""
        following = []
        for action in actions.unbind(1):
            representation = F.relu(representation + self.change(torch.cat([representation, action], -1)))
            following.append(representation)
        return self.predictor(self.projection(torch.stack(following, 1)))

    def forward(self, representation: Tensor) -> Tensor:
        """See :class:`Model`."""
        return self.projection(representation)


MODELS: Mapping[str, type[Model]] = {"action_projection": ActionProjection, "transition": Transition}
