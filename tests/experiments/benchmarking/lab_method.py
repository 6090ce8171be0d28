"""A method that was trained elsewhere, as a user's package has it, and some that are none."""

import gc
import os
import subprocess
import time
from contextlib import suppress
from multiprocessing.connection import Connection

import numpy as np

from segar.errors import SuiteError
from segar.hardness import Plan
from segar.levels import Levels
from segar.suites import Suite, outline, suite


def policy(side, seed):
    """Acts by the first numbers of what it sees, otherwise for each seed."""
    gain = np.random.default_rng(seed).uniform(0.5, 1.0, 2)
    return lambda observations: np.tanh(observations[:, :2] * gain)


no_function = 3


def no_policy(side, seed):
    """Forgets to return a policy."""


def fickle(side, seed):
    """Is another policy each time."""
    gain = np.random.default_rng().uniform(0.5, 1.0, 2)
    return lambda observations: np.tanh(observations[:, :2] * gain)


def of_another_shape(side, seed):
    """Gives a component too many."""
    return lambda observations: np.zeros((len(observations), 3))


def dies(side, seed):
    """Ends its process."""
    return lambda observations: os._exit(7)


def pipe_of_this_process():
    return next(one for one in gc.get_objects() if isinstance(one, Connection))


def forges(side, seed):
    """Answers in place of the process that it is in."""
    connection = pipe_of_this_process()
    return lambda observations: connection.send_bytes(b"[1]")


def stammers(side, seed):
    """Begins an answer that is longer than what it sends, and waits."""
    connection = pipe_of_this_process()
    return lambda observations: time.sleep(os.write(connection.fileno(), b"\0\0\0\7half") * 100)


def boasts(side, seed):
    """Begins an answer that is longer than all memory, and waits."""
    connection, length = pipe_of_this_process(), (1 << 50).to_bytes(8, "big")
    return lambda observations: time.sleep(os.write(connection.fileno(), b"\xff\xff\xff\xff" + length) * 100)


def leaves_a_child(side, seed):
    """Starts a process that does not end by itself."""
    subprocess.Popen(["sh", "-c", f"exec sleep 1000 > {os.environ['LAB_FIFO']}"])
    return policy(side, seed)


def hangs(side, seed):
    """Never answers."""
    return lambda observations: time.sleep(1000)


def looks_for_the_test(side, seed):
    """Looks for levels and plans in memory, and then by importing them."""

    def act(observations):
        held = [one for one in gc.get_objects() if isinstance(one, Levels | Plan | Suite)]
        assert all(isinstance(one, Levels) and one == side.levels for one in held), held
        with suppress(SuiteError):
            raise AssertionError(f"the test distribution: {outline(side.name)['test']}")
        return suite(side.name).test_levels

    return act


class Remembers:
    """Counts the steps of its episodes."""

    def __init__(self, side, seed):
        self.time = None

    def begin(self, episodes):
        assert not {"levels", "state", "factors", "simulator"} & {*dir(episodes)}
        self.time = np.zeros((episodes.num_envs, 2))

    def __call__(self, observations):
        self.time += 0.01
        return self.time
