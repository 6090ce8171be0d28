"""The page of algorithms: what is missing is trained, what is there is kept, and the table is that of the run."""

import pandas as pd
import pytest

from analysis import curves as page
from analysis.curves import BEGIN, END, Curve, CurvesConfig, curves, with_table
from experiments.runs.run_folder import read_summary, run_folders
from experiments.settings import ConfigError

TINY = (
    "levels.count=2",
    "levels.test_count=2",
    "algorithm.num_envs=8",
    "algorithm.num_steps=8",
    "evaluation.episodes=2",
)


@pytest.fixture
def docs(tmp_path, monkeypatch):
    monkeypatch.setattr(page, "CURVES", (Curve("new", "empty-easy", TINY, 256), Curve("old", "empty-hard", (), 10)))
    monkeypatch.setattr(page, "POINTS", 2)
    (tmp_path / "reference").mkdir()
    (tmp_path / "reference" / "algorithms.md").write_text(f"# Algorithms\n\n{BEGIN}\nan older table\n{END}\nthe rest\n")
    return tmp_path


def test_a_run_becomes_a_line_a_curve_and_a_figure_and_other_lines_stay(docs, tmp_path):
    curves(CurvesConfig(only=("new",), root=str(tmp_path / "runs"), out=str(docs), num_threads=1))
    table = pd.read_csv(docs / "results" / "algorithms.csv")
    other = table.assign(name="old", levels="empty-hard", minutes=7.25)
    gone = table.assign(name="no curve any more")
    pd.concat([other, gone, table.assign(minutes=0.0)]).to_csv(docs / "results" / "algorithms.csv", index=False)
    curves(CurvesConfig(only=("new",), root=str(tmp_path / "runs"), out=str(docs), num_threads=1))
    again = pd.read_csv(docs / "results" / "algorithms.csv")
    assert list(again["name"]) == ["new", "old"] and again["minutes"][1] == 7.25
    (folder,) = run_folders(tmp_path / "runs")
    pd.testing.assert_frame_equal(again.iloc[:1], table)
    for mode in ("deterministic", "sampled"):
        expected = read_summary(folder)[f"evaluation/test/success/{mode}"]
        assert table[f"test_success_{mode}"][0] == pytest.approx(expected)
    points = pd.read_csv(docs / "results" / "curves.csv")
    assert list(points["frames"]) == [128, 128, 256, 256] and {*points["mode"]} == {"deterministic", "sampled"}
    text = (docs / "reference" / "algorithms.md").read_text()
    assert "older" not in text and text.endswith(f"{END}\nthe rest\n") and "| old | empty-hard |" in text
    assert (docs / "images" / "algorithms.png").stat().st_size > 1000


def test_an_unknown_curve_is_named():
    with pytest.raises(ConfigError, match=r"only: 'sca'.*Did you mean 'sac'"):
        CurvesConfig(only=("sca",))


def test_a_page_without_a_place_for_the_table_is_refused():
    with pytest.raises(ValueError, match="the page needs the lines"):
        with_table("no marks", pd.DataFrame())
