"""Kernels that run as plain Python, to the same bits: their source is slow, but there is nothing to compile.

Compiling a world takes as long as some 20,000 steps of its source. Tests of what a compiled kernel is are marked ``compiled``.
All others run the source of a world until it has taken longer than :data:`PATIENCE`, and what is compiled from then on.
"""

import contextlib
import ctypes
import fcntl
import io
import re
import time
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from segar.engine.compiler.kernel_cache import is_compiled, kernel_path, load_module

PATIENCE = 3.0  # seconds of one world as Python before it is compiled

PLAIN: dict[str, types.ModuleType] = {}  # by the names that generated modules import them by
TRIED: dict[str, Any] = {}  # modules by their source


class Tried:
    """The module of a world that is compiled only if it is used much."""

    def __init__(self, text: str) -> None:
        self.text, self.plain, self.patience = text, plain_module(text), PATIENCE

    def __getattr__(self, name: str) -> Any:
        return getattr(self.plain, name)

    def advance(self, *arguments: Any) -> None:
        if self.patience < 0:
            with _alone(kernel_path(self.text)) as alone:
                if alone:
                    self.advance = load_module(self.text).advance
                    return self.advance(*arguments)
            self.patience = PATIENCE  # somebody else compiles it
        began = time.thread_time()
        try:
            self.plain.advance(*arguments)
        finally:
            self.patience -= time.thread_time() - began


@contextlib.contextmanager
def _alone(path: Path) -> Iterator[bool]:
    """Whether no other worker compiles a kernel at this time. What is said meanwhile is not heard."""
    with path.with_suffix(".lock").open("w") as lock, contextlib.redirect_stderr(io.StringIO()):
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
        else:
            yield True


def tried_module(text: str) -> Any:
    """The module of a source: what is compiled if that is at hand, else its source as Python at first."""
    if "def advance(" not in text:  # what kernels share
        plain_module(text)
        return load_module(text)
    if text not in TRIED:
        TRIED[text] = load_module(text) if is_compiled(kernel_path(text)) else Tried(text)
    return TRIED[text]


def plain_module(text: str) -> types.ModuleType:
    """The module of a source as plain Python."""
    name = kernel_path(text).stem
    if name in PLAIN:
        return PLAIN[name]
    # numpy's scalars divide as numba's error_model="numpy" does; Python's own numbers and math.sqrt would raise.
    text = text.replace("from numba import njit", "def njit(**_): return lambda function: function")
    text = text.replace("math.sqrt", "np.sqrt")
    module = types.ModuleType("plain_kernel")
    for shared in re.findall(r"^from (k_\w+) import", text, re.M):
        text = re.sub(rf"^from {shared} import.*$", "", text, flags=re.M)
        vars(module).update(vars(PLAIN[shared]))
    PLAIN[name] = module
    exec(compile(text, "plain_kernel.py", "exec"), module.__dict__)
    module.table_on = _table_on  # type: ignore[attr-defined]
    if hasattr(module, "advance"):
        module.advance = np.errstate(all="ignore")(module.advance)
    return module


def _table_on(sheet: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """What numba's intrinsic of this name gives: the table at the address on the sheet."""
    return np.ctypeslib.as_array((ctypes.c_float * (rows * columns)).from_address(int(sheet[0]))).reshape(rows, columns)
