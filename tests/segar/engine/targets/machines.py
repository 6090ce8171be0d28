"""What plays kernels of other targets in tests: a WebAssembly runtime, and LLVM's loader of object files.

A machine holds the arrays of a kernel's calls in memory of its own and gives them back by their names.
"""

import ctypes
from collections.abc import Mapping
from typing import Any

import llvmlite.binding as llvm
import numpy as np

from segar.engine import Entry, TargetKernel

ALIGNED = 16  # [bytes]


class Machine:
    """Holds arrays by name, and calls exported functions with their addresses."""

    whole = "int64"  # the type of whole numbers in calls

    def __init__(self) -> None:
        self.arrays: dict[str, np.ndarray] = {}

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

    @property
    def places(self) -> dict[str, tuple[int, Any, tuple[int, ...]]]:
        return self.__dict__.setdefault("_places", {})

    def __getitem__(self, name: str) -> np.ndarray:
        address, dtype, shape = self.places[name]
        return self.view(address, np.empty(shape, dtype))

    def call(
        self, entry: Entry, names: Mapping[str, str], sizes: Mapping[str, int], numbers: Mapping[str, Any], stop: int
    ) -> None:
        """Call an entry for things 0 to ``stop - 1``; ``names`` says which array each argument is, its own by default."""
        self.run(entry.name, self.given(entry, names, sizes, numbers, stop))

    def given(
        self, entry: Entry, names: Mapping[str, str], sizes: Mapping[str, int], numbers: Mapping[str, Any], stop: int
    ) -> list[Any]:
        """The arguments of such a call."""
        given = [0, stop, *(sizes[size] for size in entry.sizes)]
        for argument in entry.arguments:
            name = argument.name
            given.append(numbers[name] if argument.shape is None else self.places[names.get(name, name)][0])
        return given


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


MACHINES: dict[str, type[Machine]] = {"wasm": WasmMachine, "native": NativeMachine}
