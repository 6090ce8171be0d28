"""Each trick for speed has a plain twin, to which ``SEGAR_PLAIN=1`` switches: both give the same bits."""

from __future__ import annotations

import numpy as np
import pytest

from segar.engine import kernel_path
from segar.engine.simulator import Simulator
from segar.envs import VectorEnv
from segar.levels.named_families import family
from segar.reference import interpreter
from segar.rules import DEFAULT_RULES
from segar.rules.world import World
from segar.support import is_plain, keyed_uniform
from tests.segar.engine.test_many_bodies import breeze, crowd, drift, label
from tests.segar.engine.worlds import start, uncompiled


@pytest.fixture
def plain_kernels(monkeypatch):
    """Kernels that are generated from now on have plain twins."""

    def switch(plain: bool = True) -> None:
        monkeypatch.setattr("segar.engine.compiler.kernel.is_plain", lambda: plain)

    return switch


@pytest.mark.parametrize(("value", "plain"), [(None, False), ("", False), ("0", False), ("1", True)])
def test_an_environment_variable_switches(monkeypatch, value, plain):
    monkeypatch.delenv("SEGAR_PLAIN", raising=False)
    if value is not None:
        monkeypatch.setenv("SEGAR_PLAIN", value)
    is_plain.cache_clear()
    try:
        assert is_plain() is plain
    finally:
        is_plain.cache_clear()


def test_a_plain_kernel_has_another_name(plain_kernels):
    layout = family("empty-easy").layout
    fast = uncompiled(World(), layout).source.text
    plain_kernels()
    plain = uncompiled(World(), layout).source.text
    assert kernel_path(plain) != kernel_path(fast)
    assert "runtime.plain_ledger" in plain and "runtime.plain_sheet" in plain and "runtime.plain_" not in fast


@pytest.mark.parametrize(
    "rules", [DEFAULT_RULES, (breeze,), (drift,), (label,), (*DEFAULT_RULES, breeze, drift)], ids=len
)
def test_sparse_pairs_add_what_all_pairs_add(plain_kernels, rules):
    levels, ends = crowd(7, np.random.default_rng(3)), []
    for plain in (False, True):
        plain_kernels(plain)
        simulator, state = uncompiled(World(rules), levels.layout), start(levels)
        assert ("listed_" in simulator.source.text) is not plain
        simulator.step(state, levels, 6)
        ends.append(state)
    assert ends[0].values.tobytes() == ends[1].values.tobytes()


def test_threads_with_a_ledger_and_a_sheet_do_what_one_thread_does_with_the_table(plain_kernels, eager_threads):
    levels, ends = family("objectsx1-easy").sample(50, seed=1), []
    for plain in (False, True):
        plain_kernels(plain)
        env = VectorEnv(levels, num_envs=100, observation="state", num_threads=2)
        env.reset(seed=3)
        actions = np.random.default_rng(0).uniform(-1, 1, (20, 100, 2)).astype(np.float32)
        seen = [env.step(action)[:4] for action in actions]
        ends.append(b"".join(np.asarray(part).tobytes() for step in seen for part in step))
    assert ends[0] == ends[1]


def test_a_plain_kernel_leaves_all_parts_to_the_owner(plain_kernels):
    plain_kernels()
    levels = family("objectsx1-easy").sample(50, seed=1)
    module = Simulator(World(), levels.layout)._module
    ledger = module.make_ledger(2)
    assert [module.take_part(ledger, owns) for owns in (True, False)] == [-1, -1]
    module.open_ledger(ledger)
    assert [module.take_part(ledger, owns) for owns in (False, True, False, True, True)] == [-1, 0, -1, 1, -1]


def test_random_numbers_of_rules_are_those_of_plain_integers():
    rng = np.random.default_rng(0)
    for _ in range(200):
        key, tick, site = rng.integers(2**64, dtype=np.uint64), rng.integers(10**6), rng.integers(10**5)
        slots = [int(s) for s in rng.integers(2**15, size=3)]
        plain = interpreter.keyed_uniform(int(key), int(tick), int(site), tuple(slots))
        assert keyed_uniform(key, tick, site, *slots) == plain
