"""The reproduction trains what is missing, goes on where it stopped, and names what failed."""

import dataclasses
import os
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from segar.experiments.commands.config_store import register_settings
from segar.experiments.commands.hydra_app import compose
from segar.experiments.commands.plugin import REPORTS, STUDIES
from segar.experiments.reproduce import (
    SETTINGS,
    ReportTask,
    ReproduceConfig,
    dashboard,
    reproduce,
    reproduce_with_preview,
    with_reports,
)
from segar.experiments.reproduction.plan import StudyTask
from segar.experiments.runs.run_folder import VERSIONS, folder_path, is_finished, read_versions, write_json
from segar.experiments.settings import ConfigError, ScaleConfig, TrackingConfig, TrainingError, grid_point
from tests.experiments.settings.test_grid import cells_of
from tests.experiments.short_runs import run_module
from tests.places import ROOT
from tests.synthetic_runs import pretend_to_train, settings
from tests.waiting import until

FOUR_CELLS = ScaleConfig(name="smoke", families=("empty",), difficulties=("easy", "hard"), counts=(1, 10))
MAIN = {"title": "All cells", "figure": "3a", "grid": {"algorithms": ["base"]}, "scales": {"smoke": {}}}
HARD = {**MAIN, "title": "Hard ones", "grid": {"difficulties": ["hard"]}}


def asked(root, grids=None, experiments=(), **changes):
    run = settings(root, **{"seed": 1, "scale": FOUR_CELLS, **changes})
    return ReproduceConfig(run, processes=2, grids=grids or {"main": MAIN, "hard": HARD}, experiments=experiments)


def pretend(work):
    """Stands for the work: leaves a finished run."""
    return pretend_to_train(work.run)


def train_but_for_one(work):
    """Stands for training that fails in one cell."""
    if grid_point(work.run).panel == "empty-hard" and work.run.levels.count == 10:
        print("a last word")
        raise ValueError("the loss is not finite")
    return pretend(work)


def test_a_number_of_levels_that_tables_cannot_hold_ends_the_plan(tmp_path):
    endless = {**MAIN, "grid": {"counts": [10, "endless"]}}
    with pytest.raises(ConfigError, match=r"grid\.counts: endless is not allowed; it must be numbers"):
        reproduce(asked(tmp_path, {"main": endless}), pretend)
    assert not list(tmp_path.iterdir())


def finish_nothing(config, plan):
    """Stands for tables and report."""
    return True


def trained(root):
    return sorted((root / "trained").read_text().splitlines())


@pytest.mark.usefixtures("one_process")
def test_every_run_is_trained_once_after_a_plan(tmp_path, capfd):
    reproduce(asked(tmp_path), pretend, finish_nothing)
    assert trained(tmp_path) == [f"empty-{d} n={n} seed=1" for d in ("easy", "hard") for n in (1, 10)]
    said = capfd.readouterr().out
    assert "smoke: 4 runs, 0 done, 4 to do with 800,000 frames" in said
    assert "[1/4]" in said and " left\n" in said
    assert "[4/4]" in said and "all done" in said
    assert said.index("smoke: 4 runs") < said.index("[1/4]")
    reproduce(asked(tmp_path), pretend, finish_nothing)
    assert len(trained(tmp_path)) == 4
    assert "4 done, 0 to do" in capfd.readouterr().out


@pytest.mark.usefixtures("one_process")
def test_finished_runs_of_other_code_are_refused_kept_or_trained_anew(tmp_path, capfd):
    reproduce(asked(tmp_path), pretend, finish_nothing)
    folders = [path.parent for path in tmp_path.glob(f"*hard*/{VERSIONS}")]
    for folder in folders:
        versions = read_versions(folder)
        write_json(folder / VERSIONS, {**versions, "code": {**versions["code"], "kernel": "another"}})
    with pytest.raises(ConfigError, match="2 finished runs were made by other code than this; changed since: kernel"):
        reproduce(asked(tmp_path), pretend, finish_nothing)
    reproduce(asked(tmp_path, stale="keep"), pretend, finish_nothing)
    assert len(trained(tmp_path)) == 4
    capfd.readouterr()
    reproduce(asked(tmp_path, stale="anew"), pretend, finish_nothing)
    said = capfd.readouterr().out
    assert "smoke: 4 runs, 2 done, 2 to do" in said
    assert re.search(r"^hard .* 2 +0", said, re.MULTILINE)  # the table of experiments: runs and how many are done
    assert trained(tmp_path).count("empty-hard n=1 seed=1") == 2
    assert len(trained(tmp_path)) == 6
    reproduce(asked(tmp_path), pretend, finish_nothing)
    assert len(trained(tmp_path)) == 6


@pytest.mark.usefixtures("one_process")
def test_one_experiment_alone_is_run(tmp_path, capfd):
    reproduce(asked(tmp_path, experiments=("hard",)), pretend, finish_nothing)
    assert trained(tmp_path) == ["empty-hard n=1 seed=1", "empty-hard n=10 seed=1"]
    assert "main" not in capfd.readouterr().out.split()


def test_a_dry_run_leaves_nothing(tmp_path, capfd):
    config = asked(tmp_path)
    reproduce(ReproduceConfig(config.run, grids=config.grids, dry_run=True), pretend, finish_nothing)
    assert "4 to do" in capfd.readouterr().out
    assert not list(tmp_path.iterdir())


def test_what_cannot_be_run_is_told(tmp_path):
    with pytest.raises(ConfigError, match="there is no experiment 'mian'"):
        asked(tmp_path, experiments=("mian",))
    with pytest.raises(ConfigError, match="experiments: main has no scale 'quick'; it has smoke"):
        reproduce(asked(tmp_path, experiments=("main",), scale=ScaleConfig(name="quick")), pretend, finish_nothing)
    with pytest.raises(ConfigError, match="no experiment has a scale 'huge'"):
        reproduce(asked(tmp_path, scale=ScaleConfig(name="huge")), pretend, finish_nothing)


@pytest.mark.slow
def test_a_failing_run_stops_no_other_and_is_named_with_its_log(tmp_path, capfd):
    with pytest.raises(TrainingError) as told:
        reproduce(asked(tmp_path), train_but_for_one, finish_nothing)
    assert len(trained(tmp_path)) == 3
    message = str(told.value)
    assert message.startswith("1 of 4 failed:\n  empty-hard-n10-state-ppo-s1-")
    assert "ValueError: the loss is not finite" in message
    assert "the same command does only what is missing" in message
    log = Path(message.partition("log: ")[2].splitlines()[0])
    assert "a last word" in log.read_text() and "in train_but_for_one" in log.read_text()
    assert "[4/4]" in capfd.readouterr().out


@pytest.mark.usefixtures("one_process")
def test_tables_and_report_name_what_failed_and_say_where_they_are(tmp_path, capfd, register):
    register(
        REPORTS, tables="segar.analysis.collect:collect_tables", report="segar.analysis.report.make:report_results"
    )
    config = asked(tmp_path)
    with pytest.raises(TrainingError, match="1 of 4 failed"):
        reproduce(config, train_but_for_one)
    said = capfd.readouterr().out
    assert f"{config.folder / 'runs.parquet'}: 3 runs; transfers.parquet: 0 transfers" in said
    assert "missing: empty-hard-n10-state-ppo-s1-" in said and ": not begun" in said
    assert "In the report: 3 runs. Missing, runs or tests: 1." in said
    for name in (
        "runs.parquet",
        "levels.parquet",
        "tables/main.csv",
        "tables/hard.csv",
        "report.html",
        "claims.csv",
    ):
        assert (config.folder / name).exists()
    assert f"segar dashboard root={tmp_path}" in said


@pytest.mark.parametrize(
    ("uri", "opens"),
    [
        (None, "segar dashboard root="),
        ("http://there:5000", "http://there:5000"),
        ("postgresql+psycopg2://there/mlflow", "server --backend-store-uri 'postgresql+psycopg2://there/mlflow'"),
    ],
)
def test_it_says_where_mlflow_has_the_runs(tmp_path, uri, opens):
    assert opens in dashboard(settings(tmp_path, tracking=TrackingConfig(uri=uri)))


def test_tables_that_cannot_be_made_are_an_error(tmp_path):
    for cell in cells_of(asked(tmp_path).run):
        pretend_to_train(cell)
    with pytest.raises(TrainingError, match="there are no tables or no report: see what it says above"):
        reproduce(asked(tmp_path), pretend, lambda config, plan: False)


@pytest.mark.usefixtures("one_process")
def test_a_study_is_done_once_for_the_same_options(tmp_path, capfd, register):
    register(STUDIES, "def run(output):\n    (output / 'a.csv').touch()\n", pictures="some_plugins:run")
    study = {"title": "Pictures", "study": "pictures", "scales": {"smoke": {}}}
    reproduce(asked(tmp_path, {"illustrated": study}), None, finish_nothing)
    out = asked(tmp_path).folder / "studies" / "illustrated"
    assert {"a.csv", "study.json"} == {path.name for path in out.iterdir()}
    assert "[1/1] illustrated" in capfd.readouterr().out
    reproduce(asked(tmp_path, {"illustrated": study}), None, finish_nothing)
    assert "0 of 1 studies to do" in capfd.readouterr().out


@pytest.mark.usefixtures("one_process")
def test_a_study_that_fails_is_told_with_its_log(tmp_path, register):
    register(STUDIES, "def run(output):\n    raise ValueError('no such file')\n", broken="some_plugins:run")
    study = {"title": "None", "study": "broken", "scales": {"smoke": {}}}
    with pytest.raises(TrainingError) as told:
        reproduce(asked(tmp_path, {"none": study}), None, finish_nothing)
    assert "none: TrainingError: the study broken failed" in str(told.value)
    assert "ValueError: no such file" in (asked(tmp_path).folder / "logs" / "none.log").read_text()
    assert StudyTask("none", "a", {}, tmp_path).done_file.name == "study.json"


def test_a_study_that_is_not_known_is_an_error_before_anything_is_trained(tmp_path):
    study = {"title": "None", "study": "no_such", "scales": {"smoke": {}}}
    with pytest.raises(ConfigError, match=r"'no_such' in the group segar\.studies.*make setup"):
        reproduce(asked(tmp_path, {"main": MAIN, "none": study}), pretend, finish_nothing)
    assert not (tmp_path / "trained").exists()


@pytest.mark.slow
def test_a_killed_reproduction_goes_on_where_it_stopped(tmp_path):
    """Killed while the second cell is at work; started again, it trains all but the first."""
    script = tmp_path / "slowly.py"
    script.write_text(
        "import time\n"
        "from tests.experiments.reproduction.test_reproduce import *\n"
        "def slowly(work):\n"
        f"    while (Path({str(tmp_path)!r}) / 'trained').exists(): time.sleep(0.1)\n"
        "    return pretend(work)\n"
        "if __name__ == '__main__':\n"
        f"    config = asked(Path({str(tmp_path)!r}))\n"
        "    reproduce(ReproduceConfig(config.run, processes=1, grids=config.grids), slowly, finish_nothing)\n"
    )
    owner = subprocess.Popen([sys.executable, script], env={**os.environ, "PYTHONPATH": str(ROOT)})
    first, *rest = (folder_path(cell) for cell in cells_of(asked(tmp_path).run))
    until(lambda: is_finished(first) or owner.poll() is not None)
    owner.send_signal(signal.SIGKILL)
    owner.wait()
    assert not any(is_finished(folder) for folder in rest)
    reproduce(asked(tmp_path), pretend, finish_nothing)
    assert len(trained(tmp_path)) == len(set(trained(tmp_path))) == 4


def test_the_command_that_opens_the_pages_is_quoted_for_the_shell(tmp_path):
    root = tmp_path / "a b" / "it's"
    command = shlex.split(dashboard(settings(root)).partition("    ")[0])
    assert command[4:] == [f"root={root}"]


@pytest.mark.parametrize(
    ("command", "cells", "observation", "algorithm", "frames"),
    [
        (["scale=smoke"], 4, "rgb_stack2", "ppo_fast", 4_096),
        (["scale=quick"], 45, "rgb_stack2", "ppo_fast", 80_000),
        (["scale=standard"], 360, "rgb_stack2", "ppo_fast", 250_000),
        (["scale=paper"], 225, "textures", "ppo", 1_000_000),
        (["scale=paper", "observation=state", "scale.seeds=1"], 45, "state", "ppo", 1_000_000),
    ],
)
def test_a_scale_chooses_the_protocol_and_the_command_line_has_the_last_word(
    command, cells, observation, algorithm, frames
):
    planned = cells_of(compose([*command, "seed=1"]))
    assert len({cell.label() for cell in planned}) == len(planned) == cells
    (cell,) = {(c.observation.name, c.algorithm.name, c.scale.frames) for c in planned}
    assert cell == (observation, algorithm, frames)
    assert planned[0].seed == planned[0].levels.seed == 1


@pytest.mark.slow
@pytest.mark.usefixtures("one_process")
def test_what_the_file_of_an_experiment_does_not_state_can_be_added():
    asked = ("scale=smoke", "experiments=[fixed_n]", "dry_run=true")
    without, added = (
        run_module("segar.experiments.reproduce", *asked, f"{plus}grids.fixed_n.grid.seeds=3") for plus in ("", "++")
    )
    assert "++grids.fixed_n.grid.seeds=..." in without.stderr and without.returncode == 1
    assert "smoke: 6 runs" in added.stdout and added.returncode == 0


@pytest.mark.results
def test_runs_that_are_shipped_are_found_by_their_names_today(tmp_path):
    """Whoever adds a setting says so with ``later``; else whatever anybody has trained is trained again."""
    asked = ("scale=quick", "imported=[docs/results/quick]", "dry_run=true", f"root={tmp_path}")
    done = run_module("segar.experiments.reproduce", *asked)
    assert done.returncode == 0, done.stderr
    assert "quick: 51 runs, 51 done, 0 to do" in done.stdout


def test_the_smallest_scale_comes_first_where_there_is_no_report(tmp_path, monkeypatch, capsys):
    carried_out = []

    def pretend_to_report(config):
        carried_out.append(config.folder)
        config.folder.mkdir(parents=True, exist_ok=True)
        (config.folder / "report.html").touch()

    monkeypatch.setattr("segar.experiments.reproduce.reproduce", pretend_to_report)
    register_settings("reproduce", SETTINGS)
    config = asked(tmp_path, scale=ScaleConfig(name="quick"))
    reproduce_with_preview(config)
    small, whole = carried_out
    assert small.is_relative_to(tmp_path / "preview") and small.name.startswith("smoke-") and whole == config.folder
    assert f"{small}/report.html" in capsys.readouterr().out
    reproduce_with_preview(config)
    reproduce_with_preview(dataclasses.replace(config, preview=False))
    assert carried_out[2:] == [whole, whole]


def test_long_plans_have_reports_between_their_runs(tmp_path):
    short, long = ({f"run {k}": (k, seconds) for k in range(8)} for seconds in (60.0, 600.0))
    assert with_reports(short, tmp_path, 2) == short
    found = with_reports(long, tmp_path, 2)
    reports = [k for k, (one, _) in enumerate(found.values()) if one == ReportTask(tmp_path)]
    assert reports == [2, 5, 8] and {name: one for name, one in found.items() if name in long} == long
