"""Places and variance components on planted tables, where it is known who is best."""

import numpy as np
import pandas as pd
import pytest

from segar.analysis.stats.ranking import coverage, generalizability, places

PLANTED = {"method": 0.01, "suite": 0.04, "method and suite": 0.01, "training levels": 0.0025, "run": 0.0064}


def planted(rng, methods=8, suites=12, seeds=5, **variances):
    """A table with these variance components."""
    sd = {name: value**0.5 for name, value in {**PLANTED, **variances}.items()}
    shapes = {
        "method": (methods, 1, 1), "suite": (1, suites, 1), "method and suite": (methods, suites, 1),
        "training levels": (1, suites, seeds), "run": (methods, suites, seeds),
    }  # fmt: skip
    y = sum(rng.normal(0, sd[name], shape) for name, shape in shapes.items())
    m, s, k = np.indices(y.shape)
    return pd.DataFrame({"m": m.ravel(), "s": s.ravel(), "k": k.ravel(), "y": y.ravel()})


def test_planted_variance_components_are_found_and_the_interval_holds_the_coefficient():
    rng, found = np.random.default_rng(0), []
    for _ in range(12):
        one = generalizability(planted(rng, seeds=3), "y", "m", "s", "k")
        assert one is not None
        found.append(one)
    for name, value in PLANTED.items():
        assert np.mean([one.components[name] for one in found]) == pytest.approx(value, rel=0.4)
    true = 0.01 / (0.01 + (0.01 + 0.0064 / 3) / 12)
    assert np.mean([one.coefficient.low <= true <= one.coefficient.high for one in found]) > 0.8


def test_tables_with_holes_or_without_differences_have_no_components_and_equal_runs_no_interval():
    table = planted(np.random.default_rng(0))
    for one in (pd.concat([table[1:], table[-1:]]), table.assign(y=[np.nan, *table["y"][1:]]), table.assign(y=0.3)):
        assert generalizability(one, "y", "m", "s", "k") is None
    found = generalizability(table.assign(y=table["m"]), "y", "m", "s", "k")
    assert found is not None and found.coefficient.estimate == 1.0 and np.isnan(found.coefficient.low)


def test_methods_that_are_alike_have_no_winner_and_methods_far_apart_need_few_suites():
    rng = np.random.default_rng(1)
    alike = generalizability(planted(rng, method=0.0), "y", "m", "s", "k")
    apart = generalizability(planted(rng, method=1.0), "y", "m", "s", "k")
    assert alike is not None and apart is not None
    assert alike.coefficient.low < 0.5 < 0.8 < apart.coefficient.low
    needed = apart.suites_needed(5)
    assert needed is not None and needed < 12 < (alike.suites_needed(5) or 1000)
    assert apart.names_winner(needed, 5) >= 0.9 > apart.names_winner(max(needed - 1, 1), 1) - 0.1
    assert generalizability(planted(rng).iloc[1:], "y", "m", "s", "k") is None, "one number is missing"


def test_the_winner_of_two_methods_is_named_as_often_as_two_correlated_normal_numbers_have_one_sign():
    found = generalizability(planted(np.random.default_rng(2))[lambda one: one["m"] < 2], "y", "m", "s", "k")
    assert found is not None and found.methods == 2
    own = found.components
    for suites in (2, 8, 40):
        noise = (own["method and suite"] + own["run"] / 5) / suites
        often = 1 - np.arccos((own["method"] / (own["method"] + noise)) ** 0.5) / np.pi
        assert found.names_winner(suites, 5) == pytest.approx(often, abs=0.004)
        needed = found.suites_needed(5, often - 0.002)
        assert needed is not None and 0.8 * suites <= needed <= 1.1 * suites


def test_methods_that_do_not_differ_have_the_coefficient_zero_and_a_number_that_is_missing_is_no_number():
    for value in (0.1, 0.5):
        table = planted(np.random.default_rng(0), 3, 2, 2).assign(y=value)
        found = generalizability(table.assign(y=table["y"] + 0.1 * table["s"]), "y", "m", "s", "k")
        assert found is not None and found.components["method"] == found.coefficient.estimate == 0
        assert np.isnan(found.coefficient.high) and found.suites_needed(5) is None
    table.loc[0, "y"] = np.nan
    assert generalizability(table, "y", "m", "s", "k") is None


def test_rows_that_no_test_separates_share_their_places():
    rng = np.random.default_rng(0)
    values = pd.DataFrame(rng.normal(0, 0.02, (10, 4)) + np.array([0.5, 0.5, 0.6, 0.1]), columns=list("abcd"))
    assert places(values) == {"a": (2, 3), "b": (2, 3), "c": (1, 1), "d": (4, 4)}
    values.loc[4:, "d"] = np.nan
    assert places(values) == {"a": (2, 3), "b": (2, 3), "c": (1, 1)}, "four seeds are too few for a place"


def test_equal_rows_are_told_apart_in_no_more_than_one_table_of_twenty():
    rng = np.random.default_rng(3)
    wrong = [len({*places(pd.DataFrame(rng.normal(size=(5, 6)))).values()}) > 1 for _ in range(100)]
    assert np.mean(wrong) < 0.11


def test_intervals_over_seeds_hold_the_truth_as_often_as_they_say():
    for seeds in (5, 10):
        for means in ([0.5], list(np.linspace(0.1, 0.9, 12))):
            assert coverage(means, 0.08, seeds, 1000) == pytest.approx(0.95, abs=0.02)
    assert coverage([0.03], 0.1, 5, 1000) < 0.9, "near 0, agents that vary much are no normal sample"
