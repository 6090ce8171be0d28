"""npz archives without pickle: arrays and a description in JSON, replaced only when complete."""

from __future__ import annotations

import json
import os
import uuid
import zipfile
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from segar.errors import SegarError


def write_archive(
    path: Path, arrays: Mapping[str, np.ndarray], metadata: Mapping[str, Any], what: str, error: type[SegarError]
) -> None:
    """Write arrays and description to ``path``, by way of a file beside it.

    Args:
        what: what the archive holds, for messages.

    Raises:
        error: the file cannot be written; what stood at ``path`` still stands there.
    """
    text = json.dumps(metadata, indent=1).encode()
    contents: dict[str, Any] = {**arrays, "metadata": np.frombuffer(text, dtype=np.uint8)}
    beside = path.with_name(f".{path.name}.{uuid.uuid4().hex[:12]}.tmp")
    try:
        with open(beside, "wb") as file:
            np.savez_compressed(file, **contents)
            file.flush()
            os.fsync(file.fileno())
        os.replace(beside, path)
    except OSError as said:
        beside.unlink(missing_ok=True)
        raise error(f"{what} cannot be written to {path}: {said.strerror or said}; nothing was changed") from said


def read_archive(
    path: Path, names: Iterable[str], what: str, error: type[SegarError]
) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """The arrays of these names, and the description.

    Raises:
        error: there is no such file, it is no archive of this kind, or it is incomplete.
    """
    if not path.exists():
        raise error(f"there is no {what} {path}")
    if not zipfile.is_zipfile(path):
        raise error(f"{path} is not a {what}, or only part of one")
    try:
        with np.load(path, allow_pickle=False) as archive:
            return {name: archive[name] for name in names}, json.loads(archive["metadata"].tobytes())
    except (zipfile.BadZipFile, zlib.error, KeyError, ValueError, EOFError, OSError) as said:
        raise error(f"{path} is not a {what}, or only part of one: {said}") from said
