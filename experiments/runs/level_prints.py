"""Fingerprints of single levels, by which one sees whether two level sets hold the same levels, in whatever order."""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from segar.experiments.settings import RunFolderError, is_level_file
from segar.levels import Levels
from segar.support import Form, open_npz

CONTENT = ("types", "values", "shape_kind", "vertex_count", "parameters")  # of a level, beside the corners of hulls


def is_own(name: str) -> bool:
    """Whether a distribution is the user's own or a level file, and no named family."""
    return ":" in name or is_level_file(name)


def prints_of(levels: Levels) -> frozenset[bytes]:
    """A fingerprint of each level; equal levels of equal layouts have equal ones."""
    return _prints({name: getattr(levels, name) for name in (*CONTENT, "vertices")})


def prints_in(path: Path) -> frozenset[bytes]:
    """:func:`prints_of` of the levels in a file; empty where there is none. Raises :class:`RunFolderError` if it is damaged."""
    if not path.exists():
        return frozenset()
    # Levels.load would need the entity types, which the user's modules define.
    forms = {name: Form(None, ("n", ...)) for name in CONTENT}
    forms |= {"vertices": Form(None, ("n", "E", "V", 2)), "vertex_count": Form(None, ("n", "E"))}
    with open_npz(path, "level file", RunFolderError) as npz:
        return _prints(npz.read(forms))


def share_of(some: frozenset[bytes], others: frozenset[bytes]) -> float:
    """The share of some levels that are among others, 0 to 1; 0 of none."""
    return len(some & others) / len(some) if some else 0.0


def _prints(arrays: Mapping[str, Any]) -> frozenset[bytes]:
    corners = np.arange(arrays["vertices"].shape[2]) < arrays["vertex_count"][..., None]
    parts = [*(arrays[name] for name in CONTENT), np.where(corners[..., None], arrays["vertices"], 0.0)]
    rows = (b"|".join(part[k].tobytes().rstrip(b"\0") for part in parts) for k in range(len(parts[0])))
    return frozenset(hashlib.sha256(row).digest() for row in rows)
