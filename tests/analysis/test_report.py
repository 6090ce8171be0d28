"""From run folders to a table, statistics, figures and a page; what is missing is named everywhere."""

import json
import subprocess
import sys
from pathlib import Path

import matplotlib.image
import numpy as np
import pandas as pd
import pytest

from analysis.report import ReportConfig, main, make_report, track_report
from experiments.cells import Cell, cell_config, cell_of, design_hash
from experiments.config import PPOConfig, TrackingConfig
from experiments.errors import RunFolderError
from tests.synthetic_runs import settings, write_grid, write_run

ROOT = Path(__file__).parents[2]
NO_TRACKING = TrackingConfig(name="none")


def asked(root, **changes):
    return ReportConfig(**{"runs": str(root), "tracking": NO_TRACKING, **changes})


@pytest.fixture
def undrawn(monkeypatch):
    """Figures take seconds; most tests are not about them."""
    monkeypatch.setattr("analysis.report.save_figure", lambda figure, path: path.with_suffix(".png").touch())


@pytest.fixture(scope="module")
def grid(tmp_path_factory):
    """The report of twelve runs."""
    root = tmp_path_factory.mktemp("runs")
    write_grid(settings(root))
    return make_report(asked(root))


def test_all_files_are_there(grid):
    assert all(path.stat().st_size > 0 for path in grid.files)
    assert sorted(path.name for path in grid.folder.iterdir()) == sorted(path.name for path in grid.files)


@pytest.mark.parametrize("name", ["gap_vs_w2.png", "gap_vs_w2_by_family.png"])
def test_a_figure_shows_something(grid, name):
    image = matplotlib.image.imread(grid.folder / name)
    ink = (image[..., :3] < 0.95).any(axis=-1)
    assert image.shape[1] > 800
    assert 0.01 < ink.mean() < 0.5
    for half in np.array_split(ink, 2, axis=1):
        assert half.mean() > 0.01


def test_the_table_holds_the_numbers_of_the_figure(grid):
    table = pd.read_csv(grid.folder / "gap_vs_w2.csv", keep_default_na=False)
    chosen = table[table["action_mode"] == "deterministic"]
    r = np.corrcoef(chosen["w2_reference"], chosen["gap"])[0, 1]
    assert grid.statistics["w2"]["reference"]["pooled"].pearson == pytest.approx(r)
    assert len(table) == 24


def test_a_planted_relation_is_found(grid):
    found = grid.statistics["w2"]["exact"]
    assert found["pooled"].pearson < -0.8
    assert found["line"].slope == pytest.approx(-2, rel=0.25)  # the gap is -4 times the reference distance
    assert found["log_w2_explained_by"]["both"] == pytest.approx(1)
    assert grid.missing == []


def test_statistics_are_plain_json(grid):
    stored = json.loads((grid.folder / "statistics.json").read_text())
    assert stored["w2"]["reference"]["pooled"]["points"] == stored["runs"] == 12


def test_the_page_says_what_the_statistics_say(grid):
    page = (grid.folder / "report.md").read_text()
    assert "12 of 12 runs: ppo on state, 200,000 frames, seed 0; deterministic actions." in page
    assert f"{grid.statistics['w2']['reference']['pooled'].pearson:+.2f}".replace("-", "−") in page
    assert "nan" not in page


def test_the_same_runs_give_the_same_bytes(grid, tmp_path):
    runs = grid.folder.parent.parent
    again = make_report(asked(runs, out=str(tmp_path)))
    assert [path.read_bytes() for path in again.files] == [path.read_bytes() for path in grid.files]


def test_missing_cells_are_named_on_the_page_and_on_the_terminal(tmp_path, capsys, undrawn):
    config = settings(tmp_path)
    for n in (1, 10, 50):
        write_run(cell_config(config, Cell("empty", "easy", n, 0)), gap=-1 / n, w2=1 / n)
    write_run(cell_config(config, Cell("empty", "hard", 1, 0)), finished=False)
    main(asked(tmp_path, out=str(tmp_path / "out"), difficulties=("easy", "hard"), counts=(1, 10, 50)))
    said, page = capsys.readouterr().out, (tmp_path / "out" / "report.md").read_text()
    assert "3 of 6 runs" in said and "3 of 6 runs" in page
    for text in (said, page):
        assert "empty-hard n=1 seed=0: not finished (empty-hard-n1" in text
        assert "empty-hard n=50 seed=0: no run" in text


def test_two_runs_make_a_figure_and_no_correlation(tmp_path, capsys):
    write_grid(settings(tmp_path), families=("empty",), difficulties=("easy",), counts=(1, 10))
    main(asked(tmp_path, out=str(tmp_path / "out")))
    assert "no correlation: 2 points; at least 3 are needed" in capsys.readouterr().out
    stored = json.loads((tmp_path / "out" / "statistics.json").read_text())
    assert stored["w2"]["exact"]["pooled"] == {"not_available": "2 points; at least 3 are needed"}
    assert (tmp_path / "out" / "gap_vs_w2.png").exists()


def test_several_experiments_are_told_apart(tmp_path, undrawn):
    slow = settings(tmp_path, algorithm=PPOConfig(learning_rate=1e-5))
    write_grid(settings(tmp_path), families=("empty",))
    write_grid(slow, families=("tilesx1",))
    with pytest.raises(RunFolderError, match="belong to several experiments; choose one:\n  design=") as told:
        make_report(asked(tmp_path))
    name = design_hash(slow)
    assert f"design={name}: ppo on state, 200,000 frames, test levels of the same distribution" in str(told.value)
    assert set(make_report(asked(tmp_path, design=name)).table["family"]) == {"tilesx1"}


def test_runs_with_shifted_test_levels_are_another_experiment(tmp_path):
    config = settings(tmp_path)
    write_run(config)
    shifted = cell_config(config, cell_of(config))
    object.__setattr__(shifted, "levels", shifted.levels.__class__(test="empty-medium"))
    write_run(shifted)
    with pytest.raises(RunFolderError, match="shifted test levels"):
        make_report(asked(tmp_path))


def test_runs_by_two_versions_of_the_code_are_pointed_out(tmp_path, undrawn):
    folders = write_grid(settings(tmp_path), counts=(1, 10))
    (folders[0] / "versions.json").write_text('{"code": "fedcba9876543210"}')
    report = make_report(asked(tmp_path))
    assert "**The runs were made by 2 versions of the code**" in (report.folder / "report.md").read_text()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"design": "12345678"}, "no run in .* has the design 12345678"),
        ({"distances": ("exakt",)}, "the runs have no W2 in mode 'exakt'. Did you mean 'exact'?"),
        ({"action_mode": "greedy"}, "no evaluation episodes with action_mode=greedy"),
    ],
)
def test_what_the_runs_do_not_have_is_said(tmp_path, changes, message):
    write_run(settings(tmp_path))
    with pytest.raises(RunFolderError, match=message):
        make_report(asked(tmp_path, **changes))


def test_no_runs_and_no_finished_run_are_said(tmp_path):
    with pytest.raises(RunFolderError, match=f"there are no run folders in {tmp_path}"):
        make_report(asked(tmp_path))
    write_run(settings(tmp_path), finished=False)
    with pytest.raises(RunFolderError, match=r"none of the 1 runs in .* is finished"):
        make_report(asked(tmp_path))


def test_mlflow_gets_the_figures_once(tmp_path):
    from experiments.mlflow_store import open_store

    write_grid(settings(tmp_path), counts=(1, 10))
    report = make_report(asked(tmp_path))
    for _ in range(2):
        track_report(asked(tmp_path, tracking=TrackingConfig()), report, "12345678")
    client, experiment = open_store(TrackingConfig(), tmp_path)
    (run,) = client.search_runs([experiment], "tags.kind = 'report'")
    artifacts = {entry.path for entry in client.list_artifacts(run.info.run_id)}
    assert artifacts == {path.name for path in report.files}
    pooled = report.statistics["w2"]["exact"]["pooled"]
    assert run.data.metrics["exact/pooled/pearson"] == pytest.approx(pooled.pearson)


def test_the_command_ends_with_one_message(tmp_path):
    command = [sys.executable, "-m", "analysis.report", f"runs={tmp_path}"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == (
        f"error: there are no run folders in {tmp_path}. Train some, or name another runs=..."
    )
