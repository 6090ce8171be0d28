"""A world's kernel as it runs: its source as plain Python, to the same bits, until machine code is worth waiting for.

Compiling a kernel takes as long as some 20,000 steps of its source, so the first step of a new world does not wait for it.
Once steps have taken some time (:func:`segar.support.patience`), a process of its own compiles the kernel, and they go on as
Python until it is done.
"""

import ast
import ctypes
import os
import pickle
import re
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from segar.engine.compiler.kernel import KernelSource
from segar.engine.compiler.kernel_cache import is_compiled, kernel_path, load_module
from segar.engine.runtime import gather, ledger
from segar.support import patience, private_cache_folder

LONG_STEP = 2.0  # [s] a call that would take longer as Python waits for machine code
RATE = 1e-3  # [s] of a step of one environment as Python, before any was taken

_plain: dict[str, ModuleType] = {}  # by the names that generated modules import them by
_running: dict[str, "RunningKernel"] = {}  # by source
_one_at_a_time = threading.Lock()  # Python 3.11 cannot parse two sources at once: SystemError


def running_kernel(source: KernelSource) -> "RunningKernel":
    """The kernel of this source; simulators of one world share it.

    Raises:
        SegarError: see :func:`segar.support.patience`.
    """
    with _one_at_a_time:
        kernel = _running.get(source.text)
        if kernel is None:
            kernel = _running[source.text] = RunningKernel(source, patience())
    if kernel.is_python and (patience() <= 0 or is_compiled(kernel_path(source.text))):
        kernel.use_machine_code()
    return kernel


class RunningKernel:
    """The module that steps are taken by: plain Python at first, machine code later.

    Args:
        patience: [s] of steps as Python before the kernel is compiled beside them.

    Attributes:
        module: has ``advance`` and what belongs to it.
        is_python: whether ``advance`` is plain Python.
    """

    def __init__(self, source: KernelSource, patience: float) -> None:
        self._text, self._shared, self._left, self._rate = source.text, source.shared, patience, RATE
        load_module(source.shared)
        plain_module(source.shared)
        self.module, self.is_python = plain_module(source.text), True
        self._compiler: threading.Thread | None = None

    def use_machine_code(self) -> None:
        """Take all later steps by machine code; the next one waits where it is not there."""
        self.module, self.is_python = load_module(self._text), False

    def steps_as_python(self, arguments: Sequence[Any], steps: int) -> bool:
        """Take a step as Python, unless machine code is there or worth waiting for; returns whether it was taken.

        Args:
            arguments: those of ``advance``.
            steps: environments times sub-steps.
        """
        is_due = self._left < 0 and not self._is_compiled_beside(arguments)
        if is_due or self._rate * steps > LONG_STEP:
            self.use_machine_code()
            return False
        began = time.thread_time()
        self.module.advance(*arguments)
        took = time.thread_time() - began
        self._left, self._rate = self._left - took, took / max(steps, 1)
        return True

    def _is_compiled_beside(self, arguments: Sequence[Any]) -> bool:
        """Whether another process is at it, which begins with the first call."""
        if self._compiler is None:
            if not sys.executable:
                return False
            files = [str(load_module(text).__file__) for text in (self._shared, self._text)]
            self._compiler = threading.Thread(target=_compile_beside, args=(files, arguments), daemon=True)
            self._compiler.start()
        return self._compiler.is_alive()


def _compile_beside(files: Sequence[str], arguments: Sequence[Any]) -> None:
    """Compile a kernel for arguments of these types in another process. What fails there is done, and said, in this one."""
    from numba import typeof

    # The process is short, and searches for garbage take an eighth of its time.
    program = f"import gc, sys; gc.disable(); from {__name__} import compile_kernel; compile_kernel(*sys.argv[1:])"
    signature = pickle.dumps(tuple(map(typeof, arguments))).hex()
    nowhere = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-c", program, *files, signature]
    with suppress(OSError):
        # In a session of its own: who stops the program soon starts it again, and finds the kernel.
        subprocess.run(command, env=environment, start_new_session=True, check=False, **nowhere)  # type: ignore[call-overload]


def compile_kernel(shared: str, file: str, signature: str) -> None:
    """The work of the other process: compile the kernel in a file, unless a third one is at it or has done so."""
    from filelock import FileLock

    with FileLock(private_cache_folder() / f"{Path(file).stem}.lock"):
        load_module(Path(shared).read_text(encoding="utf-8"))
        advance = load_module(Path(file).read_text(encoding="utf-8")).advance
        advance.compile(pickle.loads(bytes.fromhex(signature)))


def plain_module(text: str) -> ModuleType:
    """The module of a generated source as plain Python."""
    name = kernel_path(text).stem
    if name in _plain:
        return _plain[name]
    text = text.replace("from numba import njit", "def njit(**_): return lambda function: function")
    text = text.replace("math.sqrt(", "sqrt(").replace("np.sign(", "sign(")
    module = ModuleType(name)
    # math.sqrt would raise below zero. The sign of a zero is this zero for numba, -0.0 among them, and 0.0 for numpy.
    functions = {"sqrt": lambda x: np.sqrt(np.float64(x)), "sign": lambda x: np.sign(np.float64(x)) or x}
    vars(module).update(functions, float64=np.float64)
    for shared in re.findall(r"^from (k_\w+) import", text, re.M):
        text = re.sub(rf"^from {shared} import.*$", "", text, flags=re.M)
        vars(module).update(vars(_plain[shared]))
    tree = ast.fix_missing_locations(_AsCompiled().visit(ast.parse(text)))
    exec(compile(tree, f"{name}.py, as plain Python", "exec"), vars(module))
    if hasattr(module, "advance"):
        alone = {"open_ledger": _open_ledger, "take_part": _take_part, "finish_part": lambda ledger: None}
        read = {"gather_range": gather.gather_range.py_func, "table_on": _table_on}
        vars(module).update(alone, **read, advance=np.errstate(all="ignore")(module.advance))
    _plain[name] = module
    return module


class _AsCompiled(ast.NodeTransformer):
    """Gives numbers and truths the arithmetic of machine code: quotients by zero do not raise, and truths are counted."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        # numpy's scalars divide as numba's error_model="numpy" does; Python's own numbers would raise.
        if isinstance(node.op, ast.Div):
            node.left = ast.Call(ast.Name("float64", ast.Load()), [node.left], [])
        return self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> ast.AST:  # numpy's truths add up to a truth
        self.generic_visit(node)
        return ast.Call(ast.Name("bool", ast.Load()), [node], [])


def _open_ledger(parts: np.ndarray) -> None:
    parts[ledger.TAKEN] = 0


def _take_part(parts: np.ndarray, owns: bool) -> int:
    """As in machine code, where one thread does all parts."""
    part = int(parts[ledger.TAKEN])
    parts[ledger.TAKEN] += 1
    return part if part < parts[ledger.PARTS] else -1


def _table_on(sheet: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """What numba's intrinsic of this name gives: the table at the address on the sheet."""
    return np.ctypeslib.as_array((ctypes.c_float * (rows * columns)).from_address(int(sheet[0]))).reshape(rows, columns)
