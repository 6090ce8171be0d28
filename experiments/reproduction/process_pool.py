"""Several runs on one machine: a pool of processes with a log for each run.

This module adds three things to :class:`concurrent.futures.ProcessPoolExecutor`. The output of a run goes to its log; a
process that dies abruptly ends only the runs that are at work; and the processes end with this one, even when this one is
killed. For several machines there are Hydra's launchers.
"""

import multiprocessing
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from segar.experiments.runs.files import make_folder
from segar.support import escape_what_cannot_be_printed

LAST_WORDS = 10.0  # [s] for a checkpoint, when the owner of the pool has ended


@dataclass(frozen=True)
class Job:
    """One run: its unique name, the argument of its work, and the file for its output."""

    name: str
    argument: Any
    log: Path


@dataclass(frozen=True)
class JobResult:
    """How a job ended."""

    job: Job
    seconds: float
    error: str | None  # the last line of what went wrong
    result: Any = None  # the value that the work returned


def run_jobs(
    jobs: Sequence[Job],
    work: Callable[[Any], Any],
    processes: int,
    ended: Callable[[JobResult], None] = lambda _: None,
) -> list[JobResult]:
    """Calls ``work(job.argument)`` for every job, ``processes`` at a time, and ``ended`` with each result at once.

    ``work`` must be importable by name. An error of one job does not stop the others; Ctrl-C stops all.
    """
    results: dict[str, JobResult] = {}  # by the names of their jobs

    def end(result: JobResult) -> None:
        results[result.job.name] = result
        ended(result)

    for job in jobs:
        make_folder(job.log.parent)
        job.log.unlink(missing_ok=True)  # a log that exists says that its job has begun
    while remaining := [job for job in jobs if job.name not in results]:
        _run_pool(remaining, work, processes, end)
    return [*results.values()]


def _run_pool(jobs: list[Job], work: Callable[[Any], Any], processes: int, end: Callable[[JobResult], None]) -> None:
    """Runs jobs until all have ended or a process died abruptly, which ends every job that had begun."""
    began = time.monotonic()
    broken: list[Job] = []
    with _pool(processes) as pool:
        futures: dict[Future[JobResult], Job] = {pool.submit(_run_job, work, job): job for job in jobs}
        for future in as_completed(futures):
            job = futures[future]
            error = future.exception()
            if isinstance(error, BrokenProcessPool):
                broken.append(job)
            else:
                told = f"{type(error).__name__}: {error}"
                end(future.result() if error is None else JobResult(job, time.monotonic() - began, told))
    begun = [job for job in broken if job.log.exists()]
    for job in begun or broken[:1]:  # at least one, or a pool that cannot start would be tried for ever
        end(JobResult(job, time.monotonic() - began, "its process, or one beside it, ended abruptly (out of memory?)"))


@contextmanager
def _pool(processes: int) -> Iterator[ProcessPoolExecutor]:
    # In its own processes, joblib sets a method that no other process knows.
    if multiprocessing.get_start_method() not in multiprocessing.get_all_start_methods():
        multiprocessing.set_start_method("spawn", force=True)
    context = multiprocessing.get_context("spawn")  # threads of numba and torch do not survive a fork
    reader, writer = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(processes, context, initializer=_begin_process, initargs=(reader,))
    try:
        yield pool
        pool.shutdown()
    finally:
        writer.close()  # also what the end of this process does: the others stop
        pool.shutdown(wait=False, cancel_futures=True)


def _begin_process(reader: Connection) -> None:
    """Prepares a process of the pool: one thread for linear algebra, and an end when the pool's owner has ended."""
    # Two processes whose numpy has two threads each wait for one another. The variables are for libraries yet to be loaded.
    os.environ.update(OMP_NUM_THREADS="1", MKL_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
    threadpool_limits(1)
    escape_what_cannot_be_printed()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all processes; the owner decides

    def end_with_owner() -> None:
        reader.poll(None)  # nothing is ever sent: this returns when the other end is closed
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(LAST_WORDS)
        os.kill(os.getpid(), signal.SIGKILL)

    threading.Thread(target=end_with_owner, daemon=True).start()


def _run_job(work: Callable[[Any], Any], job: Job) -> JobResult:
    began = time.monotonic()
    error = result = None
    with _output_to(job.log):
        try:
            result = work(job.argument)
        except Exception as problem:  # the result reports it; the other jobs continue
            traceback.print_exc()
            error = f"{type(problem).__name__}: {problem}"
        except KeyboardInterrupt:  # the run wrote a checkpoint and stopped on a signal; this process ends, too
            traceback.print_exc()
            sys.stderr.flush()
            os._exit(1)
    return JobResult(job, time.monotonic() - began, error, result)


@contextmanager
def _output_to(log: Path) -> Iterator[None]:
    """Sends all output of this process to ``log``, that of C libraries included."""
    kept = os.dup(1), os.dup(2)
    with log.open("w", encoding="utf-8") as stream:
        os.dup2(stream.fileno(), 1)
        os.dup2(stream.fileno(), 2)
    try:
        yield
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        for number, original in zip((1, 2), kept, strict=True):
            os.dup2(original, number)
            os.close(original)
