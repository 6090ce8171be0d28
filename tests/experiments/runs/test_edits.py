"""A user trains with a package of her own, edits it, and gives the same command again: every edit that matters is noticed."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from segar.experiments.runs.own_files import file_digest
from tests.experiments.short_runs import begin_module, run_module
from tests.waiting import until

pytestmark = pytest.mark.slow
STUDY = Path(__file__).parents[2] / "data" / "wind_study"
SETTINGS = (
    "algorithm=mine", "levels.train=windlab.levels:windy", "task.name=windlab.tasks:slow_task",
    "observation.name=windlab.seen:looks", "scale.frames=128", "levels.count=2", "levels.test_count=3",
    "evaluation.episodes=3", "tracking=none", "progress=false", "root=runs",
)  # fmt: skip
# What is edited, in which file, from what, to what, and the parts that a refusal names.
RELATED = {
    "rule": ("windlab/physics.py", "gust, 0.0", "gust, 0.1", "kernel, windlab/physics.py"),
    "constant of a rule": ("windlab/physics.py", "GAIN = 2.0", "GAIN = 3.0", "kernel, windlab/physics.py"),
    "law": ("windlab/levels.py", "UniformNoise(0.8, MASS)", "GaussianNoise(0.9, 0.01)", "levels, windlab/levels.py"),
    "prior of a parameter": ("windlab/levels.py", "(0.0, 0.4)", "(0.0, 0.5)", "levels, windlab/levels.py"),
    "task function": ("windlab/tasks.py", "-0.5 *", "-0.6 *", "kernel, windlab/tasks.py"),
    "observation": ("windlab/seen.py", '["golfball", "goal"]', '["golfball"]', "windlab/seen.py"),
    "learner": ("windlab/learn.py", "factor = 1.0", "factor = 2.0", "learner, windlab/learn.py"),
    "data read at import": ("windlab/mass.json", "1.2", "1.3", "levels, windlab/mass.json"),
    "data of a result": ("windlab/weight.json", "3.0", "4.0", "windlab/weight.json"),
    "module loaded late": ("windlab/late.py", "SIGN = 1.0", "SIGN = -1.0", "windlab/late.py"),
}
UNRELATED = {
    "comment": ("windlab/physics.py", "GAIN = 2.0", "# strong\nGAIN = 2.0  # enough"),
    "docstring of a rule": ("windlab/physics.py", "Blows to the right.", "Blows to the east."),
    "docstring of a function in a function": ("windlab/tasks.py", "Less for a ball", "Little for a ball"),
    "data that nobody reads": ("windlab/unread.json", "1.0", "2.0"),
    "comment in YAML": ("conf/algorithm/mine.yaml", "num_steps: 16", "num_steps: 16  # few"),
}  # fmt: skip


def train(folder: Path, *more: str) -> subprocess.CompletedProcess[str]:
    return run_module("segar.experiments.train", "--config-dir", "conf", *SETTINGS, *more, cwd=folder)


def edit(folder: Path, file: str, old: str, new: str) -> None:
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new))


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study") / "wind"
    shutil.copytree(STUDY, folder)
    done = train(folder)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture
def study(trained, tmp_path):
    """The user's folder with a finished run."""
    return shutil.copytree(trained, tmp_path / "wind")


@pytest.mark.parametrize(("file", "old", "new", "parts"), RELATED.values(), ids=RELATED)
def test_a_finished_run_of_edited_code_is_refused_with_what_changed(study, file, old, new, parts):
    edit(study, file, old, new)
    done = train(study)
    assert done.returncode == 1
    assert f"finished before by other code than this: {parts} changed since" in done.stderr


@pytest.mark.parametrize(("file", "old", "new"), UNRELATED.values(), ids=UNRELATED)
def test_an_edit_that_changes_nothing_is_not_noticed(study, file, old, new):
    edit(study, file, old, new)
    done = train(study)
    assert done.returncode == 0, done.stderr
    assert "finished before, nothing to do; " in done.stdout


@pytest.mark.parametrize(
    "data", [("scale.json", "2.0", "2.5"), ("weight.json", "3.0", "4.0"), ("late.py", "1.0", "2.0")]
)
def test_an_interrupted_run_does_not_go_on_with_other_data(study, data):
    folder = next((study / "runs").glob("*/summary.json"))
    folder.unlink()  # as a run that was interrupted at its end
    edit(study, f"windlab/{data[0]}", *data[1:])
    done = train(study)
    assert done.returncode == 1
    assert f"was written by other code: windlab/{data[0]} changed since" in done.stderr
    assert "train anew with stale=anew" in done.stderr
    assert train(study, "stale=anew").returncode == 0


def test_an_evaluation_says_which_data_are_others_and_what_it_replaces(study):
    run = next((study / "runs").glob("*/summary.json")).parent
    asked = (f"run={run}", "levels=test", "scores=false", "videos=none")
    assert "other code" not in run_module("segar.experiments.evaluate", *asked, cwd=study).stdout
    edit(study, "windlab/weight.json", "3.0", "4.0")
    told = run_module("segar.experiments.evaluate", *asked, cwd=study).stdout
    assert "note: the run was made by other code; changed since: windlab/weight.json" in told
    assert "note: an evaluation by other code lay there, and is replaced; changed since: windlab/weight.json" in told
    assert "is replaced" not in run_module("segar.experiments.evaluate", *asked, cwd=study).stdout


def test_another_setting_is_another_run(study):
    edit(study, "conf/algorithm/mine.yaml", "num_steps: 16", "num_steps: 32")
    assert train(study).returncode == 0
    assert len(list((study / "runs").glob("*/summary.json"))) == 2


@pytest.mark.parametrize("moment", ["*/journal.jsonl", "*/summary.json"])
def test_an_edit_during_a_multirun_is_never_recorded_as_what_was_executed(tmp_path, moment):
    folder = shutil.copytree(STUDY, tmp_path / "wind")
    command = ("segar.experiments.train", "--config-dir", "conf", "--multirun", *SETTINGS, "seed=1,2")
    process = begin_module(*command, cwd=folder)
    until(lambda: any((folder / "runs").glob(moment)))
    edit(folder, "windlab/helper.py", "0.5", "0.6")
    assert process.wait(120) == 1
    finished = [json.loads((one.parent / "versions.json").read_text()) for one in folder.glob("runs/*/summary.json")]
    now = file_digest(folder / "windlab" / "helper.py")
    assert len(finished) == (moment == "*/summary.json") and all(
        now != one["code"]["windlab/helper.py"] for one in finished
    )
    assert train(folder, "seed=2").returncode == 0
