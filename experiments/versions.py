"""What a result was made with: libraries, commit, and a fingerprint of the code that decides results."""

from __future__ import annotations

import ast
import dataclasses
import hashlib
import importlib.util
import platform
import subprocess
from collections.abc import Iterable
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

import segar

LIBRARIES = (
    "segar", "torch", "torchrl", "tensordict", "numpy", "numba", "scipy", "gymnasium", "POT", "hydra-core", "mlflow-skinny",
)  # fmt: skip
LEARNING_MODULES = ("experiments.networks", "experiments.learner")  # besides the learner's own


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


@cache
def code_fingerprint(learner: str) -> str:
    """Sixteen hexadecimal digits over the library, the networks and the module of ``learner`` (``module:Class``).

    Comments, docstrings and layout do not change it.
    """
    library = sorted(Path(segar.__file__).resolve().parent.rglob("*.py"))
    modules = [_source(name) for name in (*LEARNING_MODULES, learner.partition(":")[0])]
    return _fingerprint((*library, *modules))


def _source(module: str) -> Path:
    spec = importlib.util.find_spec(module)
    assert spec is not None and spec.origin is not None, f"{module} has no source file"
    return Path(spec.origin)


def _fingerprint(paths: Iterable[Path]) -> str:
    digest = hashlib.sha256()
    for path in paths:
        digest.update(path.name.encode())
        digest.update(ast.dump(_without_docstrings(ast.parse(path.read_bytes()))).encode())
    return digest.hexdigest()[:16]


def _without_docstrings(tree: ast.AST) -> ast.AST:
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0] if node.body else None
            if (
                isinstance(first, ast.Expr)
                and isinstance(first.value, ast.Constant)
                and isinstance(first.value.value, str)
            ):
                node.body = node.body[1:]
    return tree
