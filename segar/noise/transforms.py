"""Distributions made of another one by scaling and shifting."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from segar.errors import PriorError
from segar.noise.base import LAST_QUANTILE, Noise, set_fields
from segar.noise.checks import finite
from segar.noise.locations import Independent


@dataclass(frozen=True, repr=False)
class Affine(Noise):
    """The distribution of ``shift + scale * x``, where x follows ``law``, on the line or on the plane.

    ``scale`` is a number other than zero (on the plane: positive); ``shift`` is a number, or on the plane two.
    """

    law: Noise
    scale: float = 1.0
    shift: Any = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.law, Noise) or not self.law.width:
            raise PriorError(f"Affine needs a distribution on the line or on the plane, not {self.law!r}")
        finite(self, scale=self.scale)
        try:
            shift = np.broadcast_to(np.asarray(self.shift, dtype=float), (self.width,))
        except (TypeError, ValueError):
            shift = np.full(1, np.nan)
        if not np.isfinite(shift).all():
            raise PriorError(f"Affine: shift must be a finite number, or two on the plane, not {self.shift!r}")
        if not self.scale or (self.width == 2 and self.scale < 0):
            needed = "positive on the plane" if self.width == 2 else "other than zero"
            raise PriorError(f"Affine: scale must be {needed}, not {self.scale!r}")
        set_fields(self, scale=float(self.scale), shift=float(shift[0]) if self.width == 1 else tuple(shift.tolist()))

    @property
    def width(self) -> int:  # type: ignore[override]
        return self.law.width

    @property
    def period(self) -> float | None:
        return None if self.law.period is None else abs(self.scale) * self.law.period

    def sample(self, rng: Any, size: Any = None) -> Any:
        return self._there(np.asarray(self.law.sample(rng, size), dtype=float))[()]

    def cdf(self, x: Any) -> Any:
        if self._product is not None:
            return self._product.cdf(x)
        y = self._back(x)
        below = self.law.cdf(y)
        return (below if self.scale > 0 else 1.0 - below + self.law.pmf(y))[()]

    def pdf(self, x: Any) -> Any:
        if self._product is not None:
            return self._product.pdf(x)
        return self.law.pdf(self._back(x)) / abs(self.scale) ** self.width

    def pmf(self, x: Any) -> Any:
        if self._product is not None:
            return self._product.pmf(x)
        return self.law.pmf(self._back(x))

    def log_prob(self, x: Any) -> Any:
        if self._product is not None:
            return self._product.log_prob(x)
        y = self._back(x)
        return (self.law.log_prob(y) - np.where(self.law.pmf(y) > 0, 0.0, self._log_volume))[()]

    def icdf(self, q: Any) -> Any:
        if self.scale > 0:
            return self._there(self.law.icdf(q))[()]
        if len(self.law.atoms[0]):
            return super().icdf(q)  # where the cdf jumps, the quantile of 1 - q is the upper end of what reaches q
        q = np.asarray(q, dtype=float)
        return self._there(self.law.icdf(np.where(q > 0, np.minimum(1.0 - q, LAST_QUANTILE), 1.0 - q)))[()]

    @property
    def mean(self) -> Any:
        return self._there(self.law.mean)[()]

    @property
    def var(self) -> Any:
        return self.scale**2 * self.law.var

    @property
    def support(self) -> Any:
        ends = np.sort(np.asarray(self.law.support, dtype=float).T * self.scale, axis=0).T
        moved = ends + (self.shift if self.width == 1 else np.array(self.shift)[:, None])
        return tuple(map(tuple, moved.tolist())) if self.width == 2 else tuple(moved.tolist())

    @property
    def atoms(self) -> tuple[np.ndarray, np.ndarray]:
        values, masses = self.law.atoms
        if not len(values):
            return values, masses
        step = 1 if self.scale > 0 else -1
        return self._there(values)[::step], masses[::step]

    @property
    def pieces(self) -> np.ndarray:
        return np.sort(self._there(self.law.pieces))

    @cached_property
    def components(self) -> tuple[Noise, Noise] | None:  # type: ignore[override]
        if self.law.components is None:
            return None
        x, y = (Affine(part, self.scale, shift) for part, shift in zip(self.law.components, self.shift, strict=True))
        return x, y

    @property
    def grid(self) -> tuple[np.ndarray, np.ndarray]:
        x, y = self.law.grid
        return self.shift[0] + self.scale * x, self.shift[1] + self.scale * y

    def entropy(self) -> float:
        if self._product is not None:
            return self._product.entropy()
        return self.law.entropy() + (1.0 - float(self.law.atoms[1].sum())) * self._log_volume

    def _there(self, x: Any) -> np.ndarray:
        return np.asarray(self.shift + self.scale * np.asarray(x))

    def _back(self, x: Any) -> np.ndarray:
        """The point that ``x`` is the image of; rounding does not move it to, or past, an atom whose image is elsewhere."""
        x, sign = np.asarray(x, dtype=float), math.copysign(1.0, self.scale)
        y = (x - np.asarray(self.shift)) / self.scale
        values = self.law.atoms[0].reshape(-1, self.width)
        images = self._there(values)
        if self.width == 1:
            return _beside(x, y, values[:, 0], images[:, 0], sign)
        return np.stack([_beside(x[..., k], y[..., k], values[:, k], images[:, k], sign) for k in range(2)], axis=-1)

    @property
    def _log_volume(self) -> float:
        """By how much the logarithm of a length, or of an area, grows."""
        return self.width * math.log(abs(self.scale))

    @cached_property
    def _product(self) -> Noise | None:
        """On the plane, the same distribution as one of two independent components, None where they are not."""
        return None if self.components is None else Independent(*self.components)


def _beside(x: np.ndarray, y: np.ndarray, values: np.ndarray, images: np.ndarray, sign: float) -> np.ndarray:
    """``y``, moved by rounding at most, so that it lies among ``values`` as ``x`` among their ``images``."""
    there, first = np.unique(images, return_index=True)
    back, place = sign * values[first], np.searchsorted(there, x)
    behind, before = np.append(-np.inf, np.nextafter(back, np.inf)), np.append(np.nextafter(back, -np.inf), np.inf)
    between = np.clip(sign * y, behind[place], before[place])
    return sign * np.where(np.append(there, np.nan)[place] == x, np.append(back, np.nan)[place], between)
