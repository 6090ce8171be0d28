"""What plays kernels of other targets in tests: a WebAssembly runtime, and LLVM's loader of object files.

A machine holds the arrays of a kernel's calls in memory of its own and gives them back by their names.
"""

import ctypes
import os
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numpy as np

from segar.engine import Entry, TargetKernel

ALIGNED = 16  # [bytes]
RUNNER = """
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#define EIGHT(n) a[n], a[n + 1], a[n + 2], a[n + 3], a[n + 4], a[n + 5], a[n + 6], a[n + 7]
#define WORD uint64_t
#define WORDS WORD, WORD, WORD, WORD, WORD, WORD, WORD, WORD

static void (*functions[])(void) = {FUNCTIONS};

/* Each line of the input is a call: which function, how many arguments, and the arguments. */
int main(int count, char **given) {
    uint64_t base = strtoull(given[2], 0, 10), size = strtoull(given[3], 0, 10);
    void *at = mmap((void *)base, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_FIXED, open(given[1], O_RDWR), 0);
    if (count != 4 || at != (void *)base) return 1;
    uint64_t which, n, a[64];
    while (scanf("%lu %lu", &which, &n) == 2) {
        if (n > 64) return 2;
        for (uint64_t k = 0; k < n; k++)
            if (scanf("%lu", &a[k]) != 1) return 3;
        /* A function leaves arguments alone that it does not take. */
        ((void (*)(WORDS, WORDS, WORDS, WORDS, WORDS, WORDS, WORDS, WORDS))functions[which])(
            EIGHT(0), EIGHT(8), EIGHT(16), EIGHT(24), EIGHT(32), EIGHT(40), EIGHT(48), EIGHT(56));
        puts("done");
        fflush(stdout);
    }
    return 0;
}
"""


class Machine:
    """Holds arrays by name, and calls exported functions with their addresses."""

    whole = "int64"  # the type of whole numbers in calls

    def __init__(self) -> None:
        self.places: dict[str, tuple[int, Any, tuple[int, ...]]] = {}

    def allocate(self, size: int) -> int:
        """The address of so many bytes."""
        raise NotImplementedError

    def view(self, address: int, array: np.ndarray) -> np.ndarray:
        """The memory at an address as an array like this one."""
        raise NotImplementedError

    def run(self, name: str, arguments: list[Any]) -> None:
        """Call an exported function."""
        raise NotImplementedError

    def place(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Copy arrays into memory; those whose names are known keep their place."""
        for name, array in arrays.items():
            if name not in self.places:
                self.places[name] = (self.allocate(array.nbytes), array.dtype, array.shape)
        for name, array in arrays.items():
            self[name][...] = array

    def __getitem__(self, name: str) -> np.ndarray:
        address, dtype, shape = self.places[name]
        return self.view(address, np.empty(shape, dtype))

    def call(
        self, entry: Entry, names: Mapping[str, str], sizes: Mapping[str, int], numbers: Mapping[str, Any], stop: int
    ) -> None:
        """Call an entry for things 0 to ``stop - 1``; ``names`` says which array each argument is, its own by default."""
        given = [0, stop, *(sizes[size] for size in entry.sizes)]
        for argument in entry.arguments:
            name = argument.name
            given.append(numbers[name] if argument.shape is None else self.places[names.get(name, name)][0])
        self.run(entry.name, given)


class WasmMachine(Machine):
    """Plays a module in wasmtime, which compiles ahead."""

    def __init__(self, kernel: TargetKernel) -> None:
        import wasmtime

        super().__init__()
        engine = wasmtime.Engine()
        self.store = wasmtime.Store(engine)
        module = wasmtime.Module(engine, kernel.code)
        self.imports = [one.name for one in module.imports]
        self.exports = wasmtime.Instance(self.store, module, []).exports(self.store)
        self.memory = self.exports["memory"]
        self.next = self.exports["__heap_base"].value(self.store)

    def allocate(self, size: int) -> int:
        at = -(-self.next // ALIGNED) * ALIGNED
        self.next = at + size
        missing = self.next - self.memory.data_len(self.store)
        if missing > 0:
            self.memory.grow(self.store, -(-missing // 65536))
        return at

    @property
    def image(self) -> bytes:
        """A copy of the memory."""
        return ctypes.string_at(self.memory.data_ptr(self.store), self.memory.data_len(self.store))

    def view(self, address: int, array: np.ndarray) -> np.ndarray:
        base = ctypes.addressof(self.memory.data_ptr(self.store).contents)
        raw = (ctypes.c_uint8 * array.nbytes).from_address(base + address)
        return np.frombuffer(raw, array.dtype).reshape(array.shape)

    def run(self, name: str, arguments: list[Any]) -> None:
        signed = [int(a) - (1 << 64) if int(a) >= 1 << 63 else int(a) for a in arguments]
        self.exports[name](self.store, *signed)


class NativeMachine(Machine):
    """Loads an object file as any linker would, without a compiler."""

    def __init__(self, kernel: TargetKernel) -> None:
        super().__init__()
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        machine = llvm.Target.from_default_triple().create_target_machine()
        self.engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        self.engine.add_object_file(llvm.ObjectFileRef.from_data(kernel.code))
        self.engine.finalize_object()
        self.kept: list[np.ndarray] = []
        self.kinds = {one["name"]: one["arguments"] for one in kernel.description["exports"]}

    def allocate(self, size: int) -> int:
        self.kept.append(np.zeros(size + ALIGNED, np.uint8))
        address = self.kept[-1].ctypes.data
        return -(-address // ALIGNED) * ALIGNED

    def view(self, address: int, array: np.ndarray) -> np.ndarray:
        return np.frombuffer((ctypes.c_uint8 * array.nbytes).from_address(address), array.dtype).reshape(array.shape)

    def run(self, name: str, arguments: list[Any]) -> None:
        numbers = {"int64": ctypes.c_int64, "uint64": ctypes.c_uint64, "bool": ctypes.c_uint8}
        kinds = [ctypes.c_void_p if len(one) > 2 else numbers[one[1]] for one in self.kinds[name]]
        function = ctypes.CFUNCTYPE(None, *kinds)(self.engine.get_function_address(name))
        function(*(int(a) for a in arguments))


class Aarch64Machine(Machine):
    """Plays an object file for 64-bit ARM in an emulated process, with which it shares a file as memory."""

    tools = ("aarch64-linux-gnu-gcc", "qemu-aarch64-static")
    base, size = 1 << 33, 1 << 28  # of the memory [bytes]

    def __init__(self, kernel: TargetKernel) -> None:
        super().__init__()
        self.folder = tempfile.TemporaryDirectory()
        place, compiler, emulator = Path(self.folder.name), *self.tools
        (place / "kernel.o").write_bytes(kernel.code)
        self.names = [one["name"] for one in kernel.description["exports"]]
        declared = "".join(f"extern void {name}(void);\n" for name in self.names)
        (place / "runner.c").write_text(f"{declared}#define FUNCTIONS {', '.join(self.names)}\n{RUNNER}")
        build = [compiler, "-O1", "-static", "-o", "runner", "runner.c", "kernel.o"]
        subprocess.run(build, cwd=place, check=True)
        (place / "memory").touch()
        os.truncate(place / "memory", self.size)
        self.memory = np.memmap(place / "memory", np.uint8, "r+")
        self.next = self.base
        command = [emulator, str(place / "runner"), str(place / "memory"), str(self.base), str(self.size)]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def __del__(self) -> None:
        self.process.communicate()
        self.folder.cleanup()

    def allocate(self, size: int) -> int:
        at, self.next = self.next, self.next + -(-size // ALIGNED) * ALIGNED
        assert self.next <= self.base + self.size, "give the machine more memory"
        return at

    def view(self, address: int, array: np.ndarray) -> np.ndarray:
        at = address - self.base
        return self.memory[at : at + array.nbytes].view(array.dtype).reshape(array.shape)

    def run(self, name: str, arguments: list[Any]) -> None:
        unsigned = [int(a) % (1 << 64) for a in arguments]
        assert self.process.stdin is not None and self.process.stdout is not None
        print(self.names.index(name), len(unsigned), *unsigned, file=self.process.stdin, flush=True)
        assert self.process.stdout.readline() == "done\n", f"{name} ended with {self.process.wait()}"


MACHINES: dict[str, type[Machine]] = {"wasm": WasmMachine, "native": NativeMachine, "aarch64": Aarch64Machine}
