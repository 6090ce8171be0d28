"""Tasks by name: the built-in ones, those of users, and the one that levels were made for."""

from collections.abc import Callable, Collection, Mapping
from typing import Any

from segar.errors import SegarError
from segar.language import Task
from segar.levels import Levels
from segar.support import EVERYTHING, made, resolve
from segar.tasks.billiards_task import billiards
from segar.tasks.conditional_task import conditional_puttputt
from segar.tasks.invisiball_task import invisiball
from segar.tasks.puttputt_task import puttputt

TASKS: dict[str, Callable[..., Task]] = {
    "puttputt": puttputt,
    "billiards": billiards,
    "invisiball": invisiball,
    "conditional_puttputt": conditional_puttputt,
}


def make_task(name: str, options: Mapping[str, Any] | None = None, *, trusted: Collection[str] = (EVERYTHING,)) -> Task:
    """The task of that name with these options, and defaults for all others.

    Args:
        trusted: packages whose tasks may be named; none where a file names the task, which brings no code.

    Raises:
        SegarError: there is no such task, it is not trusted, or what ``module:attribute`` names is neither a task nor a
            function that makes one.
    """
    found: Any = made(name, resolve(name, TASKS, "task", trusted), options)
    if not isinstance(found, Task):
        raise SegarError(f"'{name}' is no segar.Task, nor a function that makes one, but {found!r}")
    return found


def task_of(levels: Levels, options: Mapping[str, Any] | None = None) -> Task:
    """The task that the levels' distribution names, with these options; PuttPutt where it names none.

    Raises:
        SegarError: there is no such task, or a level file names one that is not built in: a file imports no code.
    """
    return make_task(levels.task or "puttputt", options, trusted=() if levels.distribution is None else (EVERYTHING,))
