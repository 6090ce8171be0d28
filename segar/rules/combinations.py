"""Which options of a rule space are active together, and with which probability: a table of all combinations."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from math import comb, prod

import numpy as np

from segar.errors import RuleError
from segar.noise import Noise

MOST_COMBINATIONS = 2**20  # that a table lists; 20 options, any number of them active


@dataclass(frozen=True, eq=False)
class Combinations:
    """All combinations that have a probability.

    Attributes:
        names: of the options.
        active: bool ``(combinations, options)``, each row once.
        probability: float64 ``(combinations,)``, positive; they sum to 1.
    """

    names: tuple[str, ...]
    active: np.ndarray
    probability: np.ndarray

    def __len__(self) -> int:
        return len(self.active)

    @cached_property
    def cumulative(self) -> np.ndarray:
        """float64 ``(combinations,)``, the last one 1."""
        found = np.cumsum(self.probability)
        found[-1] = 1.0
        return found

    @cached_property
    def activity(self) -> np.ndarray:
        """The probability that each option is active, float64 ``(options,)``."""
        return self.probability @ self.active

    @cached_property
    def together(self) -> np.ndarray:
        """Whether two options are active in one combination, bool ``(options, options)``."""
        numbers = self.active.astype(np.float64)
        return numbers.T @ numbers > 0

    def sample(self, uniform: np.ndarray) -> np.ndarray:
        """Rows of ``active`` for numbers in [0, 1), bool ``(n, options)``."""
        return self.active[np.searchsorted(self.cumulative, uniform, side="right")]

    def log_prob(self, active: np.ndarray) -> np.ndarray:
        """Log probability of each row, float64 ``(n,)``; -inf where it is not in the table."""
        known = {row: p for row, p in zip(_keys(self.active), np.log(self.probability), strict=True)}
        return np.array([known.get(row, -np.inf) for row in _keys(active)])

    def entropy(self) -> float:
        """In nats."""
        return float(-(self.probability * np.log(self.probability)).sum())

    def where(self, kept: np.ndarray) -> "Combinations":
        """Those combinations for which bool ``kept`` says so, with their probabilities given that one of them is drawn."""
        probability = self.probability[kept]
        return Combinations(self.names, self.active[kept], probability / probability.sum())

    def in_words(self, row: int) -> str:
        return ", ".join(name for name, is_active in zip(self.names, self.active[row], strict=True) if is_active)

    def fraction(self, seed: int) -> np.ndarray:
        """A number in [0, 1) for each combination, which depends on ``seed`` and the names of what is active alone."""
        return np.array([_fraction(seed, self.in_words(row)) for row in range(len(self))])


def make_combinations(
    names: Sequence[str], weights: Sequence[float], count: Noise, never: Callable[[tuple[int, ...]], bool]
) -> Combinations:
    """The combinations of as many options as ``count`` draws; given how many there are, a combination's probability is
    proportional to the product of its options' weights.

    Args:
        never: whether options with these places may not be active together.

    Raises:
        RuleError: ``count`` asks for more options than there are or can be together, or there are too many combinations.
    """
    sizes, masses = count.atoms
    needed = sum(comb(len(names), int(size)) for size in sizes)
    if needed > MOST_COMBINATIONS:
        raise RuleError(
            f"a rule space of {len(names)} options with up to {int(sizes.max())} of them active has {needed:,} combinations,"
            f" and can have {MOST_COMBINATIONS:,}; let fewer be active"
        )
    rows, probabilities = [], []
    for size, mass in zip(sizes.astype(int).tolist(), masses.tolist(), strict=True):
        chosen = [places for places in combinations(range(len(names)), size) if not never(places)]
        if not chosen:
            raise RuleError(
                f"no {size} of the {len(names)} options ({', '.join(names)}) can be active together; let fewer be active"
            )
        active = np.zeros((len(chosen), len(names)), dtype=bool)
        active[np.repeat(np.arange(len(chosen)), size), np.array(chosen, dtype=int).reshape(-1)] = True
        likelihood = np.array([prod(weights[k] for k in places) for places in chosen], dtype=float)
        rows.append(active)
        probabilities.append(mass * likelihood / likelihood.sum())
    return Combinations(tuple(names), np.concatenate(rows), np.concatenate(probabilities))


def _keys(active: np.ndarray) -> list[bytes]:
    return [row.tobytes() for row in np.packbits(active, axis=1)]


def _fraction(seed: int, text: str) -> float:
    digest = hashlib.blake2b(f"{seed}\x1f{text}".encode(), digest_size=7).digest()
    return int.from_bytes(digest, "little") / 2.0**56
