"""Distributions on the plane: Gaussians, products of two distributions on the line, and the twelve location priors.

Locations keep a margin of 0.05 to the walls of the arena [-1, 1]^2; "quarter" boxes reach from the margin half of the
way to the centre (the 2022 constants).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from segar.errors import PriorError
from segar.noise.base import Noise, set_fields, shape_of
from segar.noise.checks import interval, points
from segar.noise.continuous import GaussianNoise, UniformNoise
from segar.noise.discrete import Deterministic
from segar.noise.mixture import MixtureNoise

LOW, HIGH = -0.95, 0.95  # [m] where centres may start
QUARTER = 0.475  # [m] half of the way from the centre to HIGH
RIM_LINES = (LOW, -QUARTER, 0.0, QUARTER)  # where the cells of the 4 x 4 grid begin
GRID_QUANTILES = np.linspace(0.0, 1.0, 66)[1:-1]


class PlaneNoise(Noise):
    """A distribution on the plane with ``components``, the distributions of x and of y, which are independent."""

    width: ClassVar[int] = 2
    components: tuple[Noise, Noise]  # type: ignore[assignment]

    def sample(self, rng: Any, size: Any = None) -> Any:
        return np.stack([np.asarray(part.sample(rng, size), dtype=float) for part in self.components], axis=-1)

    def cdf(self, x: Any) -> Any:
        return self._each("cdf", x).prod(axis=-1)[()]

    def pdf(self, x: Any) -> Any:
        """Density of the distribution with respect to area; zero where a component is an atom."""
        return self._each("pdf", x).prod(axis=-1)[()]

    def pmf(self, x: Any) -> Any:
        return self._each("pmf", x).prod(axis=-1)[()]

    def log_prob(self, x: Any) -> Any:
        """Sum of the components' log probabilities, each that of an atom or of a density."""
        return self._each("log_prob", x).sum(axis=-1)[()]

    @property
    def mean(self) -> np.ndarray:
        return np.array([part.mean for part in self.components])

    @property
    def var(self) -> np.ndarray:
        return np.array([part.var for part in self.components])

    @property
    def support(self) -> tuple[tuple[float, float], tuple[float, float]]:
        return self.components[0].support, self.components[1].support

    @property
    def atoms(self) -> tuple[np.ndarray, np.ndarray]:
        (x, mass), (y, weight) = (part.atoms for part in self.components)
        values = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        return values, np.outer(mass, weight).ravel()

    @property
    def grid(self) -> tuple[np.ndarray, np.ndarray]:
        x, y = (np.unique(np.append(part.pieces, part.icdf(GRID_QUANTILES))) for part in self.components)
        return x, y

    def entropy(self) -> float:
        return sum(part.entropy() for part in self.components)

    def _each(self, what: str, x: Any) -> np.ndarray:
        x = points(self, x)
        return np.stack([getattr(part, what)(x[..., i]) for i, part in enumerate(self.components)], axis=-1)


@dataclass(frozen=True, repr=False)
class Independent(PlaneNoise):
    """A point whose ``x`` and ``y`` are drawn independently, each from its own distribution, or are constants.

    >>> on_a_line = segar.noise.Independent(segar.UniformNoise(-0.5, 0.5), 0.25)
    >>> float(on_a_line.sample(np.random.default_rng(0))[1])
    0.25
    """

    x: Any
    y: Any

    def __post_init__(self) -> None:
        for name in ("x", "y"):
            part = getattr(self, name)
            part = part if isinstance(part, Noise) else Deterministic(part)
            if part.width != 1:
                raise PriorError(f"Independent: {name} must be a distribution on the line or a number, not {part!r}")
            object.__setattr__(self, name, part)

    @property
    def components(self) -> tuple[Noise, Noise]:  # type: ignore[override]
        return self.x, self.y


@dataclass(frozen=True, init=False, repr=False)
class GaussianNoise2D(PlaneNoise):
    """Gaussian on the plane with ``mean``, and standard deviations ``std`` (one, or two) of independent components.

    ``clip=(low, high)`` moves each component outside to the end. ``loc`` is the parameter ``mean``; the property ``mean`` is
    the mean of the distribution, clipping included. ``cov`` is the covariance matrix.
    """

    loc: tuple[float, float]
    cov: tuple[tuple[float, float], tuple[float, float]]
    clip: tuple[float, float] | None

    def __init__(self, mean: Any = (0.0, 0.0), std: Any = 0.1, clip: Any = None) -> None:
        try:
            loc, spread = (np.broadcast_to(np.asarray(given, dtype=float), (2,)) for given in (mean, std))
        except (TypeError, ValueError):
            raise PriorError(f"GaussianNoise2D: mean and std are one number or two; not {mean!r}, {std!r}") from None
        if not (np.isfinite(loc).all() and np.isfinite(spread).all() and (spread > 0).all()):
            raise PriorError(f"GaussianNoise2D: mean must be finite, std positive and finite: {mean}, {std}")
        set_fields(
            self,
            loc=tuple(loc.tolist()),
            cov=tuple(map(tuple, np.diag(spread**2).tolist())),
            clip=None if clip is None else interval(self, "clip", clip),
        )

    @cached_property
    def components(self) -> tuple[Noise, Noise]:  # type: ignore[override]
        x, y = (GaussianNoise(self.loc[i], math.sqrt(self.cov[i][i]), self.clip) for i in range(2))
        return x, y

    def sample(self, rng: Any, size: Any = None) -> Any:
        x = np.asarray(self.loc) + rng.standard_normal((*shape_of(size), 2)) * np.sqrt(np.diag(self.cov))
        return x if self.clip is None else np.clip(x, *self.clip)


@dataclass(frozen=True, repr=False)
class BoxLocation(PlaneNoise):
    """Uniform in the box ``x_range`` x ``y_range`` (metres); the named locations below are such boxes."""

    x_range: ClassVar[tuple[float, float]]
    y_range: ClassVar[tuple[float, float]]

    @cached_property
    def components(self) -> tuple[Noise, Noise]:  # type: ignore[override]
        return UniformNoise(*self.x_range), UniformNoise(*self.y_range)


class RandomUniformLocation(BoxLocation):
    """Uniform in the box [-0.95, 0.95] x [-0.95, 0.95] [m]: the arena, less its margin of 0.05 m."""

    x_range = y_range = (LOW, HIGH)


class RandomMiddleLocation(BoxLocation):
    """Uniform in the box [-0.475, 0.475] x [-0.475, 0.475] [m]: the middle of the arena."""

    x_range = y_range = (-QUARTER, QUARTER)


class RandomTopLocation(BoxLocation):
    """Uniform in the box [-0.95, 0.95] x [0.475, 0.95] [m]: the top of the arena."""

    x_range, y_range = (LOW, HIGH), (QUARTER, HIGH)


class RandomBottomLocation(BoxLocation):
    """Uniform in the box [-0.95, 0.95] x [-0.95, -0.475] [m]: the bottom of the arena."""

    x_range, y_range = (LOW, HIGH), (LOW, -QUARTER)


class RandomLeftLocation(BoxLocation):
    """Uniform in the box [-0.95, -0.475] x [-0.95, 0.95] [m]: the left side of the arena."""

    x_range, y_range = (LOW, -QUARTER), (LOW, HIGH)


class RandomRightLocation(BoxLocation):
    """Uniform in the box [0.475, 0.95] x [-0.95, 0.95] [m]: the right side of the arena."""

    x_range, y_range = (QUARTER, HIGH), (LOW, HIGH)


class RandomTopRightLocation(BoxLocation):
    """Uniform in the box [0.475, 0.95] x [0.475, 0.95] [m]: the upper right corner of the arena."""

    x_range, y_range = (QUARTER, HIGH), (QUARTER, HIGH)


class RandomTopLeftLocation(BoxLocation):
    """Uniform in the box [-0.95, -0.475] x [0.475, 0.95] [m]: the upper left corner of the arena."""

    x_range, y_range = (LOW, -QUARTER), (QUARTER, HIGH)


class RandomBottomRightLocation(BoxLocation):
    """Uniform in the box [0.475, 0.95] x [-0.95, -0.475] [m]: the lower right corner of the arena."""

    x_range, y_range = (QUARTER, HIGH), (LOW, -QUARTER)


class RandomBottomLeftLocation(BoxLocation):
    """Uniform in the box [-0.95, -0.475] x [-0.95, -0.475] [m]: the lower left corner of the arena."""

    x_range, y_range = (LOW, -QUARTER), (LOW, -QUARTER)


@dataclass(frozen=True, repr=False)
class CenterLocation(PlaneNoise):
    """The centre of the arena, (0, 0)."""

    components = Deterministic(0.0), Deterministic(0.0)


@dataclass(frozen=True, repr=False)
class RandomEdgeLocation(MixtureNoise):
    """Uniform in the box [-0.95, 0.95] x [-0.95, 0.95] [m] outside [-0.475, 0.475] x [-0.475, 0.475]: the 12 outer cells of a
    4 x 4 grid.

    >>> places = segar.RandomEdgeLocation().sample(np.random.default_rng(0), 100)
    >>> bool((np.abs(places).max(axis=1) >= 0.475).all())
    True
    """

    weights: ClassVar[tuple[float, ...]] = (1.0 / 12,) * 12

    def sample(self, rng: Any, size: Any = None) -> Any:
        corner = np.asarray(_rim_corners())[rng.integers(12, size=size)]
        return corner + QUARTER * rng.random((*shape_of(size), 2))

    @cached_property
    def laws(self) -> tuple[Noise, ...]:  # type: ignore[override]
        return tuple(Independent(UniformNoise(x, x + QUARTER), UniformNoise(y, y + QUARTER)) for x, y in _rim_corners())

    @property
    def grid(self) -> tuple[np.ndarray, np.ndarray]:
        lines = np.array([*RIM_LINES, HIGH])
        return lines, lines


def _rim_corners() -> Sequence[tuple[float, float]]:
    """Lower left corners of the 12 outer cells."""
    outer = (LOW, QUARTER)
    return [(x, y) for x in RIM_LINES for y in RIM_LINES if x in outer or y in outer]
