"""A pool of runs: each has its log, none takes another down, and all end with the process that owns them."""

import os
import signal
import subprocess
import sys
import time

import psutil

from segar.experiments.reproduction.process_pool import Job, run_jobs
from tests.places import ROOT
from tests.waiting import until


def behave(how):
    """The work of these tests: does what its argument says."""
    match how:
        case "print":
            print("a line from Python")
            os.system("echo a line from below")
        case "fail":
            raise ValueError("the loss is not finite")
        case "die":
            time.sleep(0.5)  # so that the other job of the pool has begun or ended
            os.kill(os.getpid(), signal.SIGKILL)
        case "threads":
            print(os.environ["OMP_NUM_THREADS"])


def jobs(folder, *hows):
    return [Job(f"{i}-{how}", how, folder / "logs" / f"{i}-{how}.log") for i, how in enumerate(hows)]


MAIN = """
import numpy as np  # loads its library in every process of the pool, before the pool can say how many threads it has
from pathlib import Path
from threadpoolctl import threadpool_info
from segar.experiments.reproduction.process_pool import Job, run_jobs

def count_threads(_):
    return [pool["num_threads"] for pool in threadpool_info()]

if __name__ == "__main__":
    (outcome,) = run_jobs([Job("one", None, Path("log"))], count_threads, 1)
    print(outcome.result)
"""


def test_no_library_takes_more_than_one_thread(tmp_path):
    """Two processes with two threads each would wait for one another on two cores."""
    (tmp_path / "main.py").write_text(MAIN)
    environment = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")} | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "main.py"], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.stdout.strip() == "[1]", done.stderr


def test_a_failing_job_stops_no_other_and_what_all_print_goes_to_their_logs(tmp_path, capfd):
    told = []
    outcomes = run_jobs(jobs(tmp_path, "print", "fail", "print", "threads"), behave, 2, told.append)
    errors = {outcome.job.name: outcome.error for outcome in outcomes}
    assert errors == {
        "0-print": None,
        "1-fail": "ValueError: the loss is not finite",
        "2-print": None,
        "3-threads": None,
    }
    assert told == outcomes and capfd.readouterr() == ("", "")
    printed = (tmp_path / "logs" / "0-print.log").read_text().splitlines()
    assert sorted(printed) == ["a line from Python", "a line from below"]
    assert "in behave" in (tmp_path / "logs" / "1-fail.log").read_text()
    assert (tmp_path / "logs" / "3-threads.log").read_text() == "1\n"


def test_a_process_that_dies_costs_its_own_job_only(tmp_path):
    outcomes = run_jobs(jobs(tmp_path, "print", "die", "print", "print"), behave, processes=1)
    errors = {outcome.job.name: outcome.error for outcome in outcomes}
    assert errors.pop("1-die") == "its process, or one beside it, ended abruptly (out of memory?)"
    assert errors == {"0-print": None, "2-print": None, "3-print": None}


def test_killing_the_owner_ends_its_processes(tmp_path):
    code = (
        "import time\n"
        "from segar.experiments.reproduction.process_pool import Job, run_jobs\n"
        "from pathlib import Path\n"
        "if __name__ == '__main__':\n"
        f"    run_jobs([Job(str(i), 600, Path({str(tmp_path)!r}) / str(i)) for i in range(2)], time.sleep, 2)\n"
    )
    script = tmp_path / "owner.py"
    script.write_text(code)
    owner = subprocess.Popen([sys.executable, script], env={**os.environ, "PYTHONPATH": str(ROOT)})
    until(lambda: (tmp_path / "0").exists() and (tmp_path / "1").exists())
    children = psutil.Process(owner.pid).children(recursive=True)
    assert len(children) >= 2
    owner.kill()
    owner.wait()
    until(lambda: not any(child.is_running() and child.status() != psutil.STATUS_ZOMBIE for child in children))


def test_a_process_that_hears_no_signal_ends_with_its_owner_as_well():
    program = (
        "import multiprocessing, signal, time\n"
        "from segar.experiments.reproduction import process_pool\n"
        "process_pool.LAST_WORDS = 0.1\n"
        "reader, writer = multiprocessing.Pipe(duplex=False)\n"
        "signal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
        "process_pool._begin_process(reader)\n"
        "writer.close()\n"
        "time.sleep(900)\n"
    )
    assert subprocess.run([sys.executable, "-c", program], cwd=ROOT, check=False).returncode == -signal.SIGKILL
