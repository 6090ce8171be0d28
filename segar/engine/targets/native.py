"""Object files for this machine's kind of processor, or for another kind, whose functions any program can call."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import llvmlite.binding as llvm

from segar.engine.targets.entry import Entry
from segar.engine.targets.module import exported, linked_module, target_machine

AARCH64 = "aarch64-unknown-linux-gnu"


def native_object(entries: Sequence[Entry], found: Sequence[Mapping[str, Any]], triple: str = "") -> bytes:
    """A relocatable object that exports the entries as C functions ``void f(int64_t start, ...)``.

    It calls nothing from outside but the C library's memset and memcpy.

    It runs on every processor of its kind, x86-64 or AArch64.

    Args:
        found: what :func:`segar.engine.targets.numba_ir.intermediate_code` gives for the entries.
        triple: the kind of processor and system, as LLVM names it; this machine's where it is empty.
    """
    triple = triple or llvm.get_process_triple()
    machine = target_machine(triple, "generic", "", reloc="pic")
    return machine.emit_object(linked_module(entries, found, machine, triple, partial(exported, size="i64")))
