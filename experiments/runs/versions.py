"""What a result was made with: libraries, commit, and a fingerprint of the code that decides results."""

from __future__ import annotations

import ast
import dataclasses
import hashlib
import importlib.util
import platform
import subprocess
from collections.abc import Iterable, Iterator, Set
from functools import cache
from importlib.machinery import PathFinder
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

import segar

LIBRARIES = (
    "segar", "torch", "torchrl", "tensordict", "numpy", "numba", "scipy", "gymnasium", "POT", "hydra-core", "mlflow-skinny",
)  # fmt: skip
NOT_LEARNING = "experiments.settings"  # a run's identity has the settings; the room also holds messages


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
    """Sixteen hexadecimal digits over the library with the textures that it ships, and over the module of ``learner``
    (``module:Class``) and what it imports of its own package and of ``experiments``.

    Comments, docstrings and layout do not change it.
    """
    folder = Path(segar.__file__).resolve().parent
    library = [*sorted(folder.rglob("*.py")), *sorted(folder.rglob("*.npz"))]
    return _fingerprint((*library, *(path for _, path in sorted(learning_modules(learner.partition(":")[0]).items()))))


@cache
def package_fingerprint(module: str) -> str:
    """Sixteen hexadecimal digits over ``module`` and what it imports of its own package, in the same way."""
    found = modules_reached(module, {module.partition(".")[0]})
    return _fingerprint(path for _, path in sorted(found.items()))


def learning_modules(module: str) -> dict[str, Path]:
    """Name and file of ``module`` and of all modules that it imports, of its own package and of ``experiments``."""
    return modules_reached(module, {module.partition(".")[0], "experiments"} - {"segar"})


def modules_reached(module: str, packages: Set[str]) -> dict[str, Path]:
    """Name and file of ``module`` and of all modules of ``packages`` that it imports; none of them is imported here."""
    found: dict[str, Path] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        path = _source(name) if name not in found and not is_in(name, NOT_LEARNING) else None
        if path is None:
            continue
        found[name] = path
        waiting += [other for other in _imports(name, path) if other.partition(".")[0] in packages]
    return found


def is_in(module: str, package: str) -> bool:
    """Whether a module is the package or lies in it."""
    return module == package or module.startswith(f"{package}.")


def _source(module: str) -> Path | None:
    """The file of a module; None where the name is that of something in a module, or a package without code."""
    top, *rest = module.split(".")
    spec = importlib.util.find_spec(top)
    for name in rest:
        if spec is None or spec.submodule_search_locations is None:
            return None
        # Of a dotted name, importlib.util.find_spec would import what stands before the last dot.
        spec = PathFinder.find_spec(f"{spec.name}.{name}", spec.submodule_search_locations)
    return Path(spec.origin) if spec is not None and spec.origin is not None else None


def _imports(module: str, path: Path) -> Iterator[str]:
    """Absolute names of what a module imports, at its top or within; of ``from a import b`` both ``a`` and ``a.b``."""
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = ".".join(package.split(".")[: len(package.split(".")) + 1 - node.level]) if node.level else ""
            source = ".".join(part for part in (above, node.module) if part)
            yield from (source, *(f"{source}.{alias.name}" for alias in node.names))


def _fingerprint(paths: Iterable[Path]) -> str:
    digest = hashlib.sha256()
    for path in paths:
        digest.update(path.name.encode())
        content = path.read_bytes()
        is_code = path.suffix == ".py"
        digest.update(ast.dump(_without_docstrings(ast.parse(content))).encode() if is_code else content)
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
