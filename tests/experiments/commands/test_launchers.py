"""Sweeps through Hydra's launchers: side by side here, by submitit as on Slurm, and on a Ray cluster."""

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from segar.experiments.algorithms.checkpoint import read_checkpoint
from segar.experiments.runs.journal import read_journal
from segar.experiments.runs.run_folder import CHECKPOINT, is_finished, read_config, read_summary, run_folders
from segar.experiments.settings import TrackingConfig
from segar.experiments.tracking.mlflow_store import open_store
from segar.support import WORKSPACE
from tests.experiments.short_runs import COMMAND, begin_module, run_module, same_results
from tests.experiments.tracking.mlflow_server import has_each_figure_once
from tests.waiting import PATIENCE, until

ENVIRONMENT = {**os.environ, "PYTHONPATH": str(WORKSPACE)}


def sweep(cwd, *arguments, **more):
    """What ``segar train --multirun`` does with four tiny runs, called from ``cwd``."""
    return run_module("segar.experiments.train", "--multirun", *COMMAND, "tracking=none", *arguments, cwd=cwd, **more)


def seeds(root):
    return sorted(read_config(folder).seed for folder in run_folders(root) if is_finished(folder))


@pytest.mark.slow
def test_runs_side_by_side_and_the_same_sweep_again_trains_nothing(tmp_path):
    asked = ("seed=1,2", "hydra/launcher=cores", "hydra.launcher.n_jobs=2", f"root={tmp_path / 'runs'}")
    done = sweep(tmp_path, *asked)
    assert done.returncode == 0, done.stderr
    assert seeds(tmp_path / "runs") == [1, 2]
    assert done.stdout.startswith(f"sweep: 2 runs of 256 frames, in {tmp_path / 'runs'}; about ")
    one, other = map(read_summary, run_folders(tmp_path / "runs"))
    assert one != other
    before = {folder: (folder / CHECKPOINT).stat().st_mtime_ns for folder in run_folders(tmp_path / "runs")}
    same = (*COMMAND, "tracking=none", *asked, "num_threads=2", "progress=true")  # which decide nothing
    again = run_module("segar.experiments.sweep", *same, cwd=tmp_path)  # whose table needs no name of the sweep
    assert again.returncode == 0, again.stderr
    assert again.stdout.count("finished before, nothing to do") == 2
    assert {folder: (folder / CHECKPOINT).stat().st_mtime_ns for folder in run_folders(tmp_path / "runs")} == before


@pytest.mark.slow
def test_submitit_runs_a_sweep_and_puts_a_run_back_into_its_queue_when_time_is_up(tmp_path):
    """The local executor does what Slurm does: a signal before the end of a job, which then begins again."""
    asked = ("seed=1", "hydra/launcher=submitit_local", f"root={tmp_path / 'runs'}", "scale.frames=10_000_000")
    process = begin_module("segar.experiments.train", "--multirun", *COMMAND, "tracking=none", *asked, cwd=tmp_path)
    try:
        folder = until(lambda: next(iter(run_folders(tmp_path / "runs")), None))
        until(lambda: (folder / CHECKPOINT).exists())
        os.kill(read_journal(folder)[-1]["process"], signal.SIGUSR2)  # what Slurm is asked to send
        until(lambda: [entry["event"] for entry in read_journal(folder)] == ["started", "stopped", "started"])
        stopped = read_journal(folder)[1]
        assert stopped["error"].startswith("SystemExit") and stopped["frames"] > 0
        log = "".join(path.read_text() for path in (tmp_path / "runs" / "multirun").rglob("*_log.err"))
        assert "this job is preempted" in log
        logs = tmp_path / "runs" / "multirun"
        until(lambda: any("goes on from" in path.read_text() for path in logs.rglob("*_log.out")))
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


SBATCH = """#!/bin/sh
cp "$1" "{folder}/submitted.sh"
echo "Submitted batch job 4711"
"""


def test_slurm_is_asked_for_an_array_with_a_warning_before_the_end(tmp_path):
    """With an ``sbatch`` that keeps what it is given, and an ``srun`` that says submitit is on a cluster."""
    (tmp_path / "bin").mkdir()
    for name, text in (("sbatch", SBATCH.format(folder=tmp_path)), ("srun", "#!/bin/sh\n"), ("scancel", "#!/bin/sh\n")):
        (tmp_path / "bin" / name).write_text(text)
        (tmp_path / "bin" / name).chmod(0o755)
    path = f"{tmp_path / 'bin'}{os.pathsep}{os.environ['PATH']}"
    arguments = ("seed=1,2", "hydra/launcher=slurm", "hydra.launcher.partition=cpu", f"root={tmp_path / 'runs'}")
    command = ("segar.experiments.train", "--multirun", *COMMAND, "tracking=none", *arguments)
    process = begin_module(*command, cwd=tmp_path, PATH=path)
    try:
        until(lambda: (tmp_path / "submitted.sh").exists())
    finally:
        os.killpg(process.pid, signal.SIGKILL)  # it would wait for the cluster
        process.wait()
    text = (tmp_path / "submitted.sh").read_text()
    for line in [
        "--partition=cpu",
        "--array=0-1%2",
        "--time=240",
        "--cpus-per-task=2",
        "--mem=8GB",
        "--signal=USR2@120",
    ]:
        assert f"#SBATCH {line}\n" in text


TOTAL = 19_200  # frames of a run in the cluster: ten seconds
CLUSTER = """
import contextlib, ctypes, signal, sys
import psutil
from ray.cluster_utils import Cluster

ctypes.CDLL(None).prctl(36, 1)  # PR_SET_CHILD_SUBREAPER: what a killed node leaves behind becomes a child of this process
try:
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    cluster.add_node(num_cpus=1)
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # Ray takes a killed process for alive until it is waited for
    print(cluster.address, flush=True)
    sys.stdin.read()  # until the test has ended, however it ends
finally:
    while left := psutil.Process().children(recursive=True):
        for process in left:
            with contextlib.suppress(psutil.NoSuchProcess):
                process.kill()
        psutil.wait_procs(left, timeout=1)
"""


@pytest.fixture
def ray_cluster():
    """Two nodes with one core each: the process that has started them, their address, and the environment that they are in."""
    import psutil

    with tempfile.TemporaryDirectory(dir="/tmp") as folder:  # Ray's sockets have names of at most 107 characters
        # Without the second variable, Ray takes 127.0.0.1 for the machine's address in its network and listens everywhere.
        ours = {"RAY_TMPDIR": folder, "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0", "RAY_USAGE_STATS_ENABLED": "0"}
        command, environment = [sys.executable, "-c", CLUSTER], {**ENVIRONMENT, **ours}
        with subprocess.Popen(
            command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as process:
            yield psutil.Process(process.pid), process.stdout.readline().strip(), environment


def in_training(root, raylet):
    """The process of a run in the first half of its training on the node of this raylet; None where there is none."""
    begun = [folder for folder in run_folders(root) if (folder / CHECKPOINT).exists()]
    last = [read_journal(folder)[-1] for folder in begun if read_checkpoint(folder / CHECKPOINT)["frames"] < TOTAL / 2]
    training = [entry["process"] for entry in last if entry["event"] == "started"]
    return next((process for process in raylet.children() if process.pid in training), None)


def addresses(processes):
    """The addresses on which processes wait for others."""
    found = {where.laddr.ip for one in processes for where in one.net_connections("tcp") if where.status == "LISTEN"}
    return {address.removeprefix("::ffff:") for address in found}


@pytest.mark.slow
def test_a_sweep_on_two_machines_outlives_a_worker_and_a_machine_and_ends_as_on_one(tmp_path, ray_cluster):
    here, there = tmp_path / "here", tmp_path / "there"
    asked = ("seed=1,2,3,4", f"scale.frames={TOTAL}", "checkpoint_interval=0.5", "tracking.interval=0.1")
    nodes, address, environment = ray_cluster
    head, second = (process for process in nodes.children() if process.name() == "raylet")
    cluster = ("hydra/launcher=ray_cluster", f"hydra.launcher.ray.init.address={address}", f"root={there}")
    command = ("segar.experiments.train", "--multirun", *COMMAND, *asked, *cluster)
    with begin_module(*command, cwd=tmp_path, stderr=subprocess.PIPE, **environment) as process:
        try:
            worker = until(lambda: in_training(there, head))
            assert addresses(nodes.children(recursive=True)) == {"127.0.0.1"}
            worker.kill()
            until(lambda: in_training(there, second))
            second.kill()
            _, errors = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
    assert process.returncode == 0, errors
    done = sweep(tmp_path, *asked, "hydra/launcher=cores", f"root={here}")
    assert done.returncode == 0, done.stderr
    assert seeds(here) == seeds(there) == [1, 2, 3, 4]
    events = [entry["event"] for folder in run_folders(there) for entry in read_journal(folder)]
    assert (events.count("lost"), events.count("started"), events.count("finished")) == (2, 6, 4)
    assert all(same_results(folder, here / folder.name) for folder in run_folders(there))
    client, experiment = open_store(TrackingConfig(), there)
    runs = client.search_runs([experiment])
    assert sorted(run.data.tags["run_folder"] for run in runs) == [str(folder) for folder in run_folders(there)]
    assert all(has_each_figure_once(client, run.info.run_id, Path(run.data.tags["run_folder"])) for run in runs)
