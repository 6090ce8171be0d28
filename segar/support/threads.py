"""Threads over the batch: workers that help their caller, which never waits for a worker to wake up."""

import ctypes
import itertools
import os
import threading
import time
from collections.abc import Callable
from typing import Any, Protocol

PARTS_EACH = 4  # of a range for each thread, so that the last part is short
WORTH_WAKING = 100e-6  # [s] a shorter call is over before a sleeping worker has woken up


def cores() -> int:
    """How many cores this process may use; macOS knows only how many there are."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Work(Protocol):
    """Something whose parts several threads can take, each part once."""

    def do(self, owns: bool) -> None:
        """Take parts and do them. The owner returns when all parts are done, the others some time after none is left.

        The heavy part of the work runs without the interpreter's lock.
        """

    def dismiss(self) -> None:
        """Let the threads that only wait for parts return at once."""


class Team:
    """The caller and some workers, for work of one kind; all teams of the process share the workers.

    Args:
        num_threads: threads that take part, the caller among them.
    """

    def __init__(self, num_threads: int) -> None:
        self._workers = _first_workers(num_threads - 1)
        self._seconds = 0.0  # that the last work took; of a range, a piece of it

    def do(self, work: Work) -> None:
        """Do the work, with all workers that are awake for it; call the others where it lasts long enough."""
        start = time.perf_counter()
        if self._seconds > WORTH_WAKING:
            self._call_all(work)
        work.do(True)
        self._seconds = time.perf_counter() - start

    def _call_all(self, work: Work) -> None:
        """Call all workers that have not joined this work yet."""
        for worker in self._workers:
            if worker.at_work is not work:
                worker.call(work)

    def do_range(self, function: Callable[[int, int], Any], count: int) -> None:
        """Call ``function(start, stop)`` over parts of ``range(count)``; an exception of any part is raised."""
        start = time.perf_counter()
        if self._workers and self._seconds * count > WORTH_WAKING:
            self._call_all(work := _RangeWork(function, count, min(count, PARTS_EACH * (1 + len(self._workers)))))
            work.do(True)
        else:
            function(0, count)
        self._seconds = (time.perf_counter() - start) / max(count, 1)


class _Worker:
    """A thread that joins the latest work that it was called to, and sleeps when there is none."""

    def __init__(self) -> None:
        self.at_work: Work | None = None
        self._next: Work | None = None
        self._called = threading.Event()
        self._kept_off = -1  # the processor where it must not run
        self._thread = threading.Thread(target=self._serve, name="segar", daemon=True)
        self._thread.start()

    def call(self, work: Work) -> None:
        """Join this work as soon as possible."""
        before, self._next = self.at_work, work
        if before is not None:
            before.dismiss()
        self._keep_off(_processor())
        self._called.set()

    def _keep_off(self, processor: int) -> None:
        """Keep this thread off the caller's processor, where schedulers like to wake it and where it would only wait."""
        if processor in (-1, self._kept_off):
            return
        others = os.sched_getaffinity(0) - {processor}
        if others:
            os.sched_setaffinity(self._thread.native_id or 0, others)
        self._kept_off = processor

    def _serve(self) -> None:
        while True:
            self._called.wait()
            self._called.clear()
            self.at_work, self._next = self._next, None
            if self.at_work is not None:
                self.at_work.do(False)
            self.at_work = None


class _RangeWork:
    """``function(start, stop)`` over a range in equal parts."""

    def __init__(self, function: Callable[[int, int], Any], count: int, parts: int) -> None:
        self._function, self._count, self._parts = function, count, parts
        self._next = itertools.count()
        self._finished = threading.Semaphore(0)
        self._errors: list[BaseException] = []

    def do(self, owns: bool) -> None:
        for part in self._next:
            if part >= self._parts:
                break
            try:
                self._function(self._count * part // self._parts, self._count * (part + 1) // self._parts)
            except BaseException as error:
                self._errors.append(error)
            self._finished.release()
        if owns:
            for _ in range(self._parts):
                self._finished.acquire()
            if self._errors:
                raise self._errors[0]

    def dismiss(self) -> None:
        """Nothing to do: only the owner waits."""


def _find_processor() -> Callable[[], int]:
    """The C library's function for the processor that the calling thread runs on; where it is missing, one that gives -1."""
    try:
        return ctypes.CDLL(None).sched_getcpu
    except (AttributeError, OSError, TypeError):
        return lambda: -1


_processor = _find_processor()
_workers: list[_Worker] = []
_lock = threading.Lock()


def _first_workers(count: int) -> list[_Worker]:
    with _lock:
        while len(_workers) < count:
            _workers.append(_Worker())
        return _workers[:count]


def _forget_threads() -> None:
    """A forked child has none of its parent's threads: start new ones on first use."""
    global _lock
    _workers.clear()
    _lock = threading.Lock()


os.register_at_fork(after_in_child=_forget_threads)
