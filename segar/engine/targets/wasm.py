"""WebAssembly: modules that import nothing, with a memory of their own and a description of what they export."""

import json
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm

from segar.engine.targets.entry import Entry
from segar.engine.targets.module import exported, linked_module, target_machine
from segar.engine.targets.wasm_linker import link, name, section

TRIPLE = "wasm32-unknown-unknown"
FEATURES = "+bulk-memory,+sign-ext,+mutable-globals,+nontrapping-fptoint"  # which every browser has had since 2021
DESCRIPTION = "segar"  # the custom section
STACK = 1 << 16  # [bytes]
WIDE_PRODUCT = Path(__file__).with_name("wide_product.ll")  # which products of 64-bit numbers call


def wasm_module(
    entries: Sequence[Entry], found: Sequence[Mapping[str, Any]], description: Mapping[str, Any], stack: int = STACK
) -> bytes:
    """A module that exports the entries, ``memory``, and ``__heap_base``, from which on the memory is the caller's.

    Whole numbers are i32 and addresses are bytes of the memory. The custom section ``segar`` holds the description as JSON.

    Args:
        found: what :func:`segar.engine.targets.numba_ir.intermediate_code` gives for the entries.
        stack: bytes for what functions keep while they run. More than these end in a trap.
    """
    machine = target_machine(TRIPLE, "generic", FEATURES, reloc="static", codemodel="default")
    module = linked_module(entries, found, machine, TRIPLE, partial(exported, size="i32"))
    if "i128" in str(module):
        target = f'target datalayout = "{machine.target_data}"\ntarget triple = "{TRIPLE}"\n'
        module.link_in(llvm.parse_assembly(target + WIDE_PRODUCT.read_text(encoding="utf-8")))
    code = link(machine.emit_object(module), [one.name for one in entries], stack)
    return code + section(
        0, name(DESCRIPTION) + json.dumps(description, sort_keys=True, separators=(",", ":")).encode()
    )
