"""Tasks by name: the built-in ones, those of users, and the one that levels were made for."""

from collections.abc import Callable, Mapping
from typing import Any

from segar.errors import LevelError, SegarError, did_you_mean
from segar.language import Task
from segar.levels import Levels
from segar.support import made, named_object
from segar.tasks.billiards_task import billiards
from segar.tasks.invisiball_task import invisiball
from segar.tasks.puttputt_task import puttputt

TASKS: dict[str, Callable[..., Task]] = {"puttputt": puttputt, "billiards": billiards, "invisiball": invisiball}


def find_task(name: str) -> Callable[..., Task] | Task:
    """The function that makes the task of that name: one of ``TASKS``, or the object that ``module:attribute`` names.

    Raises:
        SegarError: there is no such task; the message has the nearest name.
    """
    if name not in TASKS and ":" not in name:
        raise SegarError(
            f"no task is called '{name}'.{did_you_mean(name, TASKS)} One of your own is 'module:attribute'"
        )
    return TASKS[name] if name in TASKS else named_object(name)


def make_task(name: str, options: Mapping[str, Any] | None = None) -> Task:
    """The task of that name with these options, and defaults for all others.

    Raises:
        SegarError: there is no such task, or what ``module:attribute`` names is neither a task nor a function that makes
            one.
    """
    found: Any = made(name, find_task(name), options)
    if not isinstance(found, Task):
        raise SegarError(f"'{name}' is no segar.Task, nor a function that makes one, but {found!r}")
    return found


def task_of(levels: Levels, options: Mapping[str, Any] | None = None) -> Task:
    """The task that the levels' distribution names, with these options; PuttPutt where it names none.

    Raises:
        SegarError: there is no such task, or a level file names one that is not built in: a file imports no code.
    """
    name = levels.task or "puttputt"
    if name not in TASKS and levels.distribution is None:
        raise LevelError(
            f"these levels were saved for the task '{name}', which a level file does not hold; give task= (--task)"
        )
    return make_task(name, options)
