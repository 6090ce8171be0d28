"""Counter-based random numbers: a draw depends on its key and its level alone, never on other draws.

:class:`LevelGenerator` offers the methods of ``numpy.random.Generator`` that distributions use, but its arrays have the
level on their first axis, and row k comes from the counter (level k, block, attempt) under a 64-bit key. So level i is
the same whether it is drawn alone or among 100,000 others. The bits are Philox4x32-10 (Salmon et al. 2011, "Parallel
random numbers: as easy as 1, 2, 3").
"""

import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy

from segar.errors import PriorError

ROUNDS = 10  # of Philox; 7 already pass BigCrush
MULTIPLIERS = (np.uint64(0xD2511F53), np.uint64(0xCD9E8D57))  # Philox4x32 (Salmon et al., table 2)
WEYL = (0x9E3779B9, 0xBB67AE85)  # added to the key words at each round
LOW_WORD = np.uint64(0xFFFFFFFF)
WORD = np.uint64(32)
SPARE_BITS = np.uint64(11)  # a float64 takes 53 of 64 bits
SPACING = 2.0**-53


def stream_key(*parts: Any) -> int:
    """A 64-bit key from texts and whole numbers, the same on every machine."""
    digest = hashlib.blake2b("\x1f".join(str(part) for part in parts).encode(), digest_size=8).digest()
    return int.from_bytes(digest, "little")


def philox(counter: Sequence[np.ndarray], key: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Philox4x32-10: four random 32-bit words for each counter.

    Args:
        counter: four uint64 arrays that broadcast, each holding 32-bit words.
        key: 64 bits.

    Returns:
        Four uint64 arrays of 32-bit words.
    """
    c0, c1, c2, c3 = counter
    k0, k1 = key & 0xFFFFFFFF, key >> 32
    for _ in range(ROUNDS):
        a, b = c0 * MULTIPLIERS[0], c2 * MULTIPLIERS[1]
        c0, c1, c2, c3 = (
            (b >> WORD) ^ c1 ^ np.uint64(k0),
            b & LOW_WORD,
            (a >> WORD) ^ c3 ^ np.uint64(k1),
            a & LOW_WORD,
        )
        k0, k1 = (k0 + WEYL[0]) & 0xFFFFFFFF, (k1 + WEYL[1]) & 0xFFFFFFFF
    return c0, c1, c2, c3


class LevelGenerator:
    """Random arrays whose first axis is the level.

    Args:
        key: names the stream: distribution, seed, split and what is drawn (:func:`stream_key`).
        levels: int ``(n,)``, index of each level in its split.
        attempt: which try this is; another attempt is an independent stream.

    ``size`` of each method is the number of levels, or a shape that begins with it; None means one value per level.
    Successive calls continue the stream.
    """

    def __init__(self, key: int, levels: np.ndarray, attempt: int = 0) -> None:
        self._key = key
        self._levels = np.asarray(levels).astype(np.uint64)[:, None]
        self._attempt = np.array(attempt, dtype=np.uint64)
        self._next_block = 0

    def random(self, size: Any = None) -> np.ndarray:
        """Uniform on [0, 1)."""
        return (self._bits(size) >> SPARE_BITS) * SPACING

    def uniform(self, low: Any = 0.0, high: Any = 1.0, size: Any = None) -> np.ndarray:
        """Uniform on [low, high)."""
        return low + (np.asarray(high) - low) * self.random(size)

    def standard_normal(self, size: Any = None) -> np.ndarray:
        """Gaussian with mean 0 and standard deviation 1, by inversion."""
        return scipy.special.ndtri(((self._bits(size) >> SPARE_BITS) + 0.5) * SPACING)

    def normal(self, loc: Any = 0.0, scale: Any = 1.0, size: Any = None) -> np.ndarray:
        """Gaussian with mean ``loc`` and standard deviation ``scale``."""
        return loc + scale * self.standard_normal(size)

    def integers(self, low: int, high: int | None = None, size: Any = None, endpoint: bool = False) -> np.ndarray:
        """Uniform whole numbers from [low, high), or from [0, low) if ``high`` is None; int64."""
        if high is None:
            low, high = 0, low
        count = high - low + bool(endpoint)
        if count < 1:
            raise PriorError(f"integers: no whole number lies between {low} and {high}")
        return low + (self.random(size) * count).astype(np.int64)

    def choice(self, a: Any, size: Any = None, p: Any = None) -> np.ndarray:
        """Members of ``a`` (or of ``range(a)``), with replacement, by the probabilities ``p``."""
        members = np.arange(a) if isinstance(a, (int, np.integer)) else np.asarray(a)
        if p is None:
            return members[self.integers(len(members), size=size)]
        edges = np.cumsum(np.asarray(p, dtype=float))[:-1]
        return members[np.searchsorted(edges, self.random(size), side="right")]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        raise PriorError(
            f"level randomness has no method '{name}'; it offers random, uniform, standard_normal, normal, integers"
            " and choice. Other distributions: invert their cdf, distribution.icdf(rng.random(size))"
        )

    def _bits(self, size: Any) -> np.ndarray:
        """uint64 of shape ``size``: the next ones of every level's stream."""
        n = len(self._levels)
        shape = (n,) if size is None else (int(size),) if isinstance(size, (int, np.integer)) else tuple(size)
        if not shape or shape[0] != n:
            raise PriorError(f"this generator draws for {n} levels: size must be {n} or ({n}, ...), not {size!r}")
        count = int(np.prod(shape[1:], dtype=np.int64))
        blocks = -(-count // 2)  # a block holds two doubles
        block = np.arange(self._next_block, self._next_block + blocks, dtype=np.uint64)[None, :]
        self._next_block += blocks
        counter = (self._levels & LOW_WORD, self._levels >> WORD, block, self._attempt)
        words = philox(counter, self._key)
        first = np.broadcast_to((words[0] << WORD) | words[1], (n, blocks))
        if count == 1:
            return first[:, 0].reshape(shape)
        second = (words[2] << WORD) | words[3]
        return np.stack([first, second], axis=-1).reshape(n, 2 * blocks)[:, :count].reshape(shape)
