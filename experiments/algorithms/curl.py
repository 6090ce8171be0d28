"""CURL (Laskin et al. 2020) on PPO: it makes two crops of one frame more alike than crops of different frames.

The defaults follow the paper's protocol: crops of 0.8, contrasts among the 480 frames of a minibatch by x' W y on the
representation itself, PPO's Adam. ``curl_original`` has what Laskin et al. used, where PPO leaves room for it.
"""

from __future__ import annotations

from collections.abc import Iterator

import torch
from tensordict import TensorDict
from torch import Tensor, nn
from torch.nn import functional as F

from segar.experiments.algorithms.auxiliary import Auxiliary, CodeLoss
from segar.experiments.collection.collector import Rollout


class CURL(Auxiliary):
    """The learner, see :class:`segar.experiments.algorithms.learner.Learner`."""

    def make_loss(self, actions: int) -> CURLLoss:
        """The contrastive loss of two views of each frame."""
        width, wanted = self.encoder.width, self.config.projection
        code = nn.Sequential(nn.Linear(width, wanted), nn.LayerNorm(wanted)) if wanted else nn.Identity()
        similarity = nn.Linear(wanted or width, wanted or width, bias=False)
        code, similarity = self.with_fresh_weights(code), self.with_fresh_weights(similarity)
        return CURLLoss(self.encoder, code, similarity, self.config.tau)

    def batches(self, rollout: Rollout) -> Iterator[TensorDict]:
        """Disjoint parts of the rollout's frames, two views of each."""
        frames = rollout.observation.flatten(0, 1)
        order = torch.randperm(len(frames), generator=self.rng).to(frames.device)
        for rows in order.tensor_split(self.config.auxiliary_minibatches):
            part = frames.index_select(0, rows)
            yield TensorDict({"query": self.augmented(part), "key": self.augmented(part)}, rows.shape)


class CURLLoss(CodeLoss):
    """InfoNCE over a batch: it finds the key of each query among all keys. Similarity is q' W k; keys are the target encoder's.

    Args:
        code: maps a representation to the code that is compared; it has targets, as the encoder does.
        similarity: W, a dense layer without bias.
        tau: see :class:`segar.experiments.algorithms.auxiliary.CodeLoss`.
    """

    def __init__(self, encoder: nn.Module, code: nn.Module, similarity: nn.Module, tau: float) -> None:
        super().__init__(nn.Sequential(encoder, code), tau)
        self.similarity = similarity

    def forward(self, tensordict: TensorDict) -> dict[str, Tensor]:
        """``loss`` [nats] and ``accuracy``, the share of queries whose own key is the nearest, of ``query`` and ``key``."""
        queries = self.network(tensordict["query"])
        scores = self.similarity(queries) @ self.target_codes(tensordict["key"]).T
        own = torch.arange(len(scores), device=scores.device)
        accuracy = (scores.detach().argmax(-1) == own).float().mean()
        return {"loss": F.cross_entropy(scores, own), "accuracy": accuracy}
