"""A method of somebody else's, which acts in a process of its own: it is given the training side of a suite, and arrays.

The process holds no test level, no plan and no simulator of what is played. Observations and actions lie in shared memory, a
batch at a time; a pipe says when there are some.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import traceback
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium.vector.utils import create_shared_memory, read_from_shared_memory

from segar.envs import VectorEnv, begin_policy
from segar.evaluation import checked_actions
from segar.experiments.settings import ConfigError, TrainingError, import_object
from segar.language import Task
from segar.observations import leaves, map_leaves
from segar.suites import Suite, TrainingSide, hide_tests

ROWS = 512  # of a batch, at most
SECONDS = 600.0  # the longest wait for an answer, unless the settings say another one
END = 5.0  # [s] that a process has to end by itself
LONGEST = 4000  # characters of an answer


@dataclass(frozen=True)
class Episodes:
    """What a policy is told when episodes begin: how many there are side by side, and what is played; not on which levels."""

    num_envs: int
    task: Task
    single_observation_space: gymnasium.Space[Any]
    single_action_space: gymnasium.Space[Any]
    runs_on_gpu: bool = False


class PolicyProcess(AbstractContextManager["PolicyProcess"]):
    """The policy that ``name``, ``module:function``, makes of a training side, in a process that ends with :meth:`close`.

    Args:
        of, seed: the suite, and which training side of it.
        options: of the environments that are played, whose spaces it is given.
        seconds: the longest wait for each answer, that of the function itself included.

    Raises:
        ConfigError: there is no such function, it makes no policy, or actions are none.
        TrainingError: the process ended, or does not answer.
    """

    def __init__(self, name: str, of: Suite, seed: int, options: Mapping[str, Any], seconds: float = SECONDS) -> None:
        self.name, self.seconds, side = name, seconds, of.training_side(seed)
        env = VectorEnv(of.test_levels, 1, seed=0, **options)
        env.close()
        context = multiprocessing.get_context("spawn")
        spaces = env.single_observation_space, env.single_action_space
        memory = [create_shared_memory(space, ROWS, context) for space in spaces]
        self._observed, self._acted = _arrays_of(spaces, memory)
        self._connection, theirs = context.Pipe()
        os.set_blocking(self._connection.fileno(), False)  # who sends half an answer is not waited for
        self._process = context.Process(target=_serve, args=(theirs, name, side, spaces, memory))
        self._process.start()
        theirs.close()
        try:
            self._answer()
        except BaseException:
            self.close()
            raise

    def begin(self, env: VectorEnv) -> None:
        """Episodes start in ``env``, of which the policy is told how many there are."""
        self._ask("begin", env.num_envs)

    def __call__(self, observations: Any) -> np.ndarray:
        """Actions float32 ``(n, action size)``."""
        n = len(next(leaves(observations)))
        map_leaves(lambda place, given: np.copyto(place[:n], given), self._observed, observations)
        self._ask("act", n)
        return self._acted[:n].copy()

    def close(self) -> None:
        """Ends the process, and those that it started."""
        self._connection.close()
        self._process.join(END)
        with suppress(OSError):  # where none is left
            os.killpg(cast(int, self._process.pid), signal.SIGKILL)
        self._process.kill()
        self._process.join()

    def __exit__(self, *_: object) -> None:
        self.close()

    def _ask(self, what: str, n: int) -> None:
        with suppress(OSError):  # it has ended; the answer says so
            self._connection.send((what, n))
        self._answer()

    def _answer(self) -> None:
        """Waits for the answer of the process: a text, empty where all is well. A policy could send a pickle of its own."""
        try:
            if not self._connection.poll(self.seconds):
                self._process.kill()
                raise TrainingError(
                    f"policy: {self.name} gave no answer within {self.seconds:g} s, and its process was ended. policy_seconds=N"
                    " waits longer"
                )
            problem = self._connection.recv_bytes(4 * LONGEST).decode(errors="replace")  # UTF-8: 4 bytes at most
        except (EOFError, OSError):
            self._process.join(END)
            code = self._process.exitcode
            what = "sent no whole answer" if code is None else f"ended by itself, with exit code {code}"
            raise TrainingError(f"policy: the process of {self.name} {what}") from None
        if problem:
            raise ConfigError(f"policy: {self.name}: {problem}")


def _serve(
    connection: Connection, name: str, side: TrainingSide, spaces: Sequence[gymnasium.Space[Any]], memory: Sequence[Any]
) -> None:
    """What the process does: make the policy, and act until the other end is closed."""

    def tell(problem: str = "") -> None:
        connection.send_bytes(problem[:LONGEST].encode(errors="replace"))  # in one piece

    hide_tests()
    os.setsid()  # a group of its own, which ends as a whole
    observed, acted = _arrays_of(spaces, memory)
    try:
        policy = _made(name, side)
        tell()
        episodes = Episodes(0, side.task, spaces[0], spaces[1])
        while True:
            what, n = connection.recv()
            if what == "begin":
                episodes = Episodes(n, side.task, spaces[0], spaces[1])
                begin_policy(policy, episodes)
            else:
                seen = map_leaves(lambda array, n=n: array[:n].copy(), observed)  # which the policy may keep
                acted[:n] = checked_actions(policy(seen), cast(VectorEnv, episodes))
            tell()
    except EOFError:
        pass
    except Exception as error:  # the other end tells of it
        traceback.print_exc()
        tell(str(error) if isinstance(error, ConfigError) else f"{type(error).__name__}: {error}")


def _made(name: str, side: TrainingSide) -> Any:
    """The policy."""
    make = import_object(name, "policy")
    made = make(side, side.seed) if callable(make) else None
    if not callable(made):
        raise ConfigError(
            "it must be a function of a suite's training side and a seed that returns a policy, a function of observations; it"
            f" {'returns ' + type(made).__name__ if callable(make) else 'is ' + type(make).__name__}"
        )
    return made


def _arrays_of(spaces: Sequence[gymnasium.Space[Any]], memory: Sequence[Any]) -> tuple[Any, ...]:
    """The observations and the actions that lie in shared memory."""
    return tuple(read_from_shared_memory(*one, ROWS) for one in zip(spaces, memory, strict=True))
