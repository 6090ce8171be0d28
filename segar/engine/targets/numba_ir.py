"""``python -m segar.engine.targets.numba_ir``: LLVM IR of entries, as numba makes it for a plain processor without vectors.

Numba takes its processor from the environment when it is imported, so this runs in a process of its own: it reads pickled
entries from its input and writes JSON to its output.
"""

import gc
import json
import os
import pickle
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

from segar.engine.targets.entry import Entry, wrapper
from segar.errors import SegarError

PLAIN_PROCESSOR = {
    "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "NUMBA_LOOP_VECTORIZE": "0", "NUMBA_SLP_VECTORIZE": "0",
    "NUMBA_DISABLE_JIT": "0", "NUMBA_OPT": "3",
}  # fmt: skip


def intermediate_code(entries: Sequence[Entry]) -> list[dict[str, Any]]:
    """For each entry its ``ir`` and the ``symbol`` of its function there; raises :class:`SegarError` where numba fails."""
    done = subprocess.run(
        [sys.executable, "-m", __spec__.name], input=pickle.dumps(entries), capture_output=True,
        env={**os.environ, **PLAIN_PROCESSOR, "PYTHONPATH": os.pathsep.join(sys.path)}, check=False,
    )  # fmt: skip
    if done.returncode:
        names = ", ".join(one.name for one in entries)
        raise SegarError(
            f"numba cannot compile {names} for other targets: {done.stderr.decode(errors='replace').strip()[-2000:]}"
        )
    return json.loads(done.stdout)


def compile_entry(entry: Entry) -> dict[str, Any]:
    """The IR of one entry, and the name of its function in it."""
    from numba import njit, types

    from segar.engine.runtime.scratch import array_at, array_by_number_at

    names: dict[str, Any] = {"array_at": array_at, "array_by_number_at": array_by_number_at}
    source: dict[str, Any] = {"__name__": f"segar_{entry.name}"}
    exec(compile(entry.module, f"<{entry.name}>", "exec", dont_inherit=True), source)
    names[entry.name] = source[entry.name]
    text, kinds = wrapper(entry)
    exec(compile(text, "<wrapper>", "exec"), names)
    options: dict[str, Any] = {"error_model": "numpy", "_nrt": False}
    compiling: Any = njit(**options)
    function = compiling(names["exported"])
    signature = types.void(*(eval(kind, dict(vars(types))) for kind in kinds))
    function.compile(signature)
    compiled = function.overloads[signature.args]
    return {"ir": compiled.library.get_llvm_str(), "symbol": compiled.fndesc.llvm_func_name}


if __name__ == "__main__":
    gc.disable()  # the process is short, and searches for garbage take an eighth of its time
    json.dump([compile_entry(one) for one in pickle.load(sys.stdin.buffer)], sys.stdout)
