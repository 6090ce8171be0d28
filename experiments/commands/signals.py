"""Signals that a run is stopped by: it finishes what it is at, writes a checkpoint, and then gives way.

SIGTERM and SIGINT (Ctrl-C) stop a run. SIGUSR1 and SIGUSR2, which Slurm sends some time before it ends a job
(``sbatch --signal=USR1@120``), make it write a checkpoint and go on. Where somebody else handles a signal, as
submitit does to put a job back into the queue, that handler is called once the checkpoint is written; what is ignored
(in processes whose owner decides for them) stays ignored.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

STOPPING = (signal.SIGTERM, signal.SIGINT)
SAVING = (signal.SIGUSR1, signal.SIGUSR2)


class Stopped(KeyboardInterrupt):
    """A signal ended the run; not an :class:`Exception`, because it is meant for the whole command, not for one run."""

    def __init__(self, number: int, where: str = "") -> None:
        self.signal = signal.Signals(number)
        super().__init__(f"stopped by {self.signal.name}{where}")


class Watch:
    """The signals that come in. In a ``with`` block of it they wait for :meth:`answer`; elsewhere, a stopping one raises
    :class:`Stopped` at once, as does one that comes in for the second time while it waits."""

    def __init__(self) -> None:
        self.deferring = False
        self._waiting: list[int] = []
        self._others: dict[int, Any] = {}  # handlers that were there before, by signal

    @property
    def pending(self) -> bool:
        """Whether a checkpoint is asked for."""
        return bool(self._waiting)

    @property
    def stopping(self) -> int | None:
        """The stopping signal that came in and was not answered."""
        return next((number for number in self._waiting if number in STOPPING), None)

    def __enter__(self) -> Watch:
        self.deferring = True
        return self

    def __exit__(self, *_: object) -> None:
        self.deferring = False

    def answer(self, where: str) -> None:
        """Does what the signals that came in ask for, now that the checkpoint is written.

        Raises:
            Stopped: a stopping signal came in that nobody else handles; ``where`` ends its message.
        """
        waiting, self._waiting = self._waiting, []
        for number in waiting:
            if number in self._others:
                self._others[number](number, None)
            elif number in STOPPING:
                raise Stopped(number, where)

    def take(self, number: int, frame: Any) -> None:
        """The handler of all watched signals."""
        if self.deferring and number not in self._waiting:
            self._waiting.append(number)
            # Not print: a signal may come in the middle of another print.
            os.write(2, f"{signal.Signals(number).name}: writes a checkpoint after this iteration\n".encode())
        elif number in self._others:
            self._others[number](number, frame)
        elif number in STOPPING:
            self._waiting.clear()
            raise Stopped(number)

    def begin(self) -> dict[int, Any]:
        """Takes over the signals; returns the handlers that were there before."""
        before = {}
        for number in (*STOPPING, *SAVING):
            there = signal.getsignal(number)
            if there is signal.SIG_IGN or there is None:
                continue
            if callable(there) and there is not signal.default_int_handler:
                self._others[number] = there
            before[number] = signal.signal(number, self.take)
        return before


@contextmanager
def watch_signals() -> Iterator[Watch]:
    """Watches signals inside the block. In a thread that is not the main one there is nothing to watch."""
    watch = Watch()
    if threading.current_thread() is not threading.main_thread():
        yield watch
        return
    before = watch.begin()
    try:
        yield watch
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if watch.stopping is not None:  # the run ended for another reason before it could give way
            os.kill(os.getpid(), watch.stopping)
