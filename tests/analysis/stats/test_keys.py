"""What belongs together is told by the values of columns: not by their text joined, and nothing is dropped without a value."""

import ast

import numpy as np
import pandas as pd
import pytest

from segar.analysis.report.document.blocks import Table
from segar.analysis.report.document.sections import versions
from segar.analysis.report.document.tables import cells, means
from segar.analysis.report.results import read_results
from segar.analysis.runs import summarise
from segar.analysis.stats.association import associations, keys
from segar.analysis.stats.mixed import mixed_model
from segar.analysis.stats.prediction import left_out
from segar.analysis.stats.ranking import generalizability
from segar.analysis.stats.resampling import cluster_jackknife, permutation_of_blocks
from segar.analysis.stats.scores import aggregates, probability_of_improvement
from segar.analysis.tables import mean_by
from segar.errors import SegarError
from segar.experiments.settings import RunFolderError
from tests.places import ROOT
from tests.synthetic_results import evidence_of, run_rows, write_results

TWINS = (("mine", "fast-v2"), ("mine-fast", "v2"))  # joined by "-" they are one


def twins(seeds: int = 6) -> pd.DataFrame:
    """Two panels, in each of which y rises with x, while over both it falls."""
    rng = np.random.default_rng(0)
    rows = []
    for place, (family, difficulty) in enumerate(TWINS):
        for seed in range(seeds):
            x = 10 * place + seed + 0.1 * rng.normal()
            rows.append((family, difficulty, seed, 10, x, x - 20 * place, "ppo"))
    return pd.DataFrame(rows, columns=["family", "difficulty", "seed", "n", "x", "y", "algorithm"])


def test_panels_whose_joined_names_are_one_stay_apart():
    table = twins()
    found = associations(table, "x", "y").query("outliers == 'kept' and method == 'pearson'")
    found = found.set_index("test")
    assert found.loc["pooled", "estimate"] < 0 < 0.99 < found.loc["given panel", "estimate"]
    assert len(found.loc[["within"]]) == 2
    whole = cluster_jackknife(table, mean_of_y, ["family", "difficulty", "seed"])
    assert whole.n == 12
    scores = aggregates(table, "y", np.random.default_rng(0))
    assert set(scores["n"]) == {12}
    assert left_out(table, "y", {"x": ["x"]})["r2_left_out"].notna().all()
    model = mixed_model(table.assign(x=table["x"] + 0.5 * (table["seed"] % 2)), "y", ["x"])
    assert dict(zip(model.random["effect"], model.random["groups"], strict=True))["family x difficulty"] == 2
    given = np.column_stack([np.ones(12), keys(table, ["family", "difficulty"])])
    permuted = permutation_of_blocks(table, "x", "y", given, np.random.default_rng(0))
    assert permuted.estimate == pytest.approx(1.0, abs=0.01)
    runs = table.assign(state="finished", gap_deterministic=table["y"], w2_exact=1.0)
    summary = summarise(runs, ["gap_deterministic"], by=["family", "difficulty"])
    assert len(summary) == 2 and set(summary["runs"]) == {6}


def test_numbers_and_texts_that_look_alike_are_two_values():
    table = pd.DataFrame({"a": [1, "1", 1.5, True and "True"], "b": ["x"] * 4})
    assert len(set(keys(table, ["a", "b"]))) == 4
    assert keys(table, []).tolist() == [0] * 4


def mean_of_y(part):
    return float(part["y"].mean())


CALLS = {
    "algorithm": [
        lambda table, rng: aggregates(table, "y", rng),
        lambda table, rng: probability_of_improvement(table, "y", "ppo", "sac", rng),
    ],
    "family": [
        lambda table, rng: aggregates(table, "y", rng),
        lambda table, rng: associations(table, "x", "y"),
        lambda table, rng: left_out(table, "y", {"x": ["x"]}),
    ],
    "seed": [
        lambda table, rng: aggregates(table, "y", rng),
        lambda table, rng: cluster_jackknife(table, mean_of_y, ["family", "seed"]),
        lambda table, rng: permutation_of_blocks(table, "x", "y", np.ones((12, 1)), rng),
        lambda table, rng: mixed_model(table, "y", ["x"]),
    ],
}


@pytest.mark.parametrize("nothing", [None, np.nan])
@pytest.mark.parametrize(("name", "call"), [(name, call) for name, calls in CALLS.items() for call in calls])
def test_a_row_without_a_key_is_refused_by_the_name_of_the_column(name, call, nothing):
    table = twins().astype({name: object})
    table.loc[3, name] = nothing
    with pytest.raises(SegarError, match=f"1 of 12 rows have no {name}, which says what belongs together"):
        call(table, np.random.default_rng(0))


@pytest.mark.parametrize("call", [call for calls in CALLS.values() for call in calls])
def test_a_column_that_stands_twice_or_holds_words_is_refused(call):
    table = twins().astype({"seed": "Int64", "y": "Float64"})
    with pytest.raises(SegarError, match=r"the table has 2 columns '(seed|y)'"):
        call(pd.concat([table, table[["seed", "y"]]], axis=1), np.random.default_rng(0))
    if "mean_of_y" not in call.__code__.co_names:  # a statistic of the test's own reads it
        with pytest.raises(SegarError, match="the column 'y' has values that are no numbers"):
            call(table.astype({"y": object}).assign(y="high"), np.random.default_rng(0))


@pytest.mark.parametrize("name", ["algorithm", "family", "seed"])
def test_variance_components_need_a_method_a_suite_and_a_seed_in_each_line(name):
    table = twins().astype({name: object, "y": "Float64"})
    two = pd.concat([table, table.assign(algorithm="sac", y=table["y"] ** 2)], ignore_index=True)
    assert generalizability(two, "y", "algorithm", "family", "seed") is not None
    with pytest.raises(SegarError, match=f"rows have no {name}, which says"):
        lacking = two[name] == two[name][0]
        generalizability(two.assign(**{name: two[name].mask(lacking, None)}), "y", "algorithm", "family", "seed")


def test_means_of_groups_without_a_name_are_kept():
    table = pd.DataFrame({"group": ["a", None, "a"], "x": [1.0, 2.0, 3.0]})
    assert mean_by(table, ["group"], ["x"])["x"].tolist() == [2.0, 2.0]


def test_tables_of_a_report_keep_all_rows_whatever_has_no_name(tmp_path):
    """And a run that does not say what it belongs to is refused, in the file where it stands."""
    runs = run_rows(np.random.default_rng(0), "figure_3a", seeds=2).assign(code=["a", None] * 45)
    evidence = evidence_of(tmp_path / "whole", {"runs": runs})
    named = evidence.all_results.runs.assign(experiment="figure_3a", libraries="", commit="", computed_with="")
    (table,) = (block for block in versions(named) if isinstance(block, Table))
    assert sum(int(row[-1]) for row in table.rows) == len(runs)
    by = ["family", "difficulty", "n"]
    nameless = evidence.results.main.assign(family=evidence.results.main["family"].replace("empty", None))
    with pytest.raises(SegarError, match="rows have no family"):  # intervals are over blocks of one family and seed
        means(evidence, nameless, by, "gap")
    assert cells(nameless)["seeds"].sum() == len(runs)
    for name in ("seed", "family", "n", "algorithm"):
        lacking = runs.astype({name: object})
        lacking.loc[4, name] = None
        folder = write_results(tmp_path / name, {"runs": lacking})
        with pytest.raises(RunFolderError, match=f"runs.parquet: 1 of {len(runs)} rows have no {name}"):
            read_results(folder)


def test_no_group_of_rows_is_dropped_for_a_missing_key():
    """Pandas drops them unless it is told not to; keys as numbers, which are never missing, are arrays with a name."""
    places = [path for room in ("analysis", "experiments") for path in (ROOT / room).rglob("*.py")]
    for path, call in ((one, call) for one in places for call in ast.walk(ast.parse(one.read_text("utf-8")))):
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute) and call.func.attr == "groupby":
            told = {one.arg: ast.unparse(one.value) for one in call.keywords}
            assert told.get("dropna") == "False" or isinstance(call.args[0], ast.Name), f"{path}:{call.lineno}"


def test_two_rows_of_one_block_at_one_place_are_refused():
    table = pd.concat([twins(), twins().iloc[:1]], ignore_index=True)
    with pytest.raises(SegarError, match="two rows of one panel have the same seed and n"):
        permutation_of_blocks(table, "x", "y", np.ones((13, 1)), np.random.default_rng(0))
