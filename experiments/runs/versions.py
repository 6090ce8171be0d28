"""What a result was made with: Python, libraries, commit, and the levels."""

import dataclasses
import hashlib
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

import segar

LIBRARIES = (
    "segar", "torch", "torchrl", "tensordict", "numpy", "numba", "scipy", "gymnasium", "POT", "hydra-core", "mlflow-skinny",
)  # fmt: skip


def versions() -> dict[str, Any]:
    """Python, machine, libraries and the commit of the checkout."""
    return {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "libraries": {name: _version(name) for name in LIBRARIES},
        "git": git_commit(Path(segar.__file__).resolve().parent),
    }


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None  # a checkout on the path, or an extra that is not installed


def git_commit(folder: Path) -> dict[str, Any] | None:
    """Commit and whether tracked files differ from it; None outside of a checkout or without git."""
    try:
        commit = _git(folder, "rev-parse", "HEAD")
        changes = _git(folder, "status", "--porcelain", "--untracked-files=no")
    except (FileNotFoundError, subprocess.CalledProcessError):
        return None
    return {"commit": commit, "changed": bool(changes)}


def _git(folder: Path, *arguments: str) -> str:
    done = subprocess.run(["git", "-C", str(folder), *arguments], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def levels_hash(levels: Any) -> str:
    """Sixteen hexadecimal digits over all arrays of a level set (:class:`segar.Levels`)."""
    digest = hashlib.sha256()
    for field in dataclasses.fields(levels):
        array = getattr(levels, field.name)
        if isinstance(array, np.ndarray):
            digest.update(f"{field.name} {array.dtype} {array.shape}".encode())
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:16]
