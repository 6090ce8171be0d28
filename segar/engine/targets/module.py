"""From numba's IR of entries to one LLVM module for another target: linked, cleaned of what Python needs, and checked.

What is left is a function of the name of each entry, with plain numbers and addresses, and what these call.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import llvmlite.binding as llvm

from segar.engine.targets.entry import Entry
from segar.errors import SegarError

# Functions of the C library that every target has as an operation with one correctly rounded result.
OPERATIONS = {"sqrt": "llvm.sqrt", "fabs": "llvm.fabs", "floor": "llvm.floor", "ceil": "llvm.ceil", "trunc": "llvm.trunc",
              "rint": "llvm.rint", "copysign": "llvm.copysign"}  # fmt: skip
# Operations of LLVM that become calls of the C library, or that round once where the source rounds twice.
CALLS = re.compile(r"llvm\.(a?(sin|cos|tan)h?|atan2|exp|exp2|exp10|log|log2|log10|pow|powi|ldexp|frexp|fma|fmuladd)\.")


def target_machine(triple: str, cpu: str, features: str, opt: int = 2, **options: Any) -> llvm.TargetMachine:
    """LLVM's machine for a triple; raises :class:`SegarError` if this llvmlite was made without that target."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    try:
        target = llvm.Target.from_triple(triple)
    except RuntimeError as cause:
        raise SegarError(
            f"llvmlite {llvm.llvm_version_info} has no target {triple}: {cause}; install its wheel"
        ) from cause
    return target.create_target_machine(cpu=cpu, features=features, opt=opt, **options)


def linked_module(
    entries: Sequence[Entry],
    found: Sequence[Mapping[str, Any]],
    machine: llvm.TargetMachine,
    triple: str,
    export: Callable[[Entry, str, str], str],
    merges: bool = True,
) -> llvm.ModuleRef:
    """The module for a machine that exports the entries under their names and imports nothing.

    Args:
        found: what :func:`segar.engine.targets.numba_ir.intermediate_code` gives for the entries.
        export: IR of the exported function from its entry, numba's name of the function that it calls, and numba's IR.
        merges: whether functions that several entries share are there once.

    Raises:
        SegarError: something is called that the target does not have; the message names it.
    """
    module = None
    for entry, one in zip(entries, found, strict=True):
        ir = retargeted(one["ir"], triple, str(machine.target_data))
        text = ir + export(entry, one["symbol"], ir)
        part = llvm.parse_assembly(text)
        names = {one.name for one in entries}
        for thing in [*part.functions, *part.global_variables]:
            if not thing.is_declaration and thing.name not in names:
                thing.linkage = "internal"
        check_self_contained(part, entry, machine)
        if module is None:
            module = part
        else:
            module.link_in(part)
    assert module is not None
    optimise(module, machine, merges)
    module.verify()
    return module


def retargeted(ir: str, triple: str, layout: str) -> str:
    """The IR for another target, with operations in place of calls of the C library that every target has."""
    ir = re.sub(r'^target datalayout = ".*"$', f'target datalayout = "{layout}"', ir, flags=re.M)
    ir = re.sub(r'^target triple = ".*"$', f'target triple = "{triple}"', ir, flags=re.M)
    for name, operation in OPERATIONS.items():
        for kind, suffix, c_suffix in (("double", "f64", ""), ("float", "f32", "f")):
            called = f"@{name}{c_suffix}("
            if called in ir:
                ir = re.sub(rf"^declare {kind} {re.escape(called)}.*\n", "", ir, flags=re.M)
                ir = ir.replace(called, f"@{operation}.{suffix}(")
                if f"declare {kind} @{operation}.{suffix}(" not in ir:
                    arguments = ", ".join([kind] * (2 if name == "copysign" else 1))
                    ir += f"\ndeclare {kind} @{operation}.{suffix}({arguments})\n"
    return ir


def exported(entry: Entry, symbol: str, ir: str, size: str) -> str:
    """IR of a function with plain arguments that calls numba's, whose first two arguments are of no use here.

    Args:
        size: LLVM's type of whole numbers, ``i32`` or ``i64``; seeds and keys are ``i64``.
    """
    kinds = argument_types(ir, symbol)[2:]
    keys = [False] * (2 + len(entry.sizes)) + [one.dtype == "uint64" for one in entry.arguments]
    outer = [size if kind == "i64" and not key else kind for kind, key in zip(kinds, keys, strict=True)]
    header = ", ".join(f"{kind} %a{k}" for k, kind in enumerate(outer))
    lines, passed = [], []
    for k, (inner, kind) in enumerate(zip(kinds, outer, strict=True)):
        if inner != kind:
            lines.append(f"  %w{k} = sext {kind} %a{k} to {inner}")
        passed.append(f"{inner} {'%w' if inner != kind else '%a'}{k}")
    return "\n".join(
        [
            f"\ndefine void @{entry.name}({header}) {{",
            "  %nothing = alloca ptr",
            "  %error = alloca ptr",
            *lines,
            f'  %status = call i32 @"{symbol}"(ptr %nothing, ptr %error, {", ".join(passed)})',
            "  ret void",
            "}\n",
        ]
    )


def argument_types(ir: str, symbol: str) -> list[str]:
    """LLVM's types of the arguments of a function in this IR."""
    return [str(one.type) for one in llvm.parse_assembly(ir).get_function(symbol).arguments]


def optimise(module: llvm.ModuleRef, machine: llvm.TargetMachine, merges: bool) -> None:
    """LLVM's usual passes for the machine, without vectors, after which nothing is left that nobody calls."""
    options = llvm.create_pipeline_tuning_options(speed_level=2)
    options.loop_vectorization = options.slp_vectorization = options.loop_interleaving = False
    builder = llvm.create_pass_builder(machine, options)
    passes = builder.getModulePassManager()
    if merges:
        passes.add_merge_functions_pass()  # entries bring copies of the functions and tables that they share
        passes.add_constant_merge_pass()
    passes.add_global_dead_code_eliminate_pass()
    passes.run(module, builder)


def check_self_contained(module: llvm.ModuleRef, entry: Entry, machine: llvm.TargetMachine) -> None:
    """Takes out what the entry does not call; raises :class:`SegarError` if it calls functions that are not its own, or this
    processor's instructions."""
    builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=0))
    passes = llvm.create_new_module_pass_manager()
    passes.add_global_dead_code_eliminate_pass()
    passes.run(module, builder)
    called = [f.name for f in module.functions if f.is_declaration]
    own = ("llvm.x86.", "llvm.aarch64.")
    foreign = [n for n in called if not n.startswith("llvm.") or n.startswith(own) or CALLS.match(n)]
    text = str(module) if foreign else ""
    used = [name for name in foreign if re.search(rf'call [^\n]*@"?{re.escape(name)}"?\(', text)]
    if used:
        raise SegarError(
            f"{entry.name} calls {', '.join(sorted(used))}, which other targets than this processor do not have; rules may use"
            " the functions of segar.language, such as exp, sin and hypot"
        )
