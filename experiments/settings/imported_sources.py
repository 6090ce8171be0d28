"""What was in the source of a module when this process imported it, which is what it executes, whatever lies there now.

Python's finder of modules is told to keep the source with what it finds. Of what was imported before, or by other finders, such
as those of editable installations, the source is what is in the file when this module is imported or when it is asked first.
Installed packages do not count.
"""

import os
import sys
import sysconfig
from functools import cache
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any

INSTALLED = tuple({sysconfig.get_path(kind) for kind in ("stdlib", "platstdlib", "purelib", "platlib")})
SOURCE = "_source_at_import"  # the attribute of a module's spec
_real = cache(os.path.realpath)  # of the files of modules, which are asked for again and again


def imported_from(path: Path) -> tuple[ModuleType, bytes] | None:
    """The module that this process imported from a file, and what was in the file then; None where it imported none."""
    for module in list(sys.modules.values()):
        file = getattr(module, "__file__", None)
        if isinstance(file, str) and file.endswith(path.name) and _real(file) == str(path):
            return module, _kept(module.__spec__ or module, file)
    return None


def _kept(holder: Any, file: str) -> bytes:
    if SOURCE not in vars(holder):
        setattr(holder, SOURCE, Path(file).read_bytes())
    return vars(holder)[SOURCE]


def _is_own(file: Any) -> bool:
    return isinstance(file, str) and file.endswith(".py") and not file.startswith(INSTALLED) and os.path.isfile(file)


class _KeepingFinder(PathFinder):
    """Python's own finder, which keeps the sources of what is not installed."""

    @classmethod
    def find_spec(cls, fullname: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        spec = super().find_spec(fullname, path, target)
        if spec is not None and _is_own(spec.origin):
            _kept(spec, str(spec.origin))
        return spec


if PathFinder in sys.meta_path:
    sys.meta_path[sys.meta_path.index(PathFinder)] = _KeepingFinder
    for _module in list(sys.modules.values()):
        if _is_own(getattr(_module, "__file__", None)):
            _kept(_module.__spec__ or _module, str(_module.__file__))
