"""Kernels for other targets as files. Numba's IR, which takes long, is kept by its content beside the native kernels."""

import hashlib
import json
import sys
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm

from segar.engine.targets.entry import Entry
from segar.engine.targets.module import exported, linked_module, target_machine
from segar.engine.targets.numba_ir import intermediate_code
from segar.engine.targets.ptx import ptx_module
from segar.engine.targets.wasm import STACK, wasm_module
from segar.errors import SegarError, must_be
from segar.support import ADVICE, private_cache_folder, replacing

TARGETS = ("native", "aarch64", "wasm", "ptx")
AARCH64 = "aarch64-unknown-linux-gnu"
COMPILED = ("engine", "envs", "language", "observations", "policies", "support", "textures")
"""The rooms whose functions and constants compiled code has; what rules and tasks say stands in its text."""


@dataclass(frozen=True)
class TargetKernel:
    """A module for another target.

    Attributes:
        target: one of :data:`TARGETS`.
        code: the bytes of the file.
        description: plain data: ``exports``, each with its arguments in order, and what :func:`build_kernel` was told.
    """

    target: str
    code: bytes
    description: Mapping[str, Any]


def build_kernel(entries: Sequence[Entry], target: str, about: Mapping[str, Any] | None = None) -> TargetKernel:
    """The module of a target that exports these entries; the first time of a world takes some ten seconds.

    Args:
        target: "native" (an object file, for every processor of this machine's kind), "aarch64" (one for Linux on 64-bit ARM),
            "wasm", "ptx" (text for NVIDIA GPUs). Object files have C functions ``void f(int64_t start, ...)``, which call
            nothing from outside but the C library's memset and memcpy.
        about: what the description says beside the exports; plain data.

    Raises:
        SegarError: the target is unknown; something is called that it does not have; the cache cannot be written.
    """
    if target not in TARGETS:
        raise SegarError(f"target {must_be(target, TARGETS)}")
    description = {**(about or {}), "segar": 1, "target": target, "exports": [one.described() for one in entries]}
    return TargetKernel(target, _code(tuple(entries), target, json.dumps(description)), description)


@lru_cache(maxsize=16)
def _code(entries: tuple[Entry, ...], target: str, description: str) -> bytes:
    found, described = kept_intermediate_code(entries), json.loads(description)
    if target == "wasm":
        return wasm_module(entries, found, described, STACK + max(one.scratch for one in entries))
    if target == "ptx":
        return ptx_module(entries, found, described).encode()
    triple = AARCH64 if target == "aarch64" else llvm.get_process_triple()
    machine = target_machine(triple, "generic", "", reloc="pic")
    return machine.emit_object(linked_module(entries, found, machine, triple, partial(exported, size="i64")))


def kept_intermediate_code(entries: Sequence[Entry]) -> list[dict[str, Any]]:
    """:func:`intermediate_code` of each entry, made once per machine and then read from the cache."""
    folder = private_cache_folder()
    request = [json.dumps([asdict(one), versions()], sort_keys=True) for one in entries]
    paths = [folder / f"t_{hashlib.sha256(one.encode()).hexdigest()[:16]}.ir" for one in request]
    found = [read_checked(path) for path in paths]
    new = [k for k, one in enumerate(found) if one is None]
    if new:
        names = ", ".join(entries[k].name for k in new)
        print(
            f"segar: compiling {names} for other targets (first time, some 10 s or more)", file=sys.stderr, flush=True
        )
    for k, one in zip(new, intermediate_code([entries[k] for k in new]) if new else (), strict=True):
        found[k] = one
        with replacing(paths[k], "the kernel", advice=ADVICE) as beside:
            beside.write_bytes(zlib.compress(json.dumps(one).encode()))
    return [one for one in found if one is not None]


def read_checked(path: Path) -> dict[str, Any] | None:
    """What a file of the cache holds; None where it is not there or is not as it was written."""
    try:
        return json.loads(zlib.decompress(path.read_bytes()))  # zlib has a checksum
    except (OSError, zlib.error):
        return None


@cache
def versions() -> list[str]:
    """What decides the code beside the entries: numba, llvmlite, and the source of this package that is compiled."""
    import llvmlite
    import numba

    digest = hashlib.sha256()
    here = Path(__file__).parent
    later = {path for path in here.glob("*.py") if path.name not in ("entry.py", "numba_ir.py")}
    found = {path for room in COMPILED for path in here.parents[1].joinpath(room).rglob("*.py")}
    for path in sorted(found - later):
        digest.update(path.read_bytes())
    return [numba.__version__, llvmlite.__version__, digest.hexdigest()]
