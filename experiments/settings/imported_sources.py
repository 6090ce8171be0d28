"""What was in the source of each module when this process imported it, which is what it executes, whatever lies there now.

Sources of installed packages do not count. Importing this module begins the record: of what was imported before, it holds what
is in the files then.
"""

import os
import sys
import sysconfig
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any

INSTALLED = tuple({sysconfig.get_path(kind) for kind in ("stdlib", "platstdlib", "purelib", "platlib")})

_recorded: dict[str, tuple[Path, bytes]] = {}  # name of a module to its file, and to what was in it


def imported_from(path: Path) -> tuple[ModuleType, bytes] | None:
    """The module that this process imported from a file, and what was in the file then; None where it imported none."""
    named = (name for name, (file, _) in _recorded.items() if file == path and name in sys.modules)
    return next(((sys.modules[name], _recorded[name][1]) for name in named), None)


def _record(name: str, origin: str | None) -> None:
    if origin and origin.endswith(".py") and not origin.startswith(INSTALLED) and os.path.isfile(origin):
        path = Path(os.path.realpath(origin))
        _recorded[name] = path, path.read_bytes()


class _RecordingFinder(PathFinder):
    """Python's own finder of modules, which notes the sources of what is imported."""

    @classmethod
    def find_spec(cls, fullname: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        spec = super().find_spec(fullname, path, target)
        if spec is not None and (fullname not in sys.modules or target is not None):  # it is imported, or again
            _record(fullname, spec.origin)
        return spec


if PathFinder in sys.meta_path:
    sys.meta_path[sys.meta_path.index(PathFinder)] = _RecordingFinder
    for _name, _module in list(sys.modules.items()):
        _record(_name, getattr(_module, "__file__", None))
