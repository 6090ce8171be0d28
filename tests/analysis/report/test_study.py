"""The report of a study: planted effects are found, level sets are the unit, and nothing of others is imported."""

import csv

import numpy as np
import pytest
import yaml

from analysis.collect import collect_tables
from analysis.report.make import report_results
from analysis.report.study import claim_of, claim_or_reason, read_study
from analysis.stats.estimate import Estimate
from experiments.commands.config_store import register_settings
from experiments.commands.hydra_app import compose_data, initialized
from experiments.reproduce import SETTINGS, with_sweep_tag, write_plan
from experiments.reproduction.experiment_file import ClaimConfig
from experiments.reproduction.plan import make_plan
from experiments.runs.run_folder import EPISODE_SCHEMA, EPISODES, SUMMARY, write_json, write_rows
from experiments.runs.trust import TRUSTED
from experiments.settings import ConfigError, RunFolderError, as_data
from experiments.study import build, study_of
from tests.synthetic_runs import episodes, write_run

STUDY = {
    "title": "Planted effects",
    "settings": {"observation": "state", "levels.test_count": 20, "tracking": "none"},
    "grid": {"families": ["empty-easy", "empty-hard"], "counts": [1, 10], "seeds": 6, "vary": {"algorithm.gamma": [0.9, 0.99]}},
    "transfers": [{"family": "empty", "difficulty": "hard"}],
    "claims": {
        "distance": {"says": "The gap follows W2.", "test": "correlation", "given": ["panel"]},
        "gamma": {"says": "Gamma costs.", "test": "difference", "between": {"algorithm.gamma": [0.99, 0.9]}},
        "hard": {"says": "Hard levels do not.", "test": "difference", "between": {"difficulty": ["hard", "easy"]},
                 "expected": "none", "margin": 0.5},
        "far": {"says": "Elsewhere all is worse.", "test": "mean", "on": "empty-hard", "expected": "negative"},
        "own": {"says": "A test of one's own.", "test": "mean", "where": {"n": 10}},
    },
}  # fmt: skip


def planted(work):
    """Stands for training: the gap is -4 W2, and 2 worse with the larger gamma; chance is that of the level set."""
    run = work.run
    rng = np.random.default_rng([run.levels.seed, run.levels.count])
    w2 = run.levels.count**-0.3 * (1 + 0.1 * rng.normal())
    cost = 2.0 if run.algorithm.gamma == 0.99 else 0.0
    write_run(run, gap=-4 * w2 - cost + 0.1 * rng.normal(), w2=w2 / 2)
    for transfer in work.transfers:
        out = transfer.folder(run)
        out.mkdir(parents=True)
        write_rows(out / EPISODES, [row for row in episodes(run, -9.0) if row["levels"] == "test"], EPISODE_SCHEMA)
        write_json(out / SUMMARY, {"transfer": as_data(transfer), "w2/exact": 3.0, "ks": 0.5})
    return {}


def made(tmp_path, data=STUDY):
    """The results folder of a study whose runs are planted."""
    path = tmp_path / "planted.yaml"
    path.write_text(yaml.safe_dump(data))
    study, overrides = study_of([str(path), f"root={tmp_path}/runs", "processes=1"])
    register_settings("study", SETTINGS)
    with initialized():
        config = build(study, compose_data(overrides, "study"))
    plan = make_plan(config.at_scale(), with_sweep_tag(config), config.folder)
    for work in plan.runs:
        planted(work)
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
    assert float(found["gamma"]["estimate"]) == pytest.approx(-2.0)
    assert (float(found["far"]["estimate"]), found["far"]["n"]) == (pytest.approx(-9.0), "24")
    page = (folder / "report.html").read_text()
    assert "✓ holds" in page and "reproduced</b>" not in page
    assert all(
        (folder / "figures" / f"{name}.png").exists() for name in ("gap_against_distance", "success", "gap", "curves")
    )
    assert (folder / "report.pdf").stat().st_size > 1000


def test_the_same_tables_give_the_same_report(folder, tmp_path):
    report_results(folder)
    first = (folder / "report.html").read_bytes()
    report_results(folder)
    assert (folder / "report.html").read_bytes() == first


def test_kinds_of_agents_and_blocks_are_those_of_the_study(folder):
    study = read_study(folder)
    assert study.agents == ["gamma=0.9", "gamma=0.99"]
    assert study.panels == ["empty-easy", "empty-hard"]
    claim = claim_of(study, "gamma", ClaimConfig(says="", test="difference", between={"algorithm.gamma": [0.99, 0.9]}))
    assert "24 rows in 12 blocks" in claim.note


@pytest.mark.parametrize(
    ("claim", "message"),
    [
        ({"test": "mean", "of": "gapp"}, "claims.mine: of: the runs have no column 'gapp'. Did you mean"),
        ({"test": "mean", "where": {"n": 3}}, "claims.mine: where: no run has {'n': 3}"),
        (
            {"test": "difference", "between": {"algorithm.gamma": [0.5, 0.9]}},
            "between: no run has algorithm.gamma=0.5; there",
        ),
        (
            {"test": "mean", "on": "empty-medium"},
            "on: no agent was tested on 'empty-medium'. Did you mean 'empty-hard'?",
        ),
        ({"test": "nowhere_to_be:found"}, "claims.mine: test: 'nowhere_to_be:found' cannot be imported"),
    ],
)
def test_a_claim_about_what_is_not_there_is_told(folder, claim, message):
    with pytest.raises(ConfigError) as caught:
        claim_of(read_study(folder), "mine", ClaimConfig(says="", **claim))
    assert message in str(caught.value)


def test_a_claim_that_cannot_be_tested_keeps_no_other_from_the_report(folder):
    study = read_study(folder)
    lost = claim_or_reason(study, "mine", {"says": "x", "test": "mean", "where": {"n": 3}})
    assert lost.verdict("tested") == "not testable"
    assert "no run has {'n': 3}" in lost.needs


def half(runs):
    return Estimate(0.5, 0.4, 0.6, len(runs), 0.001)


def test_a_test_of_ones_own_gets_the_runs_and_returns_an_estimate(folder):
    claim = claim_of(read_study(folder), "mine", ClaimConfig(says="", test=f"{__name__}:half", expected="positive"))
    assert claim.verdict("tested") == "reproduced"
    assert claim.findings[0].found.n == 48


def test_the_study_of_somebody_else_imports_nothing_without_trust(tmp_path, monkeypatch):
    claims = {"mine": {"says": "x", "test": f"{__name__}:half"}}
    folder = made(tmp_path, {**STUDY, "claims": claims})
    path = folder / "study.yaml"
    path.write_text(path.read_text().replace("Planted effects", "Other effects"))
    with pytest.raises(RunFolderError, match="was not written by you"):
        report_results(folder)
    monkeypatch.setenv(TRUSTED, __name__)
    read_study(folder)


def test_level_sets_that_agents_share_count_once(tmp_path):
    data = {**STUDY, "grid": {**STUDY["grid"], "seeds": 3, "level_sets": 2, "families": ["empty-easy"]}, "claims": {}}
    folder = made(tmp_path, data)
    report_results(folder)
    page = (folder / "report.html").read_text()
    assert "Up to 3 agents of a kind share a level set" in page
    assert "have 2 level sets of a size" in page
