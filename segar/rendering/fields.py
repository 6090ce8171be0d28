"""Where charges would push: the field that the arrows of a picture follow."""

from collections.abc import Sequence

import numpy as np

from segar.rendering.scene import Figure

FAINT, STRONG = 0.3, 10.0  # [1/m^2] fields at which a hint begins to show, and at which it does not grow any more


def electric_field(sources: Sequence[Figure], points: np.ndarray) -> np.ndarray:
    """The sum of q r / |r|^3 over the sources: the force on a unit charge, as in :func:`segar.lorentz_law`.

    Args:
        points: float64 ``(n, 2)`` [m].

    Returns:
        float64 ``(n, 2)`` [1/m^2].
    """
    field = np.zeros_like(points)
    for source in sources:
        away = points - source.place
        distance = np.maximum(np.sqrt((away**2).sum(axis=1)), 1e-6)  # [m] nowhere infinite
        field += source.charge * away / distance[:, None] ** 3
    return field


def hint_strength(field: np.ndarray) -> np.ndarray:
    """How strongly to hint at a field, float64 ``(n,)`` from 0 to 1, by the logarithm of its length."""
    length = np.maximum(np.sqrt((field**2).sum(axis=1)), 1e-12)
    return np.clip(np.log(length / FAINT) / np.log(STRONG / FAINT), 0.0, 1.0)


def charge_sources(figures: Sequence[Figure]) -> list[Figure]:
    """The charges that hints are drawn for: all but the agent's, which feels the field."""
    return [f for f in figures if f.charge != 0 and not f.is_agent and f.is_alive and not f.is_done]
