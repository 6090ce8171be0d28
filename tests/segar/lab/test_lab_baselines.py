"""Baselines: a table that can be gone on with, and its figure."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from segar import SegarError, cli
from segar.lab import Grader, Lab, Session, baselines, grade_baselines
from segar.lab.laws import law_in
from tests.places import ROOT
from tests.segar.lab.conftest import DISTRIBUTION, SPACE

TABLE = ROOT / "docs/results/lab/grades.csv"


@pytest.fixture(autouse=True)
def small(monkeypatch):
    for name, value in (("DRAWS", 60), ("CHILDREN", 20), ("KEPT", 10), ("GENERATIONS", 4), ("CANDIDATES", 8)):
        monkeypatch.setattr(baselines, name, value)


def test_the_command_writes_a_table_goes_on_with_it_and_draws_it(tmp_path, capsys):
    table, figure = tmp_path / "grades.csv", tmp_path / "grades.png"
    call = f"lab baselines --world tests.segar.lab.conftest:SPACE --budgets 40 --json -o {table}".split()
    assert cli.main([*call, "--worlds", "1"]) == 0
    first, said = table.read_text(), json.loads(capsys.readouterr().out)
    assert [row["baseline"] for row in said["means"]] == list(baselines.BASELINES)
    scores = {row["baseline"]: row["score"] for row in said["means"]}
    assert scores["empty"] == 0.0 and max(scores.values()) <= 1.0
    rows = list(csv.DictReader(first.splitlines()))
    table.write_text("\n".join(first.splitlines()[:-1]) + "\n")  # stopped before the last row
    assert cli.main([*call, "--worlds", "1"]) == 0
    again = list(csv.DictReader(table.read_text().splitlines()))
    assert [row | {"seconds": ""} for row in again] == [row | {"seconds": ""} for row in rows]
    capsys.readouterr()
    assert cli.main(["lab", "figure", str(table), "-o", str(figure)]) == 0
    assert "sequential minus evolution, passive, budget 40" in capsys.readouterr().out and figure.stat().st_size > 1000
    assert cli.main([*call, "--noise", "0.5"]) == 2 and "holds grades of another lab" in capsys.readouterr().err
    assert cli.main(["lab", "figure", str(table), "-o", "grades.bmp"]) == 2


def test_what_is_no_table_or_no_baseline_is_said(tmp_path):
    (tmp_path / "x.csv").write_text("a,b\n1,2\n")
    with pytest.raises(SegarError, match=r"x.csv is not a table of grades"):
        next(grade_baselines(tmp_path / "x.csv", Lab(DISTRIBUTION)))
    with pytest.raises(SegarError, match="no baseline 'nope'"):
        next(grade_baselines(tmp_path / "y.csv", Lab(DISTRIBUTION), baselines=["nope"]))


def test_least_squares_finds_the_law_that_is_a_sum_of_terms(monkeypatch):
    monkeypatch.setattr(baselines, "GUESSES", 30)
    lab = Lab(DISTRIBUTION, world=1, noise=0.0, budget=200)  # a drag and a field
    law = baselines.least_squares(Session(lab), np.random.default_rng(0))
    assert law["options"].keys() == law_in(lab.hidden, SPACE)["options"].keys()
    assert Grader(lab).grade(law).score.value > 0.7


def test_searches_beat_the_nearest_draw(lab, grader, monkeypatch):
    monkeypatch.setattr(baselines, "GENERATIONS", 10)
    scores = {}
    for name in ("nearest of 1,000", "evolution", "sequential"):
        sessions = [Session(replace(lab, budget=100)) for _ in range(2)]
        laws = [baselines.BASELINES[name][0](one, np.random.default_rng(k)) for k, one in enumerate(sessions)]
        scores[name] = np.mean([grade.score.value for grade in grader.grades(laws)])
        assert [session.left for session in sessions] == [0, 0]
    assert min(scores["evolution"], scores["sequential"]) > scores["nearest of 1,000"] + 0.1


@pytest.mark.results
def test_the_page_says_what_the_published_table_gives(tmp_path, capsys):
    assert cli.main(["lab", "figure", str(TABLE), "-o", str(tmp_path / "grades.png"), "--json"]) == 0
    found, page = json.loads(capsys.readouterr().out), (ROOT / "docs/how-to/find-the-law.md").read_text()
    assert {row["worlds"] for row in found["means"]} == {30}
    for name in baselines.BASELINES:
        cells = [row for row in found["means"] if row["baseline"] == name]
        shown = [f"{row['score']:.2f}" + _interval(row["low"], row["high"]) for row in cells]
        assert f"| {name} | {' | '.join(shown)} |" in page
    for budget, (gain, low, high) in found["active_minus_passive"].items():
        assert f"{gain:.2f}{_interval(low, high)} at {budget}" in " ".join(page.split())


def _interval(low, high):
    return "" if low is None else f" [{low:.2f}, {high:.2f}]"
