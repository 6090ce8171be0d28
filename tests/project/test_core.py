"""What the page of the core says follows from its tables by the rules."""

import importlib.util
import re

import numpy as np
import pandas as pd
import pytest

from tests.places import ROOT

SPEC = importlib.util.spec_from_file_location("core_of_suites", ROOT / "docs" / "site" / "core.py")
core = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(core)


@pytest.mark.results
def test_the_page_and_its_table_are_made_again():
    table, suites, chosen = core.found_now()
    stated = pd.read_csv(core.FOLDER / "suites.csv")
    pd.testing.assert_frame_equal(suites, stated, rtol=1e-5)
    assert (core.FOLDER / "findings.md").read_text(encoding="utf-8") == core.page(table, suites, chosen)
    assert core.FEWEST <= len(chosen) <= core.MOST


def test_a_planted_core_has_of_each_axis_what_tells_methods_apart_and_nothing_too_easy():
    """On every second suite methods differ, and agree on who is best; on the others only runs do, and one is solved by all."""
    rng = np.random.default_rng(0)
    names = [*core.scores()["suite"].unique()]
    table = pd.DataFrame([
        {"row": row, "suite": name, "seed": seed, core.PRACTICE: 0.4 + 0.1 * m * (k % 2) + rng.normal(0, 0.05)}
        for m, row in enumerate("abcd") for k, name in enumerate(names) for seed in range(1, 6)
    ])  # fmt: skip
    table.loc[table["suite"] == names[0], core.PRACTICE] = 0.99 + 1e-3 * rng.normal(size=20)
    suites = core.described(table)
    assert [*suites.query("not counts")["suite"]] == names[:1]
    told = suites.set_index("suite")["methods_share"]
    assert told[names[1::2]].min() > 0.7 and told[names[2::2]].max() < 0.5
    chosen = core.chosen(table, suites)
    best = suites[suites["counts"]].sort_values("methods_share").drop_duplicates("axis", keep="last")["suite"]
    assert {*best} <= {*chosen[: len(best)]} and names[0] not in chosen and core.FEWEST <= len(chosen) <= core.MOST
    assert core.agreement(table, chosen).coefficient.estimate > core.agreement(table, names[2::2]).coefficient.estimate


def test_a_core_is_confirmed_by_the_second_half_alone_and_not_before_all_of_its_runs_are_there():
    """A core that ranks nothing in the first half does in the second: which verdict the page gives of which, and when."""
    rng = np.random.default_rng(0)
    names = [*core.scores()["suite"].unique()]
    table = pd.DataFrame([
        {"row": row, "suite": name, "seed": seed, core.PRACTICE: 0.3 + 0.1 * m * (seed > 5) + rng.normal(0, 0.05)}
        for m, row in enumerate("abcd") for name in names for seed in range(1, 11)
    ])  # fmt: skip
    table = table.assign(score=table[core.PRACTICE], steps=table[core.PRACTICE].where(table["seed"] > 5))
    table.loc[table["suite"] == names[0], "steps"] = np.nan
    first, second, there = core.halves(table)
    assert len(first) == len(second) == there == 4 * 5 * len(names)
    suites = core.described(first).assign(place=np.nan)
    chosen = names[: core.FEWEST]
    whole, partly = core.page(table, suites, chosen), core.page(table[:-1], suites, chosen)
    assert "**On seeds 6 to 10, which chose nothing, the core ranks these learners:**" in whole and "ten seeds" in whole
    assert "On seeds 1 to 5, by which it was chosen, it does not rank them." in whole and "Nothing is" not in whole
    other = re.findall(r"^\| (score|time, seeds 6 to 10) \| (\d+) \| \d\.\d\d \[", whole, re.M)
    assert other == [("score", str(core.FEWEST)), ("time, seeds 6 to 10", str(core.FEWEST - 1))]
    assert "By other outcomes" not in partly
    assert "**On seeds 1 to 5 the chosen core does not rank these learners.** Nothing is confirmed" in partly
    assert f"of the {there} runs of seeds 6 to 10,\n{there - 1} are there" in partly and "five seeds" in partly


@pytest.mark.parametrize("differ, verdict", [(0.1, "ranks"), (0.0, "does not rank")])
def test_success_weighted_by_time_is_judged_when_all_runs_of_all_learners_are_there(differ, verdict):
    rng = np.random.default_rng(0)
    table = pd.DataFrame([
        {"row": row, "suite": name, "seed": seed, core.WEIGHTED: differ * m + 0.01 * rng.normal()}
        for m, row in enumerate([*core.LEARNERS, "other"]) for name in "abc" for seed in range(11, 16)
    ])  # fmt: skip
    page = core.weighted_by_time(table)
    assert (
        f"weighted by time {verdict} these learners:** of {len(core.LEARNERS)} learners, 3 suites\nand seeds 11" in page
    )
    best = [*core.LEARNERS.values()][-1]
    assert (f"| {best} | 1 |" in page) == (differ > 0)
    assert core.weighted_by_time(table.drop(index=3)) == "No verdict yet: 104 of 105 runs are there.\n"
