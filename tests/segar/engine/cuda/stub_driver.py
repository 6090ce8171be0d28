"""A driver without a GPU: it has the functions of NVIDIA's library that SEGAR calls, and runs kernels on the PTX machine.

Addresses are those of this process's memory, so that torch's tensors on the processor stand for tensors on a GPU.
"""

import ctypes
from typing import Any

import numpy as np

from tests.segar.engine.targets.ptx_machine import PTXMachine, machine_of

NAMES = {2: "CUDA_ERROR_OUT_OF_MEMORY", 100: "CUDA_ERROR_NO_DEVICE", 218: "CUDA_ERROR_INVALID_PTX",
         222: "CUDA_ERROR_UNSUPPORTED_PTX_VERSION", 500: "CUDA_ERROR_NOT_FOUND"}  # fmt: skip
CONTEXT = 7000  # and the number of the GPU


class StubDriver:
    """Stands for ``ctypes.CDLL("libcuda.so.1")``.

    Args:
        version: of the driver, 1000 times its major and 10 times its minor one.
        devices: how many GPUs there are.
        fails: the code that a function returns instead of doing anything, by its name.

    Attributes:
        launches: name, blocks, threads and stream of each launch.
    """

    def __init__(self, version: int = 12040, devices: int = 1, fails: dict[str, int] | None = None) -> None:
        self.version, self.devices, self.fails = version, devices, fails or {}
        self.machines: list[PTXMachine] = []
        self.functions: list[tuple[PTXMachine, str]] = []
        self.launches: list[tuple[str, int, int, int]] = []
        self.contexts: list[int] = []
        self.kept = [ctypes.create_string_buffer(name.encode()) for name in NAMES.values()]

    def __getattribute__(self, name: str) -> Any:
        if name.startswith("cu") and name in object.__getattribute__(self, "fails"):
            return lambda *_: self.fails[name]
        return object.__getattribute__(self, name)

    def cuInit(self, flags: Any) -> int:
        return 0 if self.devices else 100

    def cuDriverGetVersion(self, out: Any) -> int:
        out._obj.value = self.version
        return 0

    def cuGetErrorName(self, code: Any, out: Any) -> int:
        if code.value not in NAMES:
            return 1
        out._obj.value = NAMES[code.value].encode()
        return 0

    def cuGetErrorString(self, code: Any, out: Any) -> int:
        return 1

    def cuDeviceGetCount(self, out: Any) -> int:
        out._obj.value = self.devices
        return 0

    def cuDeviceGet(self, out: Any, ordinal: Any) -> int:
        out._obj.value = ordinal.value
        return 0 if ordinal.value < self.devices else 101

    def cuDevicePrimaryCtxRetain(self, out: Any, device: Any) -> int:
        out._obj.value = CONTEXT + device.value
        return 0

    def cuCtxPushCurrent_v2(self, context: Any) -> int:
        self.contexts.append(context.value)
        return 0

    def cuCtxPopCurrent_v2(self, out: Any) -> int:
        out._obj.value = self.contexts.pop()
        return 0

    def cuModuleLoadDataEx(self, out: Any, image: Any, count: Any, options: Any, values: Any) -> int:
        assert self.contexts, "no context is current"
        text = image.value.decode()
        if ".version 7.0" not in text:
            log = dict(zip(list(options), list(values), strict=True))
            message = b"ptxas application ptx input, line 1; fatal: no version\0"
            assert count.value == 2 and log[6] > len(message)
            ctypes.memmove(log[5], message, len(message))
            return 218
        self.machines.append(machine_of(text))
        out._obj.value = len(self.machines)
        return 0

    def cuModuleGetFunction(self, out: Any, module: Any, name: bytes) -> int:
        machine = self.machines[module.value - 1]
        if name.decode() not in machine.kernels:
            return 500
        self.functions.append((machine, name.decode()))
        out._obj.value = len(self.functions)
        return 0

    def cuLaunchKernel(self, function: Any, *arguments: Any) -> int:
        *sizes, shared, stream, places, extra = arguments
        blocks, *one, threads, two, three = (size.value for size in sizes)
        assert one == [1, 1] and (two, three, shared.value, extra) == (1, 1, 0, None) and self.contexts[-1] >= CONTEXT
        machine, name = self.functions[function.value - 1]
        words = [ctypes.c_uint64.from_address(place).value for place in places]
        assert len(words) == machine.kernels[name]
        self.launches.append((name, blocks, threads, stream.value or 0))
        machine.launch_words(name, blocks, threads, np.array(words, np.uint64))
        return 0
