"""Mixtures: a draw comes from one of several distributions, by given probabilities."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from segar.errors import PriorError
from segar.noise.base import Noise, joined_atoms, set_fields
from segar.noise.checks import members, probabilities
from segar.noise.continuous import GaussianNoise


class MixtureNoise(Noise):
    """A draw from one of ``laws``, chosen by ``weights``; its sub-classes say which."""

    laws: tuple[Noise, ...]
    weights: tuple[float, ...]

    @property
    def width(self) -> int:  # type: ignore[override]
        return self.laws[0].width

    @property
    def period(self) -> float | None:
        return next((part.period for part in self.laws if part.period is not None), None)

    def sample(self, rng: Any, size: Any = None) -> Any:
        component = np.asarray(rng.choice(len(self.laws), size=size, p=self.weights))
        draws = np.stack([np.asarray(part.sample(rng, size), dtype=float) for part in self.laws])
        pick = component[None, ..., None] if self.width == 2 else component[None]
        return np.take_along_axis(draws, pick, axis=0)[0][()]

    def cdf(self, x: Any) -> Any:
        return sum(w * part.cdf(x) for part, w in self._parts)

    def pdf(self, x: Any) -> Any:
        return sum(w * part.pdf(x) for part, w in self._parts)

    def pmf(self, x: Any) -> Any:
        return sum(w * part.pmf(x) for part, w in self._parts)

    @property
    def mean(self) -> Any:
        return sum(w * part.mean for part, w in self._parts)

    @property
    def var(self) -> Any:
        return sum(w * (part.var + (part.mean - self.mean) ** 2) for part, w in self._parts)

    @property
    def support(self) -> Any:
        ends = np.array([part.support for part, _ in self._parts])
        low, high = ends[..., 0].min(axis=0), ends[..., 1].max(axis=0)
        return tuple(zip(low.tolist(), high.tolist(), strict=True)) if self.width == 2 else (float(low), float(high))

    @property
    def atoms(self) -> tuple[np.ndarray, np.ndarray]:
        values = np.concatenate([part.atoms[0] for part, _ in self._parts])
        masses = np.concatenate([w * part.atoms[1] for part, w in self._parts])
        return joined_atoms(values, masses)

    @property
    def pieces(self) -> np.ndarray:
        return np.unique(np.concatenate([part.pieces for part, _ in self._parts]))

    @property
    def grid(self) -> tuple[np.ndarray, np.ndarray]:
        grids = [part.grid for part, _ in self._parts]
        return np.unique(np.concatenate([x for x, _ in grids])), np.unique(np.concatenate([y for _, y in grids]))

    @cached_property
    def _parts(self) -> tuple[tuple[Noise, float], ...]:
        return tuple((part, w) for part, w in zip(self.laws, self.weights, strict=True) if w > 0)


@dataclass(frozen=True, repr=False)
class Mixture(MixtureNoise):
    """One of any ``laws`` (all on the line, or all on the plane), by ``weights`` (equal ones if None)."""

    laws: Sequence[Noise]  # type: ignore[assignment]
    weights: Sequence[float] | None = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        laws = members(self, "laws", self.laws)
        if not laws or not all(isinstance(part, Noise) for part in laws) or len({part.width for part in laws}) != 1:
            raise PriorError(f"Mixture needs distributions that are all on the line or all on the plane, not {laws!r}")
        if len({part.period for part in laws} - {None}) > 1:
            raise PriorError(f"Mixture needs distributions that live on one circle, not {laws!r}")
        set_fields(self, laws=laws, weights=probabilities(self, self.weights, len(laws)))


@dataclass(frozen=True, repr=False)
class GaussianMixtureNoise(MixtureNoise):
    """A mixture of Gaussians with ``means`` and standard deviations ``stds``, by ``pvals`` (equal ones if None).

    >>> segar.GaussianMixtureNoise(means=[-1.0, 1.0], stds=[0.1, 0.1]).mean
    0.0
    """

    means: Sequence[float]
    stds: Sequence[float]
    pvals: Sequence[float] | None = None

    def __post_init__(self) -> None:
        means, stds = members(self, "means", self.means), members(self, "stds", self.stds)
        if not means or len(means) != len(stds):
            raise PriorError(
                f"GaussianMixtureNoise: {len(means)} means and {len(stds)} stds; give one of each per part"
            )
        pvals = probabilities(self, self.pvals, len(means))
        laws = tuple(GaussianNoise(m, s) for m, s in zip(means, stds, strict=True))
        set_fields(
            self,
            means=tuple(part.loc for part in laws),
            stds=tuple(part.std for part in laws),
            pvals=pvals,
            laws=laws,
            weights=pvals,
        )

    def sample(self, rng: Any, size: Any = None) -> Any:
        component = rng.choice(len(self.means), size=size, p=self.pvals)
        return np.asarray(self.means)[component] + np.asarray(self.stds)[component] * rng.standard_normal(size)
