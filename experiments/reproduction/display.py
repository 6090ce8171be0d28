"""Shows jobs at work: on a terminal a bar for all and one for each; without a terminal a line when a job ends."""

import re
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from experiments.reproduction.process_pool import Job, JobResult

LOOK_INTERVAL = 1.0  # [s] between looks at the logs
TAIL = 4096  # bytes at the end of a log that are looked at
FRAMES = re.compile(r": ([\d,]+) of ([\d,]+) frames")  # what experiments.training.progress writes to a log
PROBES_BEGIN = re.compile(r": probes$", re.MULTILINE)  # what experiments.evaluation.probing does


@dataclass
class Display:
    """Shows jobs at work.

    Args:
        jobs: name to job.
        weights: name to expected seconds.
        line: formats the result of a job as one line.
    """

    jobs: Mapping[str, Job]
    weights: Mapping[str, float]
    line: Callable[[JobResult], str]
    console: Console = field(default_factory=lambda: Console(file=sys.stdout, soft_wrap=True))
    ended: int = 0
    _bars: Progress | None = None
    _whole: TaskID | None = None
    _own: dict[str, TaskID] = field(default_factory=dict)
    _over: set[str] = field(default_factory=set)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    @contextmanager
    def shown(self) -> Iterator[None]:
        """Shows the jobs inside the block."""
        if not self.console.is_terminal or not self.jobs:
            yield
            return
        columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
        with Progress(*columns, TimeRemainingColumn(), console=self.console, transient=True) as self._bars:
            self._whole = self._bars.add_task("all", total=len(self.jobs))
            stop = threading.Event()
            watcher = threading.Thread(target=self._watch, args=(stop,), daemon=True)
            watcher.start()
            try:
                yield
            finally:
                stop.set()
                watcher.join()
        self._bars = None

    def end(self, result: JobResult) -> None:
        """Shows that a job has ended."""
        self.ended += 1
        name = result.job.name
        with self._lock:
            self._over.add(name)
            if self._bars is not None and name in self._own:
                self._bars.remove_task(self._own.pop(name))
            if self._bars is not None and self._whole is not None:
                self._bars.update(self._whole, completed=self.ended)
        self.console.print(f"[{self.ended}/{len(self.jobs)}] {self.line(result)}", markup=False, highlight=False)

    def share_left(self) -> float:
        """The share of the expected time that belongs to jobs which have not ended."""
        total = sum(self.weights.values())
        return sum(value for name, value in self.weights.items() if name not in self._over) / total if total else 0.0

    def _watch(self, stop: threading.Event) -> None:
        while not stop.wait(LOOK_INTERVAL):
            for name, job in self.jobs.items():
                with self._lock:
                    if self._bars is None or name in self._over or not job.log.exists():
                        continue
                    done, total, is_probed = progress_in(job.log)
                    if name not in self._own:
                        self._own[name] = self._bars.add_task(name, total=total or None)
                    shown = f"{name}, probes" if is_probed else name
                    self._bars.update(self._own[name], completed=done, total=total or None, description=shown)


def progress_in(log: Path) -> tuple[int, int, bool]:
    """Frames done and frames in all by the last such line of a log (0, 0 without one), and whether probes have begun."""
    try:
        with log.open("rb") as stream:
            stream.seek(max(log.stat().st_size - TAIL, 0))
            text = stream.read().decode(errors="replace")
    except OSError:
        return 0, 0, False
    found = FRAMES.findall(text)
    done, total = (int(number.replace(",", "")) for number in found[-1]) if found else (0, 0)
    return done, total, bool(PROBES_BEGIN.search(text))
