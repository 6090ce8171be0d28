"""WebAssembly: modules that import nothing, with a memory of their own and a description of what they export."""

import json
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import llvmlite.binding as llvm

from segar.engine.targets.entry import Entry
from segar.engine.targets.module import exported, linked_module, target_machine
from segar.engine.targets.wasm_linker import link, name, section

TRIPLE = "wasm32-unknown-unknown"
FEATURES = "+bulk-memory,+sign-ext,+mutable-globals,+nontrapping-fptoint"  # which every browser has had since 2021
DESCRIPTION = "segar"  # the custom section
STACK = 1 << 16  # [bytes]
# LLVM knows the upper half of a product of 64-bit numbers when it sees one, and calls this function for it, which it has for
# other processors: the product of two integers of 128 bits, each in two halves, from products of halves of 32 bits.
WIDE_PRODUCT = """
target datalayout = "{layout}"
target triple = "{triple}"
define void @__multi3(ptr %out, i64 %a, i64 %a2, i64 %b, i64 %b2) {{
  %a0 = and i64 %a, 4294967295
  %a1 = lshr i64 %a, 32
  %b0 = and i64 %b, 4294967295
  %b1 = lshr i64 %b, 32
  %p00 = mul i64 %a0, %b0
  %p01 = mul i64 %a0, %b1
  %p10 = mul i64 %a1, %b0
  %p11 = mul i64 %a1, %b1
  %c = lshr i64 %p00, 32
  %m0 = and i64 %p01, 4294967295
  %m1 = and i64 %p10, 4294967295
  %s0 = add i64 %c, %m0
  %s = add i64 %s0, %m1
  %low = mul i64 %a, %b
  %h0 = lshr i64 %p01, 32
  %h1 = lshr i64 %p10, 32
  %h2 = lshr i64 %s, 32
  %h3 = add i64 %p11, %h0
  %h4 = add i64 %h3, %h1
  %h5 = add i64 %h4, %h2
  %x0 = mul i64 %a, %b2
  %x1 = mul i64 %a2, %b
  %h6 = add i64 %h5, %x0
  %high = add i64 %h6, %x1
  store i64 %low, ptr %out
  %place = getelementptr i8, ptr %out, i32 8
  store i64 %high, ptr %place
  ret void
}}
"""


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
        module.link_in(llvm.parse_assembly(WIDE_PRODUCT.format(layout=machine.target_data, triple=TRIPLE)))
    code = link(machine.emit_object(module), [one.name for one in entries], stack)
    return code + section(
        0, name(DESCRIPTION) + json.dumps(description, sort_keys=True, separators=(",", ":")).encode()
    )
