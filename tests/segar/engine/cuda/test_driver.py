"""The driver of NVIDIA GPUs, played by a stub: what is called, and what is said where something is missing."""

import ctypes.util

import numpy as np
import pytest

from segar.engine import Argument, Entry, build_kernel
from segar.engine.cuda.driver import LIBRARY, THREADS, Driver
from segar.errors import SegarError
from tests.segar.engine.cuda.stub_driver import StubDriver

SOURCE = """
from numba import njit

@njit(error_model="numpy", nogil=True, _nrt=False)
def twice(start, stop, factor, x, y):
    for e in range(start, stop):
        y[e] = factor * x[e]
"""
ENTRY = Entry(
    "twice", SOURCE, (Argument("factor", "float64"), *(Argument(n, "float64", ("things",)) for n in "xy")), "things"
)


@pytest.fixture(scope="module")
def ptx() -> str:
    return build_kernel([ENTRY], "ptx").code.decode()


def test_a_launch_runs_one_thread_per_thing_on_the_stream(ptx):
    stub, count = StubDriver(devices=2), 300
    kernel = Driver(stub).device(1).kernels(ptx)["twice"]
    x, y = np.arange(float(count)), np.zeros(count)
    kernel.launch(
        count, [0, count, count, int(np.float64(2.5).view(np.int64)), x.ctypes.data, y.ctypes.data], stream=42
    )
    assert np.array_equal(y, 2.5 * x)
    assert stub.launches == [("twice", -(-count // THREADS), THREADS, 42)]
    assert stub.contexts == []  # what was current before is current again


def test_a_launch_of_nothing_starts_nothing(ptx):
    stub = StubDriver()
    Driver(stub).device().kernels(ptx)["twice"].launch(0, [0] * 6)
    assert stub.launches == []


@pytest.mark.skipif(ctypes.util.find_library("cuda") is not None, reason="this machine has a driver")
def test_a_machine_without_a_driver_is_told_so():
    with pytest.raises(SegarError, match=rf"no NVIDIA driver: {LIBRARY} cannot be loaded .*device='cpu'"):
        Driver()


@pytest.mark.parametrize(
    ("stub", "said"),
    [
        (StubDriver(devices=0), "CUDA_ERROR_NO_DEVICE; this machine has no NVIDIA GPU"),
        (StubDriver(version=10020), "driver is of CUDA 10.2, which is too old for PTX 7.0"),
        (StubDriver(fails={"cuInit": 35}), "the driver is too old"),
        (StubDriver(fails={"cuInit": 34}), "the library is the CUDA toolkit's stub"),
        (StubDriver(fails={"cuInit": 12345}), "cuInit: error 12345$"),
    ],
)
def test_a_driver_of_no_use_is_told_so(stub, said):
    with pytest.raises(SegarError, match=said):
        Driver(stub)


@pytest.mark.parametrize("ordinal", [-1, 2])
def test_a_gpu_that_is_not_there_is_refused(ordinal):
    with pytest.raises(SegarError, match=rf"there is no GPU {ordinal}: this machine has 2 \(0 to 1\)"):
        Driver(StubDriver(devices=2)).device(ordinal)


def test_an_error_of_the_drivers_compiler_holds_its_log():
    with pytest.raises(SegarError, match=r"GPU 0 cannot load the kernels: .*INVALID_PTX; ptxas application"):
        Driver(StubDriver()).device().kernels("nonsense")


def test_a_driver_that_cannot_read_the_ptx_is_told_to_be_too_old(ptx):
    with pytest.raises(SegarError, match=r"UNSUPPORTED_PTX_VERSION; the driver is too old for PTX 7.0"):
        Driver(StubDriver(fails={"cuModuleLoadDataEx": 222})).device().kernels(ptx)


def test_too_little_memory_for_a_launch_is_told(ptx):
    kernel = Driver(StubDriver(fails={"cuLaunchKernel": 2})).device().kernels(ptx)["twice"]
    with pytest.raises(SegarError, match=r"cuLaunchKernel: CUDA_ERROR_OUT_OF_MEMORY; .* take fewer environments"):
        kernel.launch(1, [0] * 6)
