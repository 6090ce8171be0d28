"""The rooms, in the order of the tables in CONTRIBUTING.md, and every import of every file."""

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from tests.places import ROOT, sources

PACKAGES = ("segar", "experiments", "analysis")  # folders; the latter two are links in the first
LINKED = ("segar.experiments", "segar.analysis")
ROWS = re.findall(r"^\| (`(?:segar|experiments|analysis)/.*?`) \|", (ROOT / "CONTRIBUTING.md").read_text(), re.M)
"""The tables of rooms. From the top to the bottom: a room imports only from rooms that stand before it."""
ROOMS = [room for row in ROWS for room in re.findall(r"`([\w./]+)`", row)]
TOPS = {"segar": ("segar", "segar.__main__"), "experiments": ("segar.experiments",), "analysis": ("segar.analysis",)}


@dataclass(frozen=True)
class Import:
    """One name that a file imports, at its top or inside a function."""

    importer: str  # module
    target: str  # module
    name: str  # what is taken from it; empty where the module itself is imported
    place: str  # file and line


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    parts = parts if parts[0] == "segar" else ("segar", *parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for package in PACKAGES for path in sources(package)}
ORDER = [
    room
    for package, top in TOPS.items()
    for room in (*(module_name(ROOT / room) for room in ROOMS if room.startswith(f"{package}/")), *top)
]


@cache
def room_of(module: str) -> str:
    parts = module.split(".")
    return next(room for k in (3, 2, 1) if (room := ".".join(parts[:k])) in ORDER)


def imports_of(module: str, path: Path) -> Iterator[Import]:
    """Every import in a file, those inside functions and those by a name in a string included."""
    kinds = (ast.Import, ast.ImportFrom, ast.Call)
    for node in (one for one in ast.walk(ast.parse(path.read_text())) if isinstance(one, kinds)):
        place = f"{path.relative_to(ROOT).as_posix()}:{node.lineno}"
        match node:
            case ast.Import(names=names):
                yield from (Import(module, alias.name, "", place) for alias in names)
            case ast.ImportFrom(names=names, level=level):
                source = f"{module}.{node.module or ''}".rstrip(".") if level else str(node.module)
                for alias in names:
                    inner = f"{source}.{alias.name}"
                    found = (inner, "") if inner in MODULES else (source, alias.name)
                    yield Import(module, *found, place)
            case ast.Call(
                func=ast.Attribute(attr="import_module") | ast.Name(id="import_module" | "__import__"),
                args=[ast.Constant(value=str(name)), *_],
            ):
                yield Import(module, name, "", place)


@cache
def all_imports() -> list[Import]:
    return [
        found
        for module, path in MODULES.items()
        for file in (path, path.with_suffix(".pyi"))
        if file.exists()
        for found in imports_of(module, file)
    ]
