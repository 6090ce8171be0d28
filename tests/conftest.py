"""What pytest collects and reports: the paper's listings only where they are at hand; the agreement with 2022 last."""

import ctypes
import gc
import os
import sys
from pathlib import Path

import pytest

# Tests run side by side, and threads of BLAS that wait for each other spin: with as many of them as processors, small
# matrices take ten times as long. This must be said before numpy is loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.pop("COLUMNS", None)  # pytest-xdist says 80, where nothing is a terminal

from hypothesis import HealthCheck, settings

from segar.engine.compiler.running_kernel import RunningKernel
from tests.agreement import summary

# Machines are shared: how long an example took says nothing about the test.
settings.register_profile("shared", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("shared")

TRIM = getattr(ctypes.CDLL(None), "malloc_trim", None)  # of glibc
PAPER = Path(os.environ.get("SEGAR_PAPER", Path(__file__).parents[2] / "shared" / "paper" / "segar.tex"))

collect_ignore = [] if PAPER.is_file() else ["project/test_paper_listings.py"]


# Files that take long are begun first, so that no worker is left with one of them when the others are done. Those that compile
# the kernels of others begin, each other ones: what several files ask for at once is compiled by each of them.
LONG = (
    "playground/test_bits", "envs/test_device", "targets/test_targets", "engine/test_agreement", "playground/test_studio",
    "lab/test_grades", "engine/", "experiments/",
)  # fmt: skip


# Where compiled kernels are the point.
COMPILED = tuple(
    f"tests/segar/{name}.py"
    for name in ("engine/test_agreement", "engine/test_cache", "engine/test_mathematics_in_rules", "envs/test_threads")
)


BESIDE = RunningKernel._is_compiled_beside  # steps go on as Python while another process compiles
BROWSERS = {"browser", "chromium", "firefox"}  # fixtures; their tests are those of `make test-browser`


@pytest.hookimpl(tryfirst=True)  # before pytest leaves out what the command does not ask for
def pytest_collection_modifyitems(items) -> None:
    for item in items:
        if item.nodeid.startswith(COMPILED):
            item.add_marker("compiled")
        if not BROWSERS.isdisjoint(item.fixturenames):
            item.add_marker("browser")
    items.sort(key=lambda item: next((k for k, part in enumerate(LONG) if part in item.nodeid), len(LONG)))


def pytest_collection_finish() -> None:
    """What was imported and collected stays: no search for garbage needs to look at it again, and compilers make much."""
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)
    if torch := sys.modules.get("torch"):
        torch.set_num_threads(1)  # as in every run: tests side by side would wait for each other's cores


def pytest_runtest_teardown(item, nextitem) -> None:
    """After a module, the memory that its tests left goes back to the system: a worker runs thousands of tests."""
    if TRIM is not None and (nextitem is None or nextitem.module is not item.module):
        TRIM(0)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item) -> None:
    """Before its fixtures: whether the worlds of a test are compiled, or run as plain Python for longer than users wait."""
    os.environ["SEGAR_PATIENCE"] = "0" if item.get_closest_marker("compiled") else "3"
    # Tests side by side leave no processor for that, and steps as Python would take from those that there are.
    RunningKernel._is_compiled_beside = BESIDE if "test_running_kernel" in item.nodeid else lambda *_: False


def pytest_sessionfinish(session) -> None:
    """A worker hands its findings to the process that reports."""
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["agreement"] = summary.lines


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node) -> None:
    summary.lines += getattr(node, "workeroutput", {}).get("agreement", [])


def pytest_terminal_summary(terminalreporter) -> None:
    if summary.lines:
        heading, *lines = summary.lines
        terminalreporter.section(heading)
        for line in lines:
            terminalreporter.line(line)
    reasons = [one.longrepr[2] for one in terminalreporter.stats.get("skipped", ()) if isinstance(one.longrepr, tuple)]
    missing = sorted({reason.removeprefix("Skipped: ") for reason in reasons if "is not installed" in reason})
    for text in missing:
        terminalreporter.section(f"pages were not tested: {text}")


@pytest.fixture
def eager_threads(monkeypatch) -> None:
    """Worker threads join every call, however short."""
    monkeypatch.setattr("segar.support.threads.WORTH_WAKING", -1.0)
