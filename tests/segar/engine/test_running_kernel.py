"""A world runs as plain Python until another process has compiled it: the same bits all along, and no half steps."""

import hashlib
import pickle
import sys
import time
from threading import Thread

import numpy as np
import pytest
from numba import typeof

import segar
from segar.engine.compiler import kernel_cache
from segar.engine.compiler import running_kernel as module
from segar.engine.compiler.running_kernel import RunningKernel
from segar.envs import VectorEnv
from segar.envs.episode_kernel import copy_numbers, count_step
from segar.errors import SegarError
from segar.support import PATIENCE, cached
from segar.support import compiled as support
from tests.waiting import until

FAMILY = "empty-easy"


@pytest.fixture
def anew(tmp_path, monkeypatch):
    """Nothing is compiled, and nothing is known of any kernel."""
    monkeypatch.setenv("SEGAR_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(module, "_running", {})
    monkeypatch.setattr(module, "_plain", {})
    monkeypatch.setattr(kernel_cache, "_loaded", {})


def env_of(num_envs: int = 40) -> VectorEnv:
    env = VectorEnv(segar.family(FAMILY).sample(5, seed=0), num_envs, observation="state", seed=0, num_threads=2)
    env.reset(seed=0)
    return env


def played(env: VectorEnv, steps: int = 30) -> str:
    found, rng = hashlib.sha256(), np.random.default_rng(0)
    for _ in range(steps):
        for part in env.step(rng.uniform(-1, 1, (env.num_envs, 2)).astype(np.float32))[:4]:
            found.update(np.ascontiguousarray(part).tobytes())
    return found.hexdigest()


def kernel() -> RunningKernel:
    (found,) = module._running.values()
    return found


def test_machine_code_takes_over_while_episodes_go_on(anew, monkeypatch, capfd):
    monkeypatch.setenv(PATIENCE, "1e-6")
    env = env_of()
    first = played(env)
    assert kernel().is_python and capfd.readouterr().err.count("compiling kernel") == 1
    until(lambda: not kernel()._compiler.is_alive())
    second = played(env)
    assert not kernel().is_python
    assert sum(kernel().module.advance.stats.cache_hits.values()) == 1  # another process has compiled it
    monkeypatch.setenv(PATIENCE, "0")
    at_once = env_of()
    assert (played(at_once), played(at_once)) == (first, second)


def test_a_short_program_compiles_nothing_and_no_sub_steps_are_as_quick_as_any(anew, monkeypatch, capfd):
    monkeypatch.setenv(PATIENCE, "1000")
    env = env_of()
    played(env)
    state = env.state().state
    values = state.values.copy()
    env.simulator.step(state, env.levels, 0)
    assert state.values.tobytes() == values.tobytes()
    assert kernel().is_python and kernel()._compiler is None and not capfd.readouterr().err


class Waits(BaseException):
    pass


def waits(_):
    raise Waits


def test_a_step_of_many_environments_waits_for_machine_code(anew, monkeypatch):
    monkeypatch.setenv(PATIENCE, "1000")
    monkeypatch.setattr(module, "LONG_STEP", module.RATE * 1e-3)
    monkeypatch.setattr(RunningKernel, "use_machine_code", waits)
    with pytest.raises(Waits):
        played(env_of(), 1)


@pytest.mark.parametrize("python", ["", f"{sys.executable}.not-there"])
def test_where_no_process_can_compile_the_next_step_does(anew, monkeypatch, python):
    monkeypatch.setenv(PATIENCE, "1e-6")
    monkeypatch.setattr(sys, "executable", python)
    monkeypatch.setattr(RunningKernel, "use_machine_code", waits)
    env = env_of()
    with pytest.raises(Waits):
        until(lambda: not played(env, 1))


def test_what_a_step_that_ends_in_an_exception_has_written_is_taken_back(anew, monkeypatch):
    monkeypatch.setenv(PATIENCE, "1000")
    env, other = env_of(), env_of()
    expected, advance = played(other, 3), kernel().module.advance

    def broken(*arguments):
        advance(*arguments)
        kernel().module.advance = advance
        raise KeyboardInterrupt

    kernel().module.advance = broken
    with pytest.raises(KeyboardInterrupt):
        played(env, 1)
    assert played(env, 3) == expected


def test_a_patience_that_is_no_number_is_refused(anew, monkeypatch):
    monkeypatch.setenv(PATIENCE, "long")
    with pytest.raises(SegarError, match="SEGAR_PATIENCE: 'long' is no number of seconds"):
        env_of()


def test_a_patient_function_gives_the_same_as_python_and_compiled(anew, monkeypatch):
    @cached(patient=True, nogil=True, error_model="numpy")
    def scaled(values, out):
        for k in range(len(values)):
            out[k] = values[k] / values[k - 1] if values[k] > 0 else 0.0

    values, found = np.random.default_rng(0).normal(size=50), []
    values[3] = 0.0
    for seconds in ("1000", "1000", "0"):
        monkeypatch.setenv(PATIENCE, seconds)
        found.append(np.zeros(50))
        scaled(values, found[-1])
        assert len(scaled.signatures) == (seconds == "0")
    assert found[0].tobytes() == found[1].tobytes() == found[2].tobytes()
    scaled(np.ones(support.MOST_NUMBERS, np.float32), np.ones(support.MOST_NUMBERS, np.float32))
    assert len(scaled.signatures) == 2  # large arrays wait for machine code


def test_patient_functions_of_the_package_do_not_depend_on_how_they_run():
    rng = np.random.default_rng(1)
    values = np.where(rng.random((9, 4, 5)) < 0.2, np.nan, rng.normal(size=(9, 4, 5)))
    both = [np.zeros(values.shape, kind) for kind in (np.float32, np.float32)]
    for function, out in zip((copy_numbers, copy_numbers.py_func), both, strict=True):
        function(values, out)
    assert both[0].tobytes() == both[1].tobytes()
    reward, over = rng.normal(size=9).astype(np.float32), rng.random(9) < 0.3
    counted = []
    for function in (count_step, count_step.py_func):
        arrays = np.arange(9.0), np.full(9, 6), np.zeros(9, bool), np.zeros(9, np.int64)
        arrays[1][::2] = 5
        counted.append((function(reward, over, 7, *arrays), [one.tolist() for one in arrays]))
    assert counted[0] == counted[1]


def test_one_machine_code_serves_all_observations_and_levels_that_were_pickled(anew, monkeypatch):
    """Numba compiles a kernel for each kind of its arguments, and takes arrays that cannot be written for another kind."""
    found, take = set(), RunningKernel.steps_as_python

    def note(kernel, arguments, steps):
        found.add(tuple(map(typeof, arguments)))
        return take(kernel, arguments, steps)

    monkeypatch.setattr(RunningKernel, "steps_as_python", note)
    levels = segar.family(FAMILY).sample(3, seed=0)
    for given in (levels, pickle.loads(pickle.dumps(levels))):
        for observation in ("state", "rgb"):
            env = VectorEnv(given, 2, observation=observation, seed=0)
            env.reset()
            env.step(np.zeros((2, 2), np.float32))
    assert len(found) == 1


def test_threads_that_begin_one_world_at_once_make_one_kernel(anew, monkeypatch):
    made, levels, begin = [], segar.family(FAMILY).sample(3, seed=0), RunningKernel.__init__

    def slowly(kernel, source, patience):
        made.append(time.sleep(0.05))
        begin(kernel, source, patience)

    monkeypatch.setattr(RunningKernel, "__init__", slowly)
    done = []
    threads = [Thread(target=lambda: done.append(VectorEnv(levels, 2, observation="state", seed=0))) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (len(done), len(made)) == (8, 1)
