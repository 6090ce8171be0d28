"""Sweeps through Hydra's launchers: side by side here, by submitit as on Slurm, and on a Ray cluster."""

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from experiments.commands.hydra_app import compose
from experiments.runs.journal import read_journal
from experiments.runs.run_folder import CHECKPOINT, is_finished, read_config, read_summary, run_folders
from experiments.settings import CHECKOUT, RunConfig
from tests.experiments.short_runs import COMMAND, run_module
from tests.waiting import until

ENVIRONMENT = {**os.environ, "PYTHONPATH": str(CHECKOUT)}


def sweep(cwd, *arguments, **more):
    """What ``python -m experiments.train --multirun`` does with four tiny runs, called from ``cwd``."""
    return run_module("experiments.train", "--multirun", *COMMAND, "tracking=none", *arguments, cwd=cwd, **more)


def seeds(root):
    return sorted(read_config(folder).seed for folder in run_folders(root) if is_finished(folder))


def test_the_demonstration_is_a_sweep_of_four_runs_of_one_configuration():
    config = compose(["+sweep=demo"])
    assert isinstance(config, RunConfig)
    assert (config.levels.train, config.scale.frames, config.tracking.sweep) == ("empty-easy", 40_000, "demo")


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
    again = sweep(tmp_path, *asked, "num_threads=2", "progress=true")  # which decide nothing
    assert again.returncode == 0, again.stderr
    assert again.stdout.count("finished before, nothing to do") == 2
    assert {folder: (folder / CHECKPOINT).stat().st_mtime_ns for folder in run_folders(tmp_path / "runs")} == before


@pytest.mark.slow
def test_submitit_runs_a_sweep_and_puts_a_run_back_into_its_queue_when_time_is_up(tmp_path):
    """The local executor does what Slurm does: a signal before the end of a job, which then begins again."""
    asked = ("seed=1", "hydra/launcher=submitit_local", f"root={tmp_path / 'runs'}", "scale.frames=10_000_000")
    command = [sys.executable, "-m", "experiments.train", "--multirun", *COMMAND, "tracking=none", *asked]
    process = subprocess.Popen(command, cwd=tmp_path, env=ENVIRONMENT, start_new_session=True)
    try:
        folder = until(lambda: next(iter(run_folders(tmp_path / "runs")), None))
        until(lambda: (folder / CHECKPOINT).exists())
        os.kill(read_journal(folder)[-1]["process"], signal.SIGUSR2)  # what Slurm is asked to send
        until(lambda: [entry["event"] for entry in read_journal(folder)] == ["started", "stopped", "started"])
        stopped = read_journal(folder)[1]
        assert stopped["error"].startswith("SystemExit") and stopped["frames"] > 0
        log = "".join(path.read_text() for path in (tmp_path / "runs" / "multirun").rglob("*_log.err"))
        assert "this job is preempted" in log
        again = until(
            lambda: "".join(p.read_text() for p in (tmp_path / "runs" / "multirun").rglob("*_log.out")) or None
        )
        until(
            lambda: (
                "goes on from" in "".join(p.read_text() for p in (tmp_path / "runs" / "multirun").rglob("*_log.out"))
            )
        )
        assert again
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
    command = [sys.executable, "-m", "experiments.train", "--multirun", *COMMAND, "tracking=none", *arguments]
    process = subprocess.Popen(command, cwd=tmp_path, env=ENVIRONMENT | {"PATH": path}, start_new_session=True)
    try:
        until(lambda: (tmp_path / "submitted.sh").exists())
    finally:
        os.killpg(process.pid, signal.SIGKILL)  # it would wait for the cluster
        process.wait()
    text = (tmp_path / "submitted.sh").read_text()
    for line in (
        "--partition=cpu",
        "--array=0-1%2",
        "--time=240",
        "--cpus-per-task=2",
        "--mem=8GB",
        "--signal=USR2@120",
    ):
        assert f"#SBATCH {line}\n" in text


RAY_ADDRESS = "127.0.0.1:6399"


@pytest.fixture
def ray_cluster(tmp_path):
    """A cluster of two machines with one core each, which are both this one."""
    folder = Path("/tmp") / f"ray-{os.getpid()}"  # Ray's sockets have names of at most 107 characters
    start = [str(Path(sys.executable).parent / "ray"), "start", "--block", "--num-cpus=1", "--disable-usage-stats"]
    head = ["--head", "--port=6399", "--node-ip-address=127.0.0.1", f"--temp-dir={folder}", "--include-dashboard=false"]
    nodes = []
    try:
        for number, role in enumerate((head, [f"--address={RAY_ADDRESS}"]), start=1):
            with open(tmp_path / f"ray-{number}.log", "wb") as log:
                command = [*start, *role]
                nodes.append(subprocess.Popen(command, env=ENVIRONMENT, stdout=log, stderr=log, start_new_session=True))
            while number_of_nodes() < number:
                assert nodes[-1].poll() is None, (tmp_path / f"ray-{number}.log").read_text()
        yield
    finally:
        for node in nodes:
            os.killpg(node.pid, signal.SIGTERM)
            node.wait()
        shutil.rmtree(folder, ignore_errors=True)


COUNT = """
import sys, ray
ray.init(address=sys.argv[1], log_to_driver=False, logging_level="ERROR")
print("nodes", sum(node["Alive"] for node in ray.nodes()))
"""


def number_of_nodes():
    done = subprocess.run([sys.executable, "-c", COUNT, RAY_ADDRESS], env=ENVIRONMENT, capture_output=True, text=True)
    return int(done.stdout.split("nodes ")[1]) if "nodes " in done.stdout else 0


@pytest.mark.slow
def test_ray_runs_a_sweep_on_two_machines(tmp_path, ray_cluster):
    done = sweep(
        tmp_path, "seed=1,2", "hydra/launcher=ray_cluster", f"hydra.launcher.ray.init.address={RAY_ADDRESS}",
        f"root={tmp_path / 'runs'}",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert seeds(tmp_path / "runs") == [1, 2]
