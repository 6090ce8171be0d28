"""Threads that share work: every part is done once, by whoever is there, and nobody is waited for."""

import os
import threading
import time

import numpy as np
import pytest
from numba import njit

from segar.engine.runtime.ledger import dismiss, finish_part, make_ledger, open_ledger, take_part
from segar.support.threads import Team, cores
from tests.waiting import PATIENCE

PARTS, LENGTH = 40, 50


@njit(nogil=True)
def count_up(ledger, owns, counts):
    """Add 1 to every number, as far as the parts are mine; return how many were."""
    if owns:
        open_ledger(ledger)
    mine = 0
    part = take_part(ledger, owns)
    while part >= 0:
        for k in range(part * LENGTH, (part + 1) * LENGTH):
            counts[k] += 1
        mine += 1
        finish_part(ledger)
        part = take_part(ledger, owns)
    return mine


class Counting:
    def __init__(self) -> None:
        self.ledger, self.counts, self.helped = make_ledger(PARTS), np.zeros(PARTS * LENGTH, np.int64), 0

    def do(self, owns: bool) -> None:
        mine = count_up(self.ledger, owns, self.counts)
        self.helped += 0 if owns else mine

    def dismiss(self) -> None:
        dismiss(self.ledger)


def test_every_part_is_done_once_whoever_helps(eager_threads) -> None:
    work, team, turns, stop = Counting(), Team(3), 0, time.monotonic() + PATIENCE
    while turns < 2000 or (not work.helped and time.monotonic() < stop):
        team.do(work)
        turns += 1
        assert (work.counts == turns).all()
        if turns % 1000 == 0:  # workers count what they did when they leave
            work.dismiss()
            time.sleep(0.001)
    assert work.helped > 0


def test_an_owner_waits_for_no_one(eager_threads) -> None:
    """With its worker busy elsewhere, a team does all by itself."""
    leave = threading.Event()

    class Elsewhere(Counting):
        def do(self, owns: bool) -> None:
            assert owns or leave.wait(PATIENCE)

    team, work = Team(2), Counting()
    team.do(Elsewhere())
    time.sleep(0.01)
    team.do(work)
    assert (work.counts == 1).all() and work.helped == 0
    leave.set()


def test_a_range_is_done_once_by_several_threads(eager_threads) -> None:
    team, counts, threads = Team(3), np.zeros(1000, np.int64), set()

    def add(start: int, stop: int) -> None:
        counts[start:stop] += 1
        threads.add(threading.get_ident())
        time.sleep(0.01)

    turns = 0
    while turns < 3 or len(threads) < 3:  # a busy machine may be late with its threads
        team.do_range(add, len(counts))
        turns += 1
    assert (counts == turns).all() and len(threads) == 3


def test_an_error_in_any_part_reaches_the_caller(eager_threads) -> None:
    def fail(start: int, stop: int) -> None:
        time.sleep(0.001)
        if stop == 100:
            raise ValueError("the last part")

    with pytest.raises(ValueError, match="the last part"):
        Team(2).do_range(fail, 100)


def test_cores_are_counted_where_a_process_cannot_be_kept_to_some(monkeypatch):
    assert cores() == len(os.sched_getaffinity(0))
    monkeypatch.delattr("os.sched_getaffinity")
    assert cores() == os.cpu_count()
