"""The kernels run under concurrent Python threads and after a fork."""

import os
import subprocess
import sys
import threading

import numpy as np

import segar

LEVELS = segar.family("empty-hard").sample(5, seed=0)


def rewards(num_threads: int) -> np.ndarray:
    env = segar.envs.VectorEnv(LEVELS, 64, seed=0, num_threads=num_threads)
    env.reset(seed=0)
    return np.stack([env.step(np.full((64, 2), 0.3, np.float32))[1] for _ in range(50)])


def test_many_python_threads_may_step_their_own_environments_at_once(eager_threads: None) -> None:
    results: list[np.ndarray] = []
    threads = [threading.Thread(target=lambda: results.append(rewards(2))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(results) == 4
    assert all(np.array_equal(r, results[0]) for r in results)


def test_a_forked_child_steps_as_its_parent() -> None:
    code = (
        "import os, sys, segar.support.threads\n"
        f"sys.path.insert(0, {os.path.dirname(__file__)!r})\n"
        "from test_threads import rewards\n"
        "segar.support.threads.WORTH_WAKING = -1.0\n"
        "expected = rewards(2)\n"
        "pid = os.fork()\n"
        "if pid == 0:\n"
        "    os._exit(0 if (rewards(2) == expected).all() else 3)\n"
        "sys.exit(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))\n"
    )
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", code])
    assert done.returncode == 0
