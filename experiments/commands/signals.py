"""The signals that stop a run, or make it write a checkpoint and go on.

SIGTERM and SIGINT (Ctrl-C) stop a run: it finishes its iteration, writes a checkpoint, and ends. SIGUSR1 and SIGUSR2, which
Slurm sends some time before it ends a job (``sbatch --signal=USR1@120``), make it write a checkpoint and go on. A handler
that another library has installed, such as submitit's, which puts a job back into the queue, is called once the checkpoint
is written. A signal that the process ignores stays ignored.
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
    """A signal ended the run. It is no :class:`Exception`, because it ends the whole command, not one run of it."""

    def __init__(self, number: int, where: str = "") -> None:
        self.signal = signal.Signals(number)
        super().__init__(f"stopped by {self.signal.name}{where}")


class SignalMonitor:
    """Collects signals while a run is at work.

    Inside a ``with`` block of it, signals wait until :meth:`handle_pending` is called. Outside of such a block a stopping
    signal raises :class:`Stopped` at once, as does one that comes in for the second time while the first one waits.
    """

    def __init__(self) -> None:
        self.deferring = False
        self.pending: list[int] = []  # signals that wait for a checkpoint
        self._other_handlers: dict[int, Any] = {}  # by signal; installed before this monitor

    def __enter__(self) -> SignalMonitor:
        self.deferring = True
        return self

    def __exit__(self, *_: object) -> None:
        self.deferring = False

    def handle_pending(self, where: str) -> None:
        """Acts on the signals that wait. Call it after the checkpoint is written.

        Raises:
            Stopped: a stopping signal came in that no other handler takes; ``where`` ends its message.
        """
        pending, self.pending = self.pending, []
        for number in pending:
            if number in self._other_handlers:
                self._other_handlers[number](number, None)
            elif number in STOPPING:
                raise Stopped(number, where)

    def receive(self, number: int, frame: Any) -> None:
        """The handler that is installed for all signals."""
        if self.deferring and number not in self.pending:
            self.pending.append(number)
            # Not print: a signal may come in the middle of another print.
            os.write(2, f"{signal.Signals(number).name}: writes a checkpoint after this iteration\n".encode())
        elif number in self._other_handlers:
            self._other_handlers[number](number, frame)
        elif number in STOPPING:
            self.pending.clear()
            raise Stopped(number)

    def install(self) -> dict[int, Any]:
        """Replaces the handlers of all signals; returns the handlers that were installed before."""
        before = {}
        for number in (*STOPPING, *SAVING):
            handler = signal.getsignal(number)
            if handler is signal.SIG_IGN or handler is None:
                continue
            if callable(handler) and handler is not signal.default_int_handler:
                self._other_handlers[number] = handler
            before[number] = signal.signal(number, self.receive)
        return before


@contextmanager
def watch_signals() -> Iterator[SignalMonitor]:
    """Monitors signals inside the block. Outside of the main thread no signals come in, and nothing is installed."""
    monitor = SignalMonitor()
    before = monitor.install() if threading.current_thread() is threading.main_thread() else {}
    try:
        yield monitor
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        stopping = [number for number in monitor.pending if number in STOPPING]
        if stopping:  # the run ended for another reason before it could act on the signal
            os.kill(os.getpid(), stopping[0])
