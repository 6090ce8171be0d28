"""Which runs were trained on the same levels, by what is in their level files.

Levels of a file are drawn without repetition, and can be few. Another seed then gives the same levels again, in another
order, or some of them. Such level sets are not independent. A distribution of the user's own may give the same levels for
all seeds, too. Named families draw each level independently.
"""

from collections.abc import Iterable, Mapping
from itertools import permutations
from pathlib import Path

import pandas as pd

from segar.experiments.runs.level_prints import is_own, prints_in, share_of
from segar.experiments.runs.run_folder import LEVELS_TRAIN
from segar.experiments.settings import is_level_file


def levels_of(names: Iterable[int], runs: pd.DataFrame, of_files: bool = False) -> dict[int, frozenset[bytes]]:
    """The fingerprints of the training levels of each level set, from the level files of the runs with its name.

    Empty where there is no such file, the table has no column ``folder``, or the levels are those of a named family.

    Args:
        names: of the level sets, one for each run.
        of_files: only of runs whose levels were drawn from a file.
    """
    found, counts = dict.fromkeys(names, frozenset[bytes]()), is_level_file if of_files else is_own
    trained = next((runs[one] for one in ("levels.train", "family") if one in runs), None)
    if "folder" in runs and trained is not None:
        for name, folder, train in zip(names, runs["folder"], map(str, trained), strict=True):
            if counts(train):
                found[name] |= prints_in(Path(folder) / LEVELS_TRAIN)
    return found


def first_of_equal(sets: Mapping[int, frozenset[bytes]], among: Mapping[int, int]) -> dict[int, int]:
    """For each level set the first one with the same levels, of those that ``among`` gives one value."""
    first: dict[tuple[int, frozenset[bytes]], int] = {}
    return {name: first.setdefault((among[name], levels), name) if levels else name for name, levels in sets.items()}


def largest_share(sets: Mapping[int, frozenset[bytes]], among: Mapping[int, int]) -> float:
    """The largest share of a level set that lies in another one with other levels; of those that ``among`` gives one value."""
    there = [(among[name], levels) for name, levels in sets.items() if levels]
    return max((share_of(a, b) for (x, a), (y, b) in permutations(there, 2) if x == y and a != b), default=0.0)
