"""Randomness inside rules: drawn anew in every sub-step, from a generator that is keyed, not seeded.

A draw depends only on (seed, level, episode, sub-step, rule, entities, number of the draw), so a run repeats bit for
bit whatever the batch size or the number of threads.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from segar.errors import RuleError
from segar.language.values import cos, log, sqrt

_source: ContextVar[Callable[[], Any] | None] = ContextVar("source", default=None)
"""Supplies the uniform draws of the tracer or interpreter in this thread."""
TINY = 2.0**-54  # keeps log() finite; half the spacing of the 53-bit uniforms


@contextmanager
def drawing_from(source: Callable[[], Any]) -> Iterator[None]:
    """A context in which rules draw their uniform numbers in [0, 1) from ``source``."""
    before = _source.set(source)
    try:
        yield
    finally:
        _source.reset(before)


def uniform(low: Any = 0.0, high: Any = 1.0) -> Any:
    """A number uniform in [low, high)."""
    draw = _source.get()
    if draw is None:
        raise RuleError("segar.random draws only inside a rule that the simulator runs")
    return low + (high - low) * draw()


def normal(mean: Any = 0.0, std: Any = 1.0) -> Any:
    """A Gaussian number, by the Box-Muller transform of two uniform ones."""
    radius = sqrt(-2.0 * log(uniform() + TINY))
    return mean + std * (radius * cos(2.0 * math.pi * uniform()))


def bernoulli(p: Any = 0.5) -> Any:
    """True with probability ``p``."""
    return uniform() < p
