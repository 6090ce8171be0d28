"""Tasks by name: the built-in ones, one's own, and the one that levels were made for."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from segar.errors import LevelError, SegarError, did_you_mean
from segar.tasks.task import Task

if TYPE_CHECKING:
    from segar.levels import Levels

TASKS = {name: f"segar.tasks.{name}:{name}" for name in ("puttputt", "billiards", "invisiball")}


def find_task(name: str) -> Callable[..., Task] | Task:
    """The function that makes the task of that name: one of ``TASKS``, or what ``module:attribute`` names.

    Raises:
        SegarError: there is no such task; the message says the nearest name.
    """
    module, _, attribute = TASKS.get(name, name).partition(":")
    if not attribute:
        raise SegarError(
            f"no task is called '{name}'.{did_you_mean(name, TASKS)} One of your own is 'module:attribute'"
        )
    try:
        found: Any = importlib.import_module(module)
    except ImportError as error:
        raise SegarError(f"the task '{name}' cannot be imported: {error}") from error
    if not hasattr(found, attribute):
        raise SegarError(f"'{module}' has no '{attribute}'.{did_you_mean(attribute, vars(found))}")
    return getattr(found, attribute)


def task_of(levels: Levels) -> Task:
    """The task that the levels' distribution names, with its default options; PuttPutt where it names none.

    Raises:
        SegarError: there is no such task, or a level file names one that is not built in: a file imports no code.
    """
    name = levels.task or "puttputt"
    if name not in TASKS and levels.distribution is None:
        raise LevelError(f"these levels were saved for the task '{name}', which a level file does not hold; give task=")
    found = find_task(name)
    return found if isinstance(found, Task) else found()
