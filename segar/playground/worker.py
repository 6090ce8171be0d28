"""A process that answers questions one after the other, of which each can be ended at any moment.

A question is answered by a fork of the process that holds the state, while this one watches over the fork. A fork whose answer
was wanted takes the place of its parent. One that is ended leaves nothing: no half change, no memory, no threads.
"""

import os
import resource
import signal
import time
import traceback
import warnings
from collections.abc import Callable
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NoReturn

LOOK = 0.02  # [s] after which it is seen whether an answer is there or is wanted
Answer = Callable[[Any], Any]


class Worker:
    """Answers questions in another process, which ends with this one.

    Args:
        answer: a function of a question, which may change what it knows; all plain data.
        memory: how many bytes the work may take, over all questions, beyond what this process has now; what takes more is a
            ``MemoryError``, on Linux, where the system says how much a process has.
    """

    def __init__(self, answer: Answer, memory: int) -> None:
        self._here, there = Pipe()
        self._number = 0
        if _fork() == 0:
            self._here.close()
            os.setsid()  # Ctrl-C is for the first process alone
            _bound(memory)
            _serve(there, answer)
        there.close()

    def ask(self, question: Any) -> None:
        """Begin to answer a question; the one before must be answered or stopped."""
        self._number += 1
        self._tell((self._number, question))

    def answered(self) -> Any:
        """The answer; None as long as it is not there. Raises :class:`EOFError` where the work ended without one."""
        while self._here.poll():
            number, answer = self._here.recv()
            if number == self._number:
                if answer is None:
                    raise EOFError
                self._tell(True)
                return answer
        return None

    def stop(self) -> None:
        """End the work on the present question, whose answer is dropped if it is there already."""
        self._number += 1
        self._tell(False)

    def close(self) -> None:
        """End the process, whatever it does."""
        self._here.close()

    def _tell(self, word: Any) -> None:
        with suppress(OSError):  # the answer will be that nobody is there any more
            self._here.send(word)


def _fork() -> int:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads, none of which the new process needs
        return os.fork()


def _bound(memory: int) -> None:
    """Let this process and its forks take so many bytes more than it has, unless they may have fewer anyway."""
    taken = Path("/proc/self/statm")
    if taken.exists():
        soft, hard = resource.getrlimit(resource.RLIMIT_AS)
        wanted = int(taken.read_bytes().split()[0]) * resource.getpagesize() + memory
        resource.setrlimit(resource.RLIMIT_AS, (wanted if soft == resource.RLIM_INFINITY else min(soft, wanted), hard))


def _serve(there: Connection, answer: Answer) -> NoReturn:
    """Have a fork answer each question, until the other end of the pipe is closed."""
    while (asked := _heard(there)) is not None:
        if asked is False:  # the work was done before it could be stopped
            continue
        parent, child = os.getpid(), _fork()
        if child:
            _watch(child, there, asked[0])
        else:
            _answer(there, asked[0], asked[1], answer)
            while os.getppid() == parent:  # until the answer was wanted
                time.sleep(LOOK)
    os._exit(0)


def _answer(there: Connection, number: int, question: Any, answer: Answer) -> None:
    """Answer a question; the process ends here where it cannot."""
    try:
        os.setpgid(0, 0)  # with the processes that it starts
        there.send((number, answer(question)))
    except BaseException:
        traceback.print_exc()
        os._exit(1)


def _watch(child: int, there: Connection, number: int) -> None:
    """Wait until the answer is wanted, and end; or until it is not, and end the fork; or until the fork has failed."""
    while os.waitpid(child, os.WNOHANG) == (0, 0):
        if there.poll(LOOK):
            is_wanted = _heard(there)
            if not is_wanted:
                for end in (os.killpg, os.kill):  # it may not be the first of its group yet
                    with suppress(ProcessLookupError):
                        end(child, signal.SIGKILL)
                os.waitpid(child, 0)
            if is_wanted is not False:
                os._exit(0)
            return
    there.send((number, None))


def _heard(there: Connection) -> Any:
    """The next word; None where nobody is there any more."""
    try:
        return there.recv()
    except (EOFError, OSError):
        return None
