"""Faces of rooms: what stands in the stub beside a room's ``__init__`` is loaded when it is asked for."""

import ast
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lazy_loader import attach_stub


def lazy_face(room: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """``__getattr__``, ``__dir__`` and ``__all__`` of a room.

    The stub ``__init__.pyi`` imports what others may use, as type checkers read it. Its ``__all__`` lists what users may
    rely on. All other names of the stub, in the form ``from .x import y as y``, are for fellow rooms.

    Args:
        room: ``__name__`` of the room. file: its ``__file__``.
    """
    load, names, _ = attach_stub(room, file)
    stub = ast.parse(Path(file).with_suffix(".pyi").read_text(encoding="utf-8"))
    public = [ast.literal_eval(node.value) for node in stub.body if isinstance(node, ast.Assign)]
    return load, names, public[0] if public else []
