"""The task that simulator and interpreter have where none is given."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from segar.errors import SegarError

if TYPE_CHECKING:
    from segar.language.task import Task

_default: list[Callable[[], Task]] = []


def set_default_task(make: Callable[[], Task]) -> None:
    """Set the task that simulator and interpreter have where none is given; :mod:`segar.tasks` calls this once."""
    _default[:] = [make]


def default_task() -> Task:
    """The task that is used where none is given: PuttPutt, once :mod:`segar.tasks` is imported."""
    if not _default:
        raise SegarError("no default task is registered; import segar, or give task=")
    return _default[0]()
