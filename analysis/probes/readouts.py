"""Predictions of factors from a representation, on episodes that the predictor did not see: linear, and by a network."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from sklearn.linear_model import LogisticRegression
from torch import Tensor
from torch.nn import functional as F

from segar.analysis.probes.critics import Embedding, descend, draw_weights, torch_rng
from segar.analysis.probes.pairs import Pairs, episode_folds
from segar.analysis.tables import Floats, Ints

ALPHAS = 10.0 ** np.arange(-1, 8)  # of ridge, on standardised columns
INNER_FOLDS = 4  # of the training episodes, by which alpha is chosen
INVERSE_PENALTY = 0.1  # of logistic regression
STEPS, BATCH, WIDTH, LEARNING_RATE, DECAY = 600, 256, 128, 3e-3, 1e-3  # of the network


def predict_linear(x: NDArray[np.float32], pairs: Pairs, parts: Sequence[Ints], rng: np.random.Generator) -> Floats:
    """Held-out predictions [N, k] of ridge regression for numbers, and of logistic regression for categories.

    ``parts`` are the folds. nan where the factor is missing. Factors that are there in the same frames are predicted
    together.
    """
    out = np.full(pairs.factors.shape, np.nan)
    there = np.isfinite(pairs.factors)
    alike: dict[tuple[bytes, int], list[int]] = {}
    for k, column in enumerate(pairs.columns):
        alike.setdefault((there[:, k].tobytes(), k if column.is_category else -1), []).append(k)
    for (_, category), members in alike.items():
        columns = np.array(members)
        mask = there[:, columns[0]]
        for held_out in parts:
            rest = np.setdiff1d(np.flatnonzero(mask), held_out)
            test = held_out[mask[held_out]]
            if len(rest) < 2 or not len(test):
                continue
            target = pairs.factors[rest[:, None], columns]
            if category >= 0:
                found = predict_category(x, rest, test, target)
            else:
                found = predict_numbers(x, rest, test, target, pairs.episode[rest], rng)
            out[test[:, None], columns] = found
    return out


def predict_numbers(x: Any, rest: Any, test: Any, target: Floats, episode: Ints, rng: np.random.Generator) -> Floats:
    """Ridge's predictions [len(test), k], fitted on ``target`` [len(rest), k].

    Each number has the alpha that does best on episodes which were left out. Leaving out single frames would choose one
    that learns episodes by heart, for their other frames remain.
    """
    phi = np.asarray(x[rest], np.float64)
    error = np.zeros((len(ALPHAS), target.shape[1]))
    inner = min(INNER_FOLDS, len(np.unique(episode)))
    for left_out in episode_folds(episode, inner, rng) if inner > 1 else ():
        kept = np.setdiff1d(np.arange(len(rest)), left_out)
        predicted = ridge_path(phi[kept], target[kept], phi[left_out])
        error += ((predicted - target[left_out]) ** 2).sum(axis=1)
    best = error.argmin(axis=0) if inner > 1 else np.full(target.shape[1], len(ALPHAS) - 1)
    return ridge_path(phi, target, np.asarray(x[test], np.float64))[best, :, np.arange(len(best))].T


def ridge_path(x: Floats, target: Floats, new: Floats) -> Floats:
    """Ridge's predictions [alphas, m, k] for ``new`` [m, d], fitted on ``x`` [n, d] and ``target`` [n, k]."""
    middle, mean = x.mean(axis=0), target.mean(axis=0)
    around = x - middle
    values, vectors = np.linalg.eigh(around.T @ around)
    projected = vectors.T @ (around.T @ (target - mean))
    weights = projected / (np.maximum(values, 0.0)[:, None] + ALPHAS[:, None, None])
    return ((new - middle) @ vectors) @ weights + mean


def predict_category(x: Any, rest: Any, test: Any, target: Floats) -> Floats:
    """Logistic regression's predictions [len(test), 1]; the only category that there is, if there is one alone."""
    if np.ptp(target) == 0:
        return np.full((len(test), 1), target[0, 0])
    model = LogisticRegression(C=INVERSE_PENALTY, max_iter=2000).fit(x[rest], target[:, 0])
    return np.asarray(model.predict(x[test]))[:, None]


def predict_mlp(x: NDArray[np.float32], pairs: Pairs, parts: Sequence[Ints], rng: np.random.Generator) -> Floats:
    """As :func:`predict_linear`, by one network of two hidden layers for all factors."""
    out = np.full(pairs.factors.shape, np.nan)
    for held_out in parts:
        rest = np.setdiff1d(np.arange(len(x)), held_out)
        out[held_out] = predict_fold(x, pairs, rest, held_out, torch_rng(rng))
    out[~np.isfinite(pairs.factors)] = np.nan
    return out


def predict_fold(x: NDArray[np.float32], pairs: Pairs, rest: Any, test: Any, rng: torch.Generator) -> Floats:
    """A network's predictions [len(test), k], trained on the rows ``rest``; nan for factors that are not there."""
    heads = [Head(pairs.factors[rest, k], column.is_category) for k, column in enumerate(pairs.columns)]
    size = sum(head.outputs for head in heads)
    network = Embedding(x.shape[1], WIDTH, size)  # its linear part makes it no worse than ridge
    draw_weights(network, rng)
    optimizer = torch.optim.AdamW(network.parameters(), LEARNING_RATE, weight_decay=DECAY)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, STEPS)
    seen = torch.from_numpy(x[rest])
    for _ in range(STEPS):
        rows = torch.randperm(len(seen), generator=rng)[:BATCH]
        predicted = network(seen[rows]).split([head.outputs for head in heads], 1)
        loss = sum((head.loss(part, rows) for head, part in zip(heads, predicted, strict=True)), torch.zeros(()))
        descend(optimizer, loss)
        schedule.step()
    with torch.no_grad():
        predicted = network(torch.from_numpy(x[test])).split([head.outputs for head in heads], 1)
    return np.stack([head.value(part) for head, part in zip(heads, predicted, strict=True)], axis=1)


class Head:
    """The outputs of a network for one factor, and their loss. ``z`` [n] is the factor in the training frames."""

    def __init__(self, z: Floats, is_category: bool) -> None:
        there = np.isfinite(z)
        self.is_category, self.known = is_category, there.any()
        self.there = torch.from_numpy(there)
        if is_category:
            self.classes = np.unique(z[there])
            self.target = torch.from_numpy(np.searchsorted(self.classes, np.where(there, z, -np.inf)))
            self.outputs = max(len(self.classes), 1)
        else:
            self.mean = float(z[there].mean()) if self.known else 0.0
            self.spread = (float(z[there].std()) if self.known else 0.0) or 1.0
            self.target = torch.from_numpy(np.where(there, (z - self.mean) / self.spread, 0.0).astype(np.float32))
            self.outputs = 1

    def loss(self, predicted: Tensor, rows: Tensor) -> Tensor:
        """Mean loss over the frames ``rows`` that have the factor, 0 if none has it."""
        there, target = self.there[rows], self.target[rows]
        if not there.any():
            return predicted.sum() * 0.0
        if self.is_category:
            return F.cross_entropy(predicted[there], target[there])
        return F.mse_loss(predicted[there, 0], target[there])

    def value(self, predicted: Tensor) -> Floats:
        """The prediction [n]: a number, or the likeliest category."""
        if not self.known:
            return np.full(len(predicted), np.nan)
        if self.is_category:
            return self.classes[predicted.argmax(1).numpy()].astype(np.float64)
        return predicted[:, 0].numpy().astype(np.float64) * self.spread + self.mean
