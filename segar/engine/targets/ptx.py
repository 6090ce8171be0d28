"""PTX: text that the driver of an NVIDIA GPU compiles for the GPU that is there; one kernel per entry, one thread per thing.

Arithmetic is that of the processor, operation by operation: rounded to nearest, nothing fused, subnormal numbers kept.
Results are therefore the same to the bit. Only the bits of a nan that is computed are the machine's own.
"""

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

import llvmlite.binding as llvm

from segar.engine.targets.entry import Entry
from segar.engine.targets.module import argument_types, linked_module, optimise, target_machine
from segar.errors import SegarError

TRIPLE = "nvptx64-nvidia-cuda"
PROCESSOR, FEATURES = "sm_70", "+ptx70"  # Volta and everything newer; drivers since R450 of 2020 (CUDA 11.0)
DESCRIPTION = "// segar: "  # begins the line with the description
SPECIAL = ("tid", "ntid", "ctaid", "nctaid")
FUSED = re.compile(
    r"^\s*(?:@\S+\s+)?(fma\.\S+|(?:add|sub|mul|div|sqrt|rcp)\.(?!rn\b)(?:\w+\.)*f(?:32|64)|\S+\.ftz\S*)", re.M
)
CALLED = re.compile(r"^\s*(\.extern .*)", re.M)


def ptx_module(entries: Sequence[Entry], found: Sequence[Mapping[str, Any]], description: Mapping[str, Any]) -> str:
    """PTX with a kernel of each entry's name. Its first line holds the description as JSON behind :data:`DESCRIPTION`.

    The threads of a launch share the range: thread ``i`` takes ``start + i``, and then every thing that is one launch's size
    further, as long as it lies below ``stop``. A kernel has the arguments of its entry, each of eight bytes: whole numbers and
    truths as int64, other numbers as float64, arrays as addresses in the GPU's memory. No two arrays may overlap.

    Args:
        found: what :func:`segar.engine.targets.numba_ir.intermediate_code` gives for the entries.

    Raises:
        SegarError: something is called that a GPU does not have; the message names it.
    """
    machine = target_machine(TRIPLE, PROCESSOR, FEATURES, opt=3)
    module = linked_module(entries, found, machine, TRIPLE, kernel, merges=False)
    while inline_single_calls(module):
        optimise(module, machine, merges=False)
    text = machine.emit_assembly(module)
    for pattern, why in ((FUSED, "rounds in another way"), (CALLED, "is not there")):
        wrong = pattern.search(text)
        if wrong is not None:
            raise SegarError(f"LLVM made '{wrong[1]}' for the GPU, which {why}; use llvmlite 0.44 to 0.50")
    return f"{DESCRIPTION}{json.dumps(description, sort_keys=True)}\n{text}"


def inline_single_calls(module: llvm.ModuleRef) -> bool:
    """Mark functions that are called in one place only to become a part of their callers; return whether there are any.

    LLVM leaves large ones alone, and then no longer knows that the arrays lie in the GPU's memory and do not overlap.
    """
    text, found = str(module), False
    for function in module.functions:
        if not function.is_declaration and function.linkage == llvm.Linkage.internal:
            called = re.findall(rf'call [^\n]*@"?{re.escape(function.name)}"?\(', text)
            if len(called) == 1 and not any(b"alwaysinline" in one for one in function.attributes):
                function.add_function_attribute("alwaysinline")
                found = True
    return found


def kernel(entry: Entry, symbol: str, ir: str) -> str:
    """IR of a kernel whose threads call numba's function for one thing at a time."""
    kinds = argument_types(ir, symbol)[2:]
    header = ", ".join(f"{_outer(kind)} %a{k}" for k, kind in enumerate(kinds))
    lines, passed = [], ["i64 %i", "i64 %next"]
    for k, kind in enumerate(kinds):
        if kind == "ptr":
            lines.append(f"  %w{k} = addrspacecast ptr addrspace(1) %a{k} to ptr")
        elif kind != _outer(kind):
            lines.append(f"  %w{k} = {'fptrunc' if kind == 'float' else 'trunc'} {_outer(kind)} %a{k} to {kind}")
        if k > 1:
            passed.append(f"{kind} {'%a' if kind == _outer(kind) else '%w'}{k}")
    reads = [f"llvm.nvvm.read.ptx.sreg.{one}.x" for one in SPECIAL]
    declared = [f"declare i32 @{one}()" for one in reads if f"@{one}(" not in ir]
    read = [f"  %{name} = call i32 @{one}()" for name, one in zip(SPECIAL, reads, strict=True)]
    wide = [f"  %{one}_wide = zext i32 %{one} to i64" for one in SPECIAL]
    return "\n".join(
        [
            "",
            *declared,
            f"define ptx_kernel void @{entry.name}({header}) {{",
            "  %nothing = alloca ptr",
            "  %error = alloca ptr",
            *lines,
            *read,
            *wide,
            "  %before = mul i64 %ctaid_wide, %ntid_wide",
            "  %number = add i64 %before, %tid_wide",
            "  %stride = mul i64 %nctaid_wide, %ntid_wide",
            "  %first = add i64 %a0, %number",
            "  br label %head",
            "head:",
            "  %i = phi i64 [ %first, %0 ], [ %further, %body ]",
            "  %more = icmp slt i64 %i, %a1",
            "  br i1 %more, label %body, label %done",
            "body:",
            "  %next = add i64 %i, 1",
            f'  %status = call i32 @"{symbol}"(ptr %nothing, ptr %error, {", ".join(passed)})',
            "  %further = add i64 %i, %stride",
            "  br label %head",
            "done:",
            "  ret void",
            "}\n",
        ]
    )


def _outer(kind: str) -> str:
    """LLVM's type of a kernel's argument: all of them take eight bytes."""
    return {"ptr": "ptr addrspace(1) noalias", "float": "double"}.get(kind, "i64" if kind.startswith("i") else kind)
