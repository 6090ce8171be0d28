"""Levels of which every tenth is hard: the goal lies anywhere, and in all others at the top right."""

import dataclasses

import numpy as np

from segar.levels import LEVEL_ARRAYS, Levels, family

EVERY = 10


class RareHard:
    """A distribution of the user's own, whose level i is hard where i is a multiple of ``EVERY``."""

    def sample(self, n: int, seed: int = 0, split: str = "train", start: int = 0) -> Levels:
        easy, hard = (
            family(name).sample(n, seed=seed, split=split, start=start) for name in ("empty-easy", "empty-hard")
        )
        is_hard = hard.provenance.indices % EVERY == 0
        arrays = {}
        for name in LEVEL_ARRAYS:
            ours, theirs = getattr(easy, name), getattr(hard, name)
            arrays[name] = np.where(is_hard.reshape(-1, *(1,) * (ours.ndim - 1)), theirs, ours)
        origin = dataclasses.replace(hard.provenance, distribution="rare-hard")
        return dataclasses.replace(hard, **arrays, provenance=origin)


rare_hard = RareHard()
