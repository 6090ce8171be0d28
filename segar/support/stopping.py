"""Work that can be stopped between its parts: loops that take long ask whether somebody still wants what they find."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar


class Stopped(Exception):
    """Work was stopped before it was done."""


_STOP: ContextVar[threading.Event | None] = ContextVar("stop", default=None)


@contextmanager
def stoppable(stop: threading.Event) -> Iterator[None]:
    """Have the work inside the block raise :class:`Stopped` at the end of a part once ``stop`` is set."""
    before = _STOP.set(stop)
    try:
        yield
    finally:
        _STOP.reset(before)


def end_of_part() -> None:
    """Raise :class:`Stopped` if this work was stopped; it never is outside of :func:`stoppable`."""
    stop = _STOP.get()
    if stop is not None and stop.is_set():
        raise Stopped
