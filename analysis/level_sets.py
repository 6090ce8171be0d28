"""Which runs were trained on the same levels, by what is in their level files.

Levels of a file, and of a distribution of the user's own, can be few. Another seed then gives the same levels again, in
another order, or some of them. Such level sets are not independent. Levels of named families are never drawn twice.
"""

import hashlib
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from itertools import permutations
from pathlib import Path

import numpy as np
import pandas as pd

from experiments.runs.run_folder import LEVELS_TRAIN
from experiments.settings import RunFolderError

CONTENT = ("types", "values", "shape_kind", "vertex_count", "parameters")  # of a level, in its file


def levels_trained_on(runs: pd.DataFrame) -> list[frozenset[bytes]]:
    """The fingerprints of the training levels of each run, from its level file.

    Empty where there is no such file, the table has no column ``folder``, or the levels are those of a named family.
    """
    name = next((one for one in ("levels.train", "family") if one in runs), None)
    if "folder" not in runs or name is None:
        return [frozenset()] * len(runs)
    return [
        _in_file(Path(folder) / LEVELS_TRAIN) if ":" in str(train) or ".npz" in str(train) else frozenset()
        for folder, train in zip(runs["folder"], runs[name], strict=True)
    ]


def united(names: Iterable[str], levels: Sequence[frozenset[bytes]]) -> dict[str, frozenset[bytes]]:
    """All levels of each level set: those of the runs with its name."""
    found: dict[str, frozenset[bytes]] = {}
    for name, one in zip(names, levels, strict=True):
        found[name] = found.get(name, frozenset()) | one
    return found


def first_of_equal(sets: Mapping[str, frozenset[bytes]], among: Mapping[str, str]) -> dict[str, str]:
    """For each level set the first one with the same levels, of those that ``among`` gives one value."""
    first: dict[tuple[str, frozenset[bytes]], str] = {}
    return {name: first.setdefault((among[name], levels), name) if levels else name for name, levels in sets.items()}


def largest_share(sets: Mapping[str, frozenset[bytes]], among: Mapping[str, str]) -> float:
    """The largest share of a level set that lies in another one with other levels; of those that ``among`` gives one value."""
    there = [(among[name], levels) for name, levels in sets.items() if levels]
    return max((len(a & b) / len(a) for (x, a), (y, b) in permutations(there, 2) if x == y and a != b), default=0.0)


def _in_file(path: Path) -> frozenset[bytes]:
    if not path.exists():
        return frozenset()
    about = path.stat()
    return _fingerprints(path, about.st_mtime_ns, about.st_size)


@cache
def _fingerprints(path: Path, _time: int, _size: int) -> frozenset[bytes]:
    # Levels.load would need the entity types, which the user's modules define.
    try:
        with np.load(path) as arrays:
            corners = np.arange(arrays["vertices"].shape[2]) < arrays["vertex_count"][..., None]
            parts = [*(arrays[name] for name in CONTENT), np.where(corners[..., None], arrays["vertices"], 0.0)]
    except (OSError, ValueError, KeyError, IndexError, zipfile.BadZipFile) as error:
        raise RunFolderError(f"cannot read the levels in {path}: {error}") from error
    rows = (b"|".join(part[k].tobytes().rstrip(b"\0") for part in parts) for k in range(len(parts[0])))
    return frozenset(hashlib.sha256(row).digest() for row in rows)
