"""NVIDIA's driver: finds a GPU, has it compile PTX, and starts kernels on arrays that somebody else owns.

The library is called through ctypes, so no CUDA package is needed. Contexts are the primary ones of the GPUs, which torch
uses, too: memory that torch allocated can be given to kernels by its address.
"""

import ctypes
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from segar.errors import SegarError

LIBRARY = "nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1"
OLDEST = 11000  # the first driver that reads PTX 7.0: of CUDA 11.0
THREADS = 128  # of a block
OUT_OF_MEMORY, INSUFFICIENT_DRIVER, NO_DEVICE, INVALID_DEVICE, UNSUPPORTED_PTX, STUB = 2, 35, 100, 101, 222, 34
ADVICE = {
    OUT_OF_MEMORY: "the GPU has too little memory left; take fewer environments, or end other programs that use it",
    INSUFFICIENT_DRIVER: "the driver is too old; install one of CUDA 11.0 or newer (R450)",
    NO_DEVICE: "this machine has no NVIDIA GPU, or none is visible; look at CUDA_VISIBLE_DEVICES and nvidia-smi",
    INVALID_DEVICE: "there is no GPU of that number",
    UNSUPPORTED_PTX: "the driver is too old for PTX 7.0; install one of CUDA 11.0 or newer (R450)",
    STUB: "the library is the CUDA toolkit's stub, not the driver's; install the driver",
}
ERROR_LOG, ERROR_LOG_SIZE = 5, 6  # options of the driver's compiler
LOG_BYTES = 8192


def load_library() -> Any:
    """The driver's library; raises :class:`SegarError` where there is none."""
    try:
        return ctypes.CDLL(LIBRARY)
    except OSError as cause:
        advice = "use a machine with one, or device='cpu'"
        raise SegarError(f"no NVIDIA driver: {LIBRARY} cannot be loaded ({cause}); {advice}") from cause


class Driver:
    """The driver of this machine.

    Args:
        library: with the functions of the driver; that of the machine where it is None.

    Raises:
        SegarError: there is no driver, it is too old, or there is no GPU.
    """

    def __init__(self, library: Any = None) -> None:
        self.library = load_library() if library is None else library
        self.call("cuInit", ctypes.c_uint(0))
        version = ctypes.c_int()
        self.call("cuDriverGetVersion", ctypes.byref(version))
        if version.value < OLDEST:
            raise SegarError(
                f"the NVIDIA driver is of CUDA {version.value // 1000}.{version.value % 1000 // 10}, which is too old for PTX"
                " 7.0; install one of CUDA 11.0 or newer (R450)"
            )

    def call(self, name: str, *arguments: Any) -> None:
        """Call a function of the driver; raises :class:`SegarError` with the driver's words if it fails."""
        code = getattr(self.library, name)(*arguments)
        if code:
            raise SegarError(f"{name}: {self._said(code)}{f'; {ADVICE[code]}' if code in ADVICE else ''}")

    def device(self, ordinal: int = 0) -> "Device":
        """The GPU of a number, from 0 on; raises :class:`SegarError` if there are not so many."""
        count = ctypes.c_int()
        self.call("cuDeviceGetCount", ctypes.byref(count))
        if not 0 <= ordinal < count.value:
            raise SegarError(f"there is no GPU {ordinal}: this machine has {count.value} (0 to {count.value - 1})")
        number, context = ctypes.c_int(), ctypes.c_void_p()
        self.call("cuDeviceGet", ctypes.byref(number), ctypes.c_int(ordinal))
        self.call("cuDevicePrimaryCtxRetain", ctypes.byref(context), number)  # until the process ends, like torch's
        return Device(self, ordinal, context)

    def _said(self, code: int) -> str:
        """The driver's name and words for an error."""
        found = []
        for function in ("cuGetErrorName", "cuGetErrorString"):
            text = ctypes.c_char_p()
            if not getattr(self.library, function)(ctypes.c_int(code), ctypes.byref(text)) and text.value:
                found.append(text.value.decode())
        return ": ".join(found) or f"error {code}"


@dataclass(frozen=True)
class Device:
    """A GPU in its primary context."""

    driver: Driver
    ordinal: int
    context: Any

    def kernels(self, ptx: str) -> dict[str, "Kernel"]:
        """The kernels of a PTX text by their names, compiled for this GPU.

        Raises:
            SegarError: the driver's compiler refuses the text; the message holds its log.
        """
        log = ctypes.create_string_buffer(LOG_BYTES)
        options = (ctypes.c_int * 2)(ERROR_LOG, ERROR_LOG_SIZE)
        values = (ctypes.c_void_p * 2)(ctypes.addressof(log), LOG_BYTES)
        module, image = ctypes.c_void_p(), ctypes.create_string_buffer(ptx.encode())
        with _Current(self):
            try:
                self.driver.call("cuModuleLoadDataEx", ctypes.byref(module), image, ctypes.c_uint(2), options, values)
            except SegarError as cause:
                said = log.value.decode(errors="replace").strip()
                raise SegarError(
                    f"GPU {self.ordinal} cannot load the kernels: {cause}{f'; {said}' if said else ''}"
                ) from cause
            found = {}
            for line in filter(lambda line: line.startswith(".visible .entry "), ptx.splitlines()):
                name = line.split()[2].rstrip("(")
                function = ctypes.c_void_p()
                self.driver.call("cuModuleGetFunction", ctypes.byref(function), module, name.encode())
                found[name] = Kernel(self, name, function)
        return found


@dataclass
class Kernel:
    """A kernel on a GPU, whose arguments take eight bytes each; see :func:`segar.engine.targets.ptx.ptx_module`."""

    device: Device
    name: str
    function: Any
    _words: Any = field(default=None, init=False)
    _places: Any = field(default=None, init=False)

    def launch(self, things: int, words: Sequence[int], stream: int = 0) -> None:
        """Start a thread for each thing on a stream, and return without waiting for them.

        Args:
            words: the arguments: whole numbers, addresses, and the bits of other numbers.
            stream: CUDA's handle of a stream.

        Raises:
            SegarError: the kernel cannot be started, or one that was started before has failed.
        """
        if things == 0:
            return
        if self._words is None or len(self._words) != len(words):
            self._words = (ctypes.c_uint64 * len(words))()
            start = ctypes.addressof(self._words)
            self._places = (ctypes.c_void_p * len(words))(*range(start, start + 8 * len(words), 8))
        self._words[:] = [word & 0xFFFFFFFFFFFFFFFF for word in words]
        blocks, one = ctypes.c_uint(-(-things // THREADS)), ctypes.c_uint(1)
        with _Current(self.device):
            self.device.driver.call(
                "cuLaunchKernel", self.function, blocks, one, one, ctypes.c_uint(THREADS), one, one, ctypes.c_uint(0),
                ctypes.c_void_p(stream), self._places, None,
            )  # fmt: skip


@dataclass
class _Current:
    """Makes a GPU's context the current one of the thread for a while."""

    device: Device

    def __enter__(self) -> None:
        self.device.driver.call("cuCtxPushCurrent_v2", self.device.context)

    def __exit__(self, *_: object) -> None:
        self.device.driver.call("cuCtxPopCurrent_v2", ctypes.byref(ctypes.c_void_p()))
