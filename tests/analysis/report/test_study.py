"""The report of a study: planted effects are found, level sets are the unit, and nothing of others is imported."""

import csv
import re

import numpy as np
import pandas as pd
import pytest
import yaml

import segar
from segar.analysis.collect import collect_tables
from segar.analysis.report.make import report_results
from segar.analysis.report.study.claims import claim_of
from segar.analysis.report.study.figures import in_rounds, of_all_runs, success
from segar.analysis.report.study.reading import read_study
from segar.analysis.stats.estimate import Estimate
from segar.experiments.commands.config_store import register_settings
from segar.experiments.commands.hydra_app import compose_data, initialized
from segar.experiments.reproduce import SETTINGS, with_sweep_tag, write_plan
from segar.experiments.reproduction.experiment_file import ClaimConfig
from segar.experiments.reproduction.plan import make_plan
from segar.experiments.runs.run_folder import (
    LEVELS_TEST,
    LEVELS_TRAIN,
    SUMMARY,
    folder_path,
    read_evaluation,
    write_json,
)
from segar.experiments.runs.trust import TRUSTED
from segar.experiments.settings import ConfigError, RunFolderError
from segar.experiments.study import build, study_of
from segar.levels import Levels
from segar.metrics import spread, w2
from tests.synthetic_runs import write_run, write_transfer

STUDY = {
    "title": "Planted effects",
    "settings": {"observation": "state", "levels.test_count": 20, "tracking": "none"},
    "grid": {"families": ["empty-easy", "empty-hard"], "counts": [1, 10], "seeds": 6, "vary": {"algorithm.gamma": [0.9, 0.99]}},
    "transfers": [{"family": "empty", "difficulty": "hard"}],
    "claims": {
        "distance": {"says": "The gap follows W2.", "test": "correlation", "given": ["panel"], "expected": "negative"},
        "gamma": {"says": "Gamma costs.", "test": "difference", "between": {"algorithm.gamma": [0.99, 0.9]},
                  "expected": "negative"},
        "hard": {"says": "Hard levels do not.", "test": "difference", "between": {"difficulty": ["hard", "easy"]},
                 "expected": "none", "margin": 0.5},
        "far": {"says": "Elsewhere all is worse.", "test": "mean", "tested_on": "empty-hard", "expected": "negative"},
        "own": {"says": "A test of one's own.", "test": "mean", "where": {"n": 10}, "expected": "negative"},
    },
}  # fmt: skip


def planted(work, level_files=False):
    """Stands for training: the gap is -4 W2, and 2 worse with the larger gamma; chance is that of the level set.

    A little noise is each run's own: differences that are equal in all blocks would have no interval.
    """
    run = work.run
    rng = np.random.default_rng([run.levels.seed, run.levels.count])
    noise = np.random.default_rng(list(folder_path(run).name.encode())).normal()
    w2 = run.levels.count**-0.3 * (1 + 0.1 * rng.normal())
    cost = 2.0 if run.algorithm.gamma == 0.99 else 0.0
    gap = -4 * w2 - cost + 0.1 * rng.normal() + 0.01 * noise
    write_run(run, gap=gap, w2=w2 / 2, level_files=level_files)
    for transfer in work.transfers:
        write_transfer(transfer, run, -9.0)


def made(tmp_path, data=STUDY, work_off=planted):
    """The results folder of a study whose runs are planted."""
    tmp_path.mkdir(exist_ok=True)
    path = tmp_path / "planted.yaml"
    path.write_text(yaml.safe_dump(data))
    study, overrides = study_of([str(path), f"root={tmp_path}/runs", "processes=1"])
    register_settings("study", SETTINGS)
    with initialized():
        grids = {study.name: study.experiment}
        config = build(compose_data(overrides, "study"), grids=grids, study=study.as_data())
    plan = make_plan(config.at_scale(), with_sweep_tag(config), config.folder)
    for work in plan.runs:
        work_off(work)
    write_plan(config, plan)
    collect_tables(config.folder)
    return config.folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return made(tmp_path_factory.mktemp("study"))


def test_planted_effects_are_found_and_their_absence_too(folder):
    report_results(folder)
    with (folder / "claims.csv").open() as stream:
        found = {row["claim"]: row for row in csv.DictReader(stream)}
    assert {name: row["verdict"] for name, row in found.items()} == {
        "distance": "holds", "gamma": "holds", "hard": "holds", "own": "holds", "far": "holds",
    }  # fmt: skip
    assert float(found["gamma"]["estimate"]) == pytest.approx(-2.0, abs=0.02)
    # 24 agents with a planted gap of -9 there, and those that have these levels as their own test levels.
    runs = read_study(folder).runs
    own = runs[runs["panel"] == "empty-hard"]["gap"].mean()
    assert (float(found["far"]["estimate"]), found["far"]["n"]) == (pytest.approx((own - 9.0) / 2, abs=1e-3), "48")
    page = (folder / "report.html").read_text()
    assert "✓ holds" in page and "reproduced</b>" not in page
    rules = page[page.index('<h2 id="how-verdicts-are-decided"') :]
    assert "there a block is a whole panel" in rules and "3 level sets or panels" in rules
    assert not re.search(r"3a|4b|Holm|attribution|explained", rules)
    assert all(
        (folder / "figures" / f"{name}.png").exists() for name in ("gap_against_distance", "success", "gap", "curves")
    )


def claimed(study, test, expected="negative", **claim):
    """A claim of these words about the runs of a study."""
    return claim_of(study, "mine", ClaimConfig("x", test, expected, **claim))


@pytest.fixture(scope="module")
def study(folder):
    return read_study(folder)


def test_kinds_of_agents_and_blocks_are_those_of_the_study(study):
    assert study.agents == ["gamma=0.9", "gamma=0.99"]
    assert study.panels == ["empty-easy", "empty-hard"]
    assert "24 rows in 12 blocks" in claimed(study, "difference", between={"algorithm.gamma": [0.99, 0.9]}).note


@pytest.mark.parametrize(
    ("claim", "message"),
    [
        ({"test": "mean", "of": "gapp"}, "claims.mine: of: the runs have no column 'gapp'. Did you mean"),
        (
            {"test": "mean", "tested_on": "empty-medium"},
            "no agent was tested on 'empty-medium'. Did you mean 'empty-hard'?",
        ),
        ({"test": f"{__name__}:upside_down"}, f"{__name__}:upside_down returns an interval from 0.6 to 0.4"),
        ({"test": f"{__name__}:wrong"}, f"claims.mine: test: {__name__}:wrong raises KeyError: 'no such column'"),
        ({"test": "correlation", "against": "gap_deterministic"}, "a column has no correlation with itself"),
        ({"test": "correlation", "given": ("w2_exact",)}, "a column has no correlation with itself"),
        (
            {"test": "mean", "of": "results/velocity_test"},
            "Only results that are one number or truth per environment have",
        ),
    ],
)
def test_a_claim_that_these_runs_cannot_decide_is_told(study, claim, message):
    with pytest.raises(ConfigError, match=re.escape(message)):
        claimed(study, **claim)


def test_a_column_is_not_correlated_with_itself():
    with pytest.raises(ConfigError, match="it must be another column than those that it is correlated with"):
        ClaimConfig("x", "correlation", "none", of="n", given=("n",))


@pytest.mark.slow
def test_what_is_not_testable_is_printed_with_the_reason(tmp_path, capsys):
    claims = {"late": {"says": "x", "test": "mean", "of": "radius", "expected": "none"}}
    report_results(made(tmp_path, {**STUDY, "claims": claims, "transfers": []}))
    said = "late: cannot be tested: x It needs another claim or other runs (claims.late: of: the runs have no column"
    assert said in capsys.readouterr().out


@pytest.mark.parametrize(
    ("claim", "message"),
    [
        ({"between": {"family": ["emty", "empty"]}, "test": "difference"},
         "claims.mine.between: no run has family=emty; there are empty."),
        ({"where": {"difficulty": "medium"}}, "claims.mine.where: no run has difficulty=medium; there are easy, hard."),
        ({"tested_on": "nonsense"}, "claims.mine.tested_on: no agent is tested on 'nonsense'; transfers are empty-hard."),
        ({"of": "algorithm.gama"}, "claims.mine.of: runs do not differ in algorithm.gama; grid.vary has such settings"),
        ({"expected": None}, "claims.mine.expected: say what you expect: negative, positive, none"),
        ({"of": "results/distanse_to_goal_test"},
         "claims.mine.of: no task has a result 'distanse_to_goal', as results/distanse_to_goal_test asks: puttputt"),
        ({"on": "empty-hard"}, "name the levels of a transfer by tested_on: ...; YAML takes the key `on` for true"),
        ({"test": "nowhere_to_be:found"}, "claims.mine.test: 'nowhere_to_be:found' cannot be imported"),
        ({"test": "correlation", "against": "family"}, "claims.mine.against: the column family holds text, such as 'empty'"),
    ],
)  # fmt: skip
def test_a_claim_about_what_no_run_of_the_plan_has_ends_the_plan(tmp_path, claim, message):
    stated = {"says": "x", "test": "mean", "expected": "none", **claim}
    stated = {key: value for key, value in stated.items() if value is not None}
    with pytest.raises(ConfigError, match=re.escape(message)):
        made(tmp_path, {**STUDY, "claims": {"mine": stated}})
    assert not (tmp_path / "runs").exists()


def with_levels(work):
    """:func:`planted`, with the levels in files and a result of the task's own."""
    planted(work, level_files=True)
    run = work.run
    for place in (folder_path(run), *(transfer.folder(run) for transfer in work.transfers)):
        left = {"evaluation/test/results/distance_to_goal/deterministic": float(run.levels.count)}
        write_json(place / SUMMARY, {**(read_evaluation(place) or {}), **left})
    for transfer in work.transfers:
        transfer.levels(run).save(transfer.folder(run) / "levels.npz")


SMALL = {
    **STUDY,
    "settings": {**STUDY["settings"], "levels.test_count": 5},
    "grid": {"families": ["empty-easy"], "counts": [1, 3], "seeds": 3},
    "claims": {
        "left": {"says": "More", "test": "mean", "of": "results/distance_to_goal_test", "expected": "positive"},
        "far": {"says": "Farther is worse.", "test": "correlation", "expected": "negative"},
        "own_unit": {"says": "The same.", "test": "correlation", "against": "w2_exact", "expected": "negative"},
    },
}


@pytest.mark.slow
def test_w2_of_a_study_with_a_transfer_is_in_one_unit_and_so_are_its_claims(tmp_path):
    folder = made(tmp_path, SMALL, with_levels)
    study = read_study(folder)
    unit = spread(segar.family("empty-easy"), segar.family("empty-hard"))
    for table, there in ((study.runs, LEVELS_TEST), (study.evidence.results.moved, "evaluations/*/levels.npz")):
        for row in table.to_dict("records"):
            run = tmp_path / "runs" / row["run"]
            (test,) = run.glob(there)
            expected = w2(Levels.load(run / LEVELS_TRAIN), Levels.load(test), scale=unit)
            assert row["w2_exact_common"] == pytest.approx(expected)
    assert claimed(study, "correlation").findings[0].test == "gap against w2_exact_common"
    report_results(folder)
    page = (folder / "report.html").read_text()
    assert "in one unit: standard deviations over all distributions of the study" in page
    assert f"results={folder}" in page


def test_results_of_the_task_are_columns_of_claims(tmp_path):
    study = read_study(made(tmp_path, SMALL, with_levels))
    claim = claimed(study, "mean", "positive", of="results/distance_to_goal_test")
    assert claim.findings[0].found.estimate == pytest.approx(2.0)


def test_more_test_levels_make_no_more_blocks_and_two_blocks_no_interval(tmp_path):
    tests = {"vary": {"levels.test": ["empty-easy", "empty-medium"]}}
    for seeds, note in ((2, "2 level sets: no interval"), (3, "12 rows in 3 blocks")):
        grid = {"families": ["empty-easy"], "counts": [1, 10], "seeds": seeds, **tests}
        study = read_study(made(tmp_path / str(seeds), {**STUDY, "grid": grid, "claims": {}}))
        (finding,) = claimed(study, "correlation", against="w2_exact").findings
        assert finding.found.note == note
        assert np.isnan(finding.found.low) == (seeds == 2) and (finding.verdict == "cannot be tested") == (seeds == 2)


COMPARED = {**STUDY["grid"], "families": ["empty-easy", "empty-medium", "empty-hard"], "seeds": 3, "vary": {}}


def test_a_correlation_that_compares_panels_has_panels_as_blocks_and_needs_three(tmp_path):
    """Whatever is given: only names that tell all panels apart compare runs within panels."""
    for families, whole, within in ((COMPARED["families"], "18 rows in 3 blocks", "18 rows in 9 blocks"),
                                    (COMPARED["families"][:2], "2 panels: no interval", "12 rows in 6 blocks")):  # fmt: skip
        grid = {**COMPARED, "families": families}
        study = read_study(made(tmp_path / str(len(families)), {**STUDY, "grid": grid, "claims": {}, "transfers": []}))
        notes = {(): whole, ("log_n",): whole, ("agent",): whole, ("panel",): within, ("cell",): within}
        for given, note in notes.items():
            claim = claimed(study, "correlation", against="w2_exact", given=given)
            assert claim.findings[0].found.note == note, given
            assert (claim.verdict("tested") == "cannot be tested") == note.startswith("2 panels")


@pytest.mark.slow
def test_agents_that_are_tested_on_the_levels_of_a_transfer_anyway_count_with_these(tmp_path):
    """Agents of empty-hard have no transfer to empty-hard."""
    claim = {"test": "difference", "between": {"difficulty": ["hard", "easy"]}, "tested_on": "empty-hard"}
    claims = {"there": {"says": "x", **claim, "expected": "positive"}}
    study = read_study(made(tmp_path / "own", {**STUDY, "claims": claims}))
    rows = study.tested_on("empty-hard")
    assert sorted(rows["run"]) == sorted(study.runs["run"])
    own = rows[rows["difficulty"] == "hard"].set_index("run")["gap"]
    assert own.equals(study.runs[study.runs["difficulty"] == "hard"].set_index("run")["gap"].loc[own.index])
    np.testing.assert_allclose(rows[rows["difficulty"] == "easy"]["gap"], -9.0)
    assert claimed(study, expected="positive", **claim).findings[0].found.n == 24
    settings, why = {**STUDY["settings"], "levels.test": "empty-medium"}, "its own test levels"
    with pytest.raises(ConfigError, match=f"no agent with difficulty=hard is tested on 'empty-hard': {why}"):
        made(tmp_path / "others", {**STUDY, "settings": settings, "claims": claims})


@pytest.mark.parametrize(("held", "sets", "said"), [(3, 1, "gave the same levels"), (4, 3, "level sets share levels")])
def test_seeds_that_give_all_levels_of_a_file_are_one_level_set_and_shared_levels_are_told(
    tmp_path, undrawn, held, sets, said
):
    """The study's file names the level file beside it."""
    segar.family("empty-easy").sample(held, seed=0).save(tmp_path / "few.npz")
    settings = {**STUDY["settings"], "levels.test_count": 5, "levels.test": "empty-hard"}
    vary = {"algorithm.gamma": [0.9, 0.99]}
    grid = {"families": ["few.npz"], "counts": [3], "seeds": 2, "level_sets": 3, "vary": vary}
    claims = {"gamma": STUDY["claims"]["gamma"]}
    data = {**STUDY, "settings": settings, "grid": grid, "claims": claims, "transfers": []}
    folder = made(tmp_path, data, with_levels)
    study = read_study(folder)
    assert len(set(study.runs["seed"])) == sets
    found = claimed(study, "difference", between=vary).findings[0].found
    assert found.n == 6 and np.isfinite(found.low) == (sets == 3)  # pairs of all agents on all seeds of levels
    report_results(folder)
    assert said in (folder / "report.html").read_text()


@pytest.mark.slow
@pytest.mark.parametrize("mixes", [False, True])
def test_a_report_whose_means_mix_versions_of_the_code_says_so_where_it_begins(tmp_path, mixes):
    def by_two_versions(work):
        seed = work.run.seed if mixes else 0
        write_run(work.run, code={"levels": "0" * 16, "learner": f"{seed % 2:016d}"})

    folder = made(tmp_path, {**STUDY, "claims": {}, "transfers": []}, by_two_versions)
    report_results(folder)
    page = (folder / "report.html").read_text()
    assert ("were made by several versions of the code, which means and claims mix" in page) == mixes


def test_a_window_of_the_learning_curve_holds_an_episode_of_every_environment():
    """Two environments: short episodes end early, and long ones all at once."""
    rows = pd.DataFrame({
        "run": "a", "panel": "p", "n": 1, "frames": [10, 20, 30, 40, 50],
        "value": [-1.0, -1.0, -5.0, -1.0, -5.0], "episodes": [1, 1, 2, 2, 2],
    })  # fmt: skip
    found = in_rounds(rows, 20.0)
    assert list(found["frames"]) == [30.0, 50.0]  # the first 10 frames are no whole window
    assert list(found["value"]) == pytest.approx([-(1 + 10) / 3, -(2 + 10) / 4])
    assert list(in_rounds(rows, 100.0)["value"]) == pytest.approx([np.average(rows["value"], weights=rows["episodes"])])


def test_the_runs_of_a_curve_have_the_same_windows_and_points_of_all_of_them():
    """The second run ends no episode in its last frames, and the third none in its first."""
    times = {"a": [10, 20, 30, 40], "b": [10, 20, 30], "c": [30, 40]}
    rows = pd.DataFrame([
        {"run": run, "panel": "p", "n": 1, "frames": one, "value": -1.0, "episodes": 1}
        for run, frames in times.items() for one in frames
    ])  # fmt: skip
    found = in_rounds(rows, 20.0)
    assert {run: list(part["frames"]) for run, part in found.groupby("run")} == {
        "a": [20.0, 40.0], "b": [20.0, 40.0], "c": [40.0],
    }  # fmt: skip
    assert set(of_all_runs(found)["frames"]) == {40.0}
    other = found.assign(panel="q")
    both = of_all_runs(pd.concat([found, other], ignore_index=True))
    assert len(both) == 6, "curves of other panels count by themselves"


OPTIONS = {"title": "x", "settings": STUDY["settings"], "claims": {}}


@pytest.mark.parametrize(
    ("group", "option", "values", "agents"),
    [
        ("observation", "hidden", [[], ["Mass"]], ["hidden=['Mass']", "hidden=[]"]),
        ("task", "max_steps", [10, 20], ["max_steps=10", "max_steps=20"]),
    ],
)
def test_values_of_an_option_are_compared_by_their_own_name_and_by_the_whole(tmp_path, group, option, values, agents):
    name = f"{group}.options.{option}"
    grid = {"families": ["empty-easy"], "counts": [1, 10], "seeds": 3, "vary": {name: values}}
    folder = made(tmp_path, {**OPTIONS, "grid": grid})
    study = read_study(folder)
    assert study.agents == agents
    for between in ({group: sorted(set(study.runs[group]))}, {name: values}):
        assert claimed(study, "difference", "none", between=between).findings[0].found.n == 6


def test_a_claim_of_pairs_that_no_runs_make_ends_the_plan(tmp_path):
    between = {"n": [10, 1]}
    claims = {"size": {"says": "x", "test": "difference", "expected": "none", "between": between}}
    grid = {"families": ["empty-easy"], "counts": [1, 10], "seeds": 3}
    made(tmp_path / "nested", {**OPTIONS, "grid": grid, "claims": claims})
    with pytest.raises(ConfigError, match=r"claims.size.between: no two runs are equal but for n=10 and 1"):
        made(tmp_path / "apart", {**OPTIONS, "grid": {**grid, "nested": False}, "claims": claims})
    claims["size"]["where"] = {"n": 10}
    with pytest.raises(ConfigError, match=r"claims.size.between: no run that counts has n=1"):
        made(tmp_path / "where", {**OPTIONS, "grid": grid, "claims": claims})


def test_a_study_has_no_gate_and_says_so(study):
    claim = claimed(study, "mean")
    assert claim.findings[0].runs == "all runs" and claim.verdict("tested") == "supported"


def test_crossed_level_sets_have_a_seed_in_every_row(tmp_path):
    grid = {"families": ["empty-easy"], "counts": [1], "seeds": 2, "level_sets": 2}
    folder = made(tmp_path, {**OPTIONS, "grid": grid})
    table = pd.read_parquet(folder / "runs.parquet")
    assert sorted(zip(table["seed"], table["levels.seed"], strict=True)) == [(1, 1), (1, 2), (2, 1), (2, 2)]


def test_success_has_a_line_for_training_and_one_for_test_levels_inside_the_axes(study):
    drawn = success(study)
    lows, highs = drawn.table["low"], drawn.table["high"]
    assert (lows.dropna() >= 0).all() and (highs.dropna() <= 1).all()
    labels = [text.get_text() for text in drawn.figure.legends[0].get_texts()]
    assert labels == [f"gamma={g}, {levels} levels" for g in (0.9, 0.99) for levels in ("test", "training")]
    places = [tuple(line.get_xdata()) for line in drawn.figure.axes[0].lines if line.get_marker() == "o"]
    assert len(set(places)) == len(places) == 4


def half(runs):
    return Estimate(0.5, 0.4, 0.6, len(runs), 0.001)


def upside_down(runs):
    return Estimate(0.5, 0.6, 0.4, len(runs), 0.001)


def wrong(runs):
    raise KeyError("no such column")


def test_a_test_of_ones_own_gets_the_runs_and_returns_an_estimate(study):
    claim = claimed(study, f"{__name__}:half", "positive")
    assert claim.verdict("tested") == "supported"
    assert claim.findings[0].found.n == 48


def test_the_study_of_somebody_else_imports_nothing_without_trust(tmp_path, monkeypatch):
    claims = {"mine": {"says": "x", "test": f"{__name__}:half", "expected": "positive"}}
    grid = {"families": ["empty-easy"], "counts": [1], "seeds": 3}
    folder = made(tmp_path, {**STUDY, "grid": grid, "claims": claims, "transfers": []})
    path = folder / "study.yaml"
    path.write_text(path.read_text().replace("Planted effects", "Other effects"))
    with pytest.raises(RunFolderError, match="was not written by you"):
        report_results(folder)
    monkeypatch.setenv(TRUSTED, __name__)
    read_study(folder)


def test_level_sets_that_agents_share_count_once(tmp_path, undrawn):
    data = {**STUDY, "grid": {**STUDY["grid"], "seeds": 3, "level_sets": 2, "families": ["empty-easy"]}, "claims": {}}
    data["transfers"] = []
    folder = made(tmp_path, data)
    report_results(folder)
    page = (folder / "report.html").read_text()
    assert "Up to 3 agents of a kind share a level set" in page
    assert "have 2 level sets of a size" in page
