"""The command as a user calls it: from any working directory, once or as a sweep."""

import os
import subprocess
import sys

import pytest

from segar.experiments.runs.run_folder import read_config, read_summary, run_folders
from segar.support import WORKSPACE
from tests.experiments.runs.test_run_folder import FILES
from tests.experiments.short_runs import COMMAND, run_module

TINY = (*COMMAND, "evaluation.interval=128")


@pytest.fixture
def elsewhere(tmp_path):
    """A working directory that is not the checkout."""
    (tmp_path / "here").mkdir()
    return tmp_path / "here"


def test_a_run_from_another_working_directory_leaves_its_folder_and_nothing_else(tmp_path, elsewhere):
    done = run_module("segar.experiments.train", *TINY, "seed=3", f"root={tmp_path / 'runs'}", cwd=elsewhere)
    assert done.returncode == 0, done.stderr
    (folder,) = (path for path in (tmp_path / "runs").iterdir() if path.name.startswith("empty-easy"))
    assert {path.name for path in folder.iterdir()} == FILES | {"tracking.json"}
    assert read_config(folder).seed == 3
    assert read_summary(folder)["frames"] == 256
    assert f"run folder                  {folder}" in done.stdout
    assert (tmp_path / "runs" / "mlflow.db").exists()
    assert list(elsewhere.iterdir()) == []


@pytest.mark.slow
def test_a_sweep_with_wrong_runs_finishes_the_others_and_names_all(tmp_path, elsewhere):
    done = run_module(
        "segar.experiments.train",
        "--multirun",
        *TINY,
        "levels.count=0,-1,1",
        f"root={tmp_path / 'runs'}",
        "tracking=none",
        cwd=elsewhere,
    )
    assert done.returncode != 0
    assert "error: levels.count: 0 is not allowed; it must be at least 1" in done.stderr
    assert "2 runs of the sweep went wrong. The others:\nlevels.count: -1 is not allowed" in done.stderr
    assert "Traceback" not in done.stderr
    (folder,) = run_folders(tmp_path / "runs")
    assert not [*elsewhere.iterdir()]
    assert read_config(folder).levels.count == 1


@pytest.mark.parametrize(
    ("module", "arguments"),
    [
        ("train", ["--help"]),
        pytest.param("train", [*TINY, "tracking=none"], marks=pytest.mark.slow),
        *(pytest.param(name, ["--help"], marks=pytest.mark.slow) for name in ("results", "study", "reproduce")),
    ],
)
def test_a_command_that_nobody_reads_any_more_ends_quietly_as_a_shell_has_it(tmp_path, module, arguments):
    """As in ``| head``, which ends after its lines."""
    reader, writer = os.pipe()
    os.close(reader)
    given = [*arguments, f"root={tmp_path / 'runs'}"] if "--help" not in arguments else arguments
    done = subprocess.run([sys.executable, "-m", f"segar.experiments.{module}", *given], cwd=WORKSPACE, stdout=writer,
                          stderr=subprocess.PIPE, text=True)  # fmt: skip
    os.close(writer)
    assert (done.returncode, done.stderr) == (141, "")
