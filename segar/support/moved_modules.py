"""Modules under the names that they had in an earlier version: importing one warns, and gives the module of today."""

import sys
import warnings
from collections.abc import Mapping, Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any


class MovedModules(MetaPathFinder, Loader):
    """Finds modules by their old names.

    Args:
        moved: old name to new name, both dotted and whole.
    """

    def __init__(self, moved: Mapping[str, str]) -> None:
        self.moved = dict(moved)

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        return ModuleSpec(fullname, self) if fullname in self.moved else None

    def exec_module(self, module: ModuleType) -> None:
        old = module.__name__
        new = self.moved[old]
        warnings.warn(f"{old} is now {new}; import from there", DeprecationWarning, stacklevel=2)
        sys.modules[old] = import_module(new)  # the import system takes what stands there after loading


def find_moved(moved: Mapping[str, str]) -> None:
    """Makes the modules importable under their old names, once."""
    if not any(isinstance(finder, MovedModules) and finder.moved == moved for finder in sys.meta_path):
        sys.meta_path.append(MovedModules(moved))


def deprecated_names(package: str, rooms: Mapping[str, str], name: str) -> Any:
    """What a package exported in an earlier version, from the room that has it now.

    Raises:
        AttributeError: the package never exported that name.
    """
    if name not in rooms:
        raise AttributeError(f"module '{package}' has no attribute '{name}'")
    warnings.warn(f"{package}.{name} is now {rooms[name]}.{name}", DeprecationWarning, stacklevel=3)
    return getattr(import_module(rooms[name]), name)
