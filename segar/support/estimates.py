"""A number with a bound or a standard error."""

from typing import NamedTuple


class Estimate(NamedTuple):
    """A ``value`` and its ``error``: a bound for what is integrated, a standard error for what is drawn; 0 if exact."""

    value: float
    error: float = 0.0

    def __str__(self) -> str:
        return f"{self.value:.4g}" if not self.error else f"{self.value:.4g} +- {self.error:.1g}"
