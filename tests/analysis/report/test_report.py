"""Reports are made from tables alone, say the same each time, and the shipped ones are what their tables give."""

import json
import re

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from segar.analysis.plotting import style
from segar.analysis.plotting.figures import PAGE_WIDTH
from segar.analysis.report.document.blocks import pieces
from segar.analysis.report.document.pdf import BROWSERS, print_page
from segar.analysis.report.document.tables import STATISTICS
from segar.analysis.report.figures import FIGURES
from segar.analysis.report.figures.drawing import NoFigure
from segar.analysis.report.make import SHIPPED, ReportConfig, make_report, report, track
from segar.analysis.report.number_format import estimate_text, p_value, plain, signed, with_interval
from segar.analysis.stats.estimate import Estimate
from segar.experiments.settings import ConfigError, RunFolderError, TrackingConfig
from segar.experiments.tracking.mlflow_store import open_store
from segar.support import read_manifest
from tests.analysis.report.conftest import stand_in
from tests.places import ROOT
from tests.synthetic_results import PARTS, everything, evidence_of, run_rows, write_results

SHIPPED_SCALES = sorted(path.parent for path in SHIPPED.glob("*/runs.parquet"))
PICTURE = re.compile(r"data:image/svg\+xml;base64,[A-Za-z0-9+/=]+")


def few_runs():
    """One family, one seed."""
    return run_rows(np.random.default_rng(0), "figure_3a", seeds=1, families=("empty",))


def undrawable(evidence):
    raise NoFigure("not here")


def page_of(folder, tables=None):
    """The page of the report on tables in a folder."""
    if tables is not None:
        write_results(folder, tables)
    make_report(ReportConfig(str(folder)))
    return (folder / "report.html").read_text()


# Drawing takes most of the time: of the larger scales, only the slow tests draw.
LARGER = [at for at in SHIPPED_SCALES if at.name != "quick"]
SCALES = [pytest.param((at, at not in LARGER), marks=pytest.mark.results, id=at.name) for at in SHIPPED_SCALES]
SCALES += [
    pytest.param((at, True), marks=[pytest.mark.results, pytest.mark.slow], id=f"{at.name}, drawn") for at in LARGER
]


@pytest.fixture(scope="module", params=SCALES)
def again(request, tmp_path_factory):
    """A shipped report, and the same made anew from its tables."""
    shipped, drawn = request.param
    out = tmp_path_factory.mktemp("again") / shipped.name
    with pytest.MonkeyPatch.context() as patched:
        if not drawn:
            patched.setattr("segar.analysis.report.document.files.save_figure", stand_in)
        return shipped, make_report(ReportConfig(str(shipped), out=str(out)))


def test_the_shipped_tables_give_the_shipped_numbers(again):
    assert {path.stem for path in SHIPPED.glob("*/statistics/*.csv")} <= {*STATISTICS}
    shipped, made = again
    names = {str(path.relative_to(made.folder)) for path in made.files}
    there = {f"statistics/{path.name}" for path in (shipped / "statistics").iterdir()} | {"findings.md", "claims.csv"}
    figures = [one for one in read_manifest(SHIPPED) if re.match(rf"{shipped.name}/figures/.*\.csv", one.path)]
    of_figures = {one.path.removeprefix(f"{shipped.name}/") for one in figures}
    assert {name for name in names if name.endswith((".csv", ".md"))} == there | of_figures
    assert [one.as_in(made.folder.parent) for one in figures] == figures, "note them again: segar results record"
    for name in sorted(there):
        assert (made.folder / name).read_text() == (shipped / name).read_text(), name


def test_figures_that_were_drawn_fit_on_a_page_in_letters_that_can_be_read(again):
    for path in (again[1].folder / "figures").glob("*.png"):
        with Image.open(path) as image:
            width, height = (pixels / style.SETTINGS["savefig.dpi"] for pixels in image.size)
        assert width <= PAGE_WIDTH + 0.01 and height <= 1.35 * PAGE_WIDTH, path.name


def test_a_page_needs_nothing_else_and_names_no_place_of_this_machine(again):
    page = (again[1].folder / "report.html").read_text()
    assert len(PICTURE.findall(page)) == page.count("<img ")
    text = PICTURE.sub("", page)
    assert not re.search(r"""(src|href)=["'](?!#)|<script|@import|url\(""", text.replace('src=""', ""))
    assert "nan" not in re.findall(r"\w+", text)
    assert str(ROOT) not in text and str(again[1].folder) not in text


def test_every_figure_names_its_data_and_the_command_that_draws_it(again):
    page = (again[1].folder / "report.html").read_text()
    for path in sorted((again[1].folder / "figures").glob("*.csv")):
        assert f"figures/{path.name}" in page
        assert f"segar report results=docs/results/{again[0].name} only=[{path.stem}]" in page
        assert len(pd.read_csv(path)) > 0


def fake_browser(folder, program):
    """A folder for PATH that holds a Chromium which runs this program of the shell."""
    folder.mkdir()
    (folder / "chromium").write_text(f"#!/bin/sh\n{program}\n")
    (folder / "chromium").chmod(0o755)
    return f"{folder}:/usr/bin:/bin"


PRINTS = 'for one; do case $one in --print-to-pdf=*) echo "%PDF- of $page" > "${one#*=}";; esac; done'


def test_a_browser_prints_the_page(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", fake_browser(tmp_path / "bin", PRINTS))
    folder = write_results(tmp_path / "quick-1234", {"runs": few_runs()})
    monkeypatch.setattr("segar.analysis.report.make.FIGURES", dict.fromkeys(FIGURES, undrawable))
    made = make_report(ReportConfig(str(folder), pdf=True))
    assert folder / "report.pdf" in made.files
    assert (folder / "report.pdf").read_text().startswith("%PDF-")


@pytest.mark.parametrize(
    ("program", "says"),
    [
        (None, f"none of {BROWSERS[0]}.* open .*page.html in any"),
        ("echo lost >&2; exit 3", "lost"),
        ("exit 0", "says: nothing"),
    ],
)
def test_a_page_that_cannot_be_printed_leaves_what_was_there(tmp_path, monkeypatch, program, says):
    monkeypatch.setenv("PATH", str(tmp_path) if program is None else fake_browser(tmp_path / "bin", program))
    (tmp_path / "page.pdf").write_text("earlier")
    with pytest.raises(RunFolderError, match=says):
        print_page(tmp_path / "page.html", tmp_path / "page.pdf")
    assert (tmp_path / "page.pdf").read_text() == "earlier"


def test_all_experiments_find_their_place(tmp_path, undrawn):
    folder = write_results(tmp_path / "standard-1234", everything(np.random.default_rng(0), seeds=1))
    report = make_report(ReportConfig(str(folder)))
    drawn = {path.stem for path in report.files if path.suffix == ".svg"}
    # There are no tables of studies here, so no floor, no planner and no scores, either.
    assert drawn == set(FIGURES) - {"w2_study", "performance_profiles", "dose_response", "twins"}
    page = (folder / "report.html").read_text()
    assert "its experiments at scale <code>standard</code>" in page
    assert "No figure: the study of distances was not run" in page
    assert "Self-supervised losses: the floor and the oracle were not measured in empty-easy" in page
    assert "SAC and PPO: several algorithms were not run" in page


def test_each_group_of_factors_gets_its_part_of_the_gap_of_runs_with_all_combinations(tmp_path):
    tables = everything(np.random.default_rng(3))
    evidence = evidence_of(tmp_path / "standard-1", tables)
    found = evidence.attribution
    assert len(found) == 3 * 3 * 5 * 3  # families, seeds, numbers of levels, groups
    for group, part in PARTS.items():
        rows = found[found["group"] == group]
        np.testing.assert_allclose(rows["part"], part * rows["gap"])
    assert set(evidence.results.between["test_changed"]).isdisjoint(evidence.results.moved["test_changed"])
    tables["transfers"] = tables["transfers"].iloc[:-1]  # rest and properties, of the last run
    less = evidence_of(tmp_path / "standard-1", tables)
    assert len(less.attribution) == len(found) - 3  # a run without all combinations is left out


def test_one_figure_alone_is_drawn(tmp_path, capsys):
    folder = write_results(tmp_path, {"runs": few_runs()})
    report(ReportConfig(str(folder), only=("train_and_test",)))
    assert sorted(path.name for path in (folder / "figures").iterdir()) == [
        f"train_and_test.{suffix}" for suffix in ("csv", "png", "svg")
    ]
    assert not (folder / "report.html").exists()
    assert "train_and_test.png" in capsys.readouterr().out


@pytest.mark.parametrize("runs", [1, 4])
def test_a_handful_of_runs_is_reported_too(tmp_path, undrawn, runs):
    own, left = (tmp_path / "figures" / name for name in ("mine.png", "w2_study.png"))
    own.parent.mkdir()
    for path in (own, left):
        path.write_bytes(b"drawn before")
    page = page_of(tmp_path, {"runs": few_runs().iloc[[0, 5, 10, 1]].head(runs).reset_index(drop=True)})
    assert f"{runs} run" in page
    assert own.exists() and not left.exists(), "what no report calls so stays"


def test_the_smallest_scale_and_a_reproduction_that_goes_on_are_marked_as_preliminary(tmp_path, undrawn):
    runs = run_rows(np.random.default_rng(0), "figure_5a", seeds=1, families=("empty",))  # no run of the main grid
    missing = pd.DataFrame({"run": ["a", "b"], "reason": "not begun", "name": "figure_3a", "experiment": "Gap"})
    for name, plan, says in (("smoke-1", None, "smallest scale"), ("quick-1", {"scale": "quick"}, "2 runs or tests")):
        folder = write_results(tmp_path / name, {"runs": runs})
        missing.to_csv(folder / "missing.csv", index=False)
        if plan:
            (folder / "plan.json").write_text(json.dumps(plan))
        page = page_of(folder)
        assert "<strong>Preliminary.</strong>" in page and says in page


def test_versions_seeds_and_settings_of_the_runs_are_said(tmp_path, undrawn):
    stated = {"algorithm.gamma": "0.95", "algorithm.encoder": "impala", "algorithm.reward_transform": "none"}
    runs = pd.concat([few_runs().assign(seed=seed, commit=f"{seed}" * 40) for seed in (4, 7)], ignore_index=True)
    runs["code"] = np.where(runs["seed"] == 4, "f0u2", "5even")
    runs["run"] += runs["code"]
    runs = runs.assign(libraries="python 3.11.7, torch 2.13.0", computed_with="AVX512, bf16", observation="textures")
    page = page_of(tmp_path / "quick-5678", {"runs": runs.assign(**stated)})
    assert "Libraries: python 3.11.7, torch 2.13.0." in page
    assert "Computed with: AVX512, bf16." in page
    assert "made by several versions of the code" in page
    for told in ("<code>f0u2</code>", "<code>444444444</code>", "<code>5even</code>", "<code>777777777</code>"):
        assert told in page
    assert ">4, 7</td>" in page
    words = re.sub("<[^>]+>", " ", page)
    assert re.search(r"gamma\s+0\.999\s+0\.95\s", words)
    assert re.search(r"reward\s+-d² and -100 on death, as it is\s+the same\s", words)
    assert re.search(r"encoder\s+IMPALA CNN\s+IMPALA CNN\s", words)
    assert re.search(r"observation\s+one frame of textures\s+one frame of textures\s", words)
    assert re.search(r"episodes on training levels\s+10\s+120\s", words)


def test_much_that_is_missing_is_summed_up_by_experiments(tmp_path, undrawn):
    folder = write_results(tmp_path, {"runs": few_runs()})
    lines = [f"a-s{seed},not begun,figure_3a,Grid" for seed in range(7)]
    lines += [f"b,the imported tables lack {what},memory,Memory" for what in ("probes", "transfer-x")]
    lines += ["c,not finished,memory,Memory"]
    (folder / "missing.csv").write_text("\n".join(["run,reason,name,experiment", *lines]))
    (folder / "figures").mkdir()
    (folder / "figures" / "w2_study.png").touch()
    page = page_of(folder)
    assert "Preliminary" not in page, "tables without a plan are shipped"
    assert "unknown: these tables do not state algorithm.gamma" in page
    assert not (folder / "figures" / "w2_study.png").exists()
    found = (folder / "findings.md").read_text()
    assert "| `figure_3a` | Grid | 7 | 0 | 0.7 |" in found  # a run took 0.1 hours
    assert "| `memory` | Memory | 1 | 1 | – |" in found


@pytest.mark.slow
def test_mlflow_gets_the_numbers_and_the_files_once(tmp_path, undrawn):
    folder = write_results(tmp_path / "quick-1", {"runs": few_runs()})
    tracking = {"name": "mlflow", "uri": None, "experiment": "segar"}
    (folder / "plan.json").write_text(json.dumps({"scale": "quick", "runs": str(tmp_path), "tracking": tracking}))
    track(folder, make_report(ReportConfig(str(folder))))
    report = make_report(ReportConfig(str(folder), tracking=True))  # which replaces the run
    client, experiment = open_store(TrackingConfig(**tracking), tmp_path)
    (run,) = client.search_runs([experiment], "tags.kind = 'report'")
    assert run.data.metrics["runs"] == 15
    pooled = report.subject.evidence.of_main("exact", "gap", "pooled")
    assert run.data.metrics["exact/pooled/pearson"] == pytest.approx(pooled.estimate)
    places = (None, "figures", "statistics")
    there = {entry.path for place in places for entry in client.list_artifacts(run.info.run_id, place)}
    assert {str(path.relative_to(folder)) for path in report.files} <= there


def test_what_is_wrong_with_the_tables_is_said(tmp_path):
    runs = few_runs()
    for tables, why in (
        (None, r"holds no runs.parquet. Name a folder of tables, such as docs/results/quick"),
        ({"runs": runs.drop(columns="w2_exact")}, "has no column 'w2_exact'"),
        ({"runs": runs.head(0)}, "has no rows: no run is finished"),
        ({"runs": pd.concat([runs, runs.head(1)])}, "run: .* must be there once: each row would count"),
        ({"runs": runs.assign(family=1.5)}, r"family: \[1.5\] is not allowed; it must be texts"),
        ({"runs": runs.assign(n=runs["n"].astype(str))}, "n: .* must be whole numbers from 1 up"),
        ({"runs": runs.assign(gap_deterministic=np.nan)}, "gap_deterministic: nan .* must be a number of some run"),
        ({"runs": runs.assign(code=[[1.0]] * len(runs))}, "code: 'list<.*>' .* must be numbers, truths or texts"),
    ):
        with pytest.raises(RunFolderError, match=why):
            page_of(tmp_path, tables)
    write_results(tmp_path, {"runs": runs})
    with pytest.raises(ConfigError, match=r"only: 'figure_3' is unknown\. Did you mean 'figure_3"):
        make_report(ReportConfig(str(tmp_path), only=("figure_3",)))
    (tmp_path / "missing.csv").write_text("run,reason\nempty-hard-n1,not begun\n")
    with pytest.raises(RunFolderError, match="has no column 'name'"):
        page_of(tmp_path)


@pytest.mark.parametrize(
    ("p", "text"), [(1.6e-6, "1.6e-6"), (0.0301, "0.030"), (0.000999, "0.001"), (float("nan"), "–")]
)
def test_p_values_are_short(p, text):
    assert p_value(p) == text


def test_estimates_are_said_with_interval_p_and_n():
    assert estimate_text(Estimate(-0.65, -0.79, -0.44, 45, 1.6e-6)) == "r = −0.65 [−0.79, −0.44], p = 1.6e-6, n = 45"
    assert estimate_text(Estimate.missing(2, "2 points")) == "no r: 2 points"
    assert signed(-0.001) == "−0.001" and signed(-1e-17) == signed(0.0) == plain(-0.0) == "0.00"


@pytest.mark.parametrize(
    ("estimate", "low", "high", "text"),
    [
        (-0.00095406, -0.00280348, 0.00089537, "−0.0010 [−0.0028, +0.0009]"),  # a small effect
        (-0.0193, -0.0379, -0.0006637, "−0.019 [−0.038, −0.001]"),  # an end that would be 0.00, and leaves out 0
        (12.342, 12.3418, 12.3422, "+12.34200 [+12.34180, +12.34220]"),  # an interval that would have no width
        (-0.12, -0.26, 0.02, "−0.12 [−0.26, +0.02]"),
        (3e-9, 1e-9, 5e-9, "+3e-9 [+1e-9, +5e-9]"),
        (0.0, 0.0, 0.0, "0.00 [0.00, 0.00]"),
        (0.25, float("nan"), float("nan"), "+0.25"),
    ],
)
def test_no_effect_is_shown_as_zero_that_is_not_and_its_interval_has_its_width(estimate, low, high, text):
    assert with_interval(Estimate(estimate, low, high, 9)) == text


def test_a_number_without_an_interval_says_why():
    found = Estimate(0.25, float("nan"), float("nan"), 2, note="2 blocks: no interval")
    assert with_interval(found) == "+0.25 (2 blocks: no interval)"
    assert estimate_text(found, "") == "+0.25 (2 blocks: no interval), n = 2"


def test_texts_hold_code_and_strong_words():
    assert pieces("see `a.csv`, **now**") == [("plain", "see "), ("code", "a.csv"), ("plain", ", "), ("strong", "now")]
