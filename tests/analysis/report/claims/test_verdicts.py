"""When a claim is supported: the rules, for any numbers, and how often they err where the truth is known."""

import math

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from segar.analysis.report.claims import verdicts
from segar.analysis.report.claims.claim import ALL_RUNS, METRIC_2022, METRIC_OURS, Claim, Finding, claims_table
from segar.analysis.report.claims.verdicts import NOT_SUPPORTED, NOT_TESTABLE, SUPPORTED, UNDECIDED, VERDICTS
from segar.analysis.stats.estimate import Estimate
from tests.places import ROOT

REAL = st.floats(-1, 1)
MARGIN = 0.3


def found(estimate, low, high, p):
    return Estimate(estimate, low, high, 45, p)


@st.composite
def estimates(draw):
    low, estimate, high = sorted(draw(st.tuples(REAL, REAL, REAL)))
    return found(estimate, low, high, draw(st.floats(0, 1)))


@given(estimates())
def test_an_effect_and_its_opposite_are_never_both_supported(one):
    both = {verdicts.of_effect(one, 1, MARGIN), verdicts.of_effect(one, -1, MARGIN)}
    assert both <= set(VERDICTS)
    assert both != {SUPPORTED}


@given(estimates())
def test_mirrored_numbers_give_mirrored_verdicts(one):
    mirrored = found(-one.estimate, -one.high, -one.low, one.p)
    assert verdicts.of_effect(one, 1, MARGIN) == verdicts.of_effect(mirrored, -1, MARGIN)
    assert verdicts.of_absence(one, MARGIN) == verdicts.of_absence(mirrored, MARGIN)


@given(estimates())
def test_an_effect_below_the_margin_is_never_supported(one):
    if abs(one.estimate) < MARGIN:
        assert SUPPORTED not in (verdicts.of_effect(one, -1, MARGIN), verdicts.of_effect(one, 1, MARGIN))


@given(estimates())
def test_that_there_is_nothing_takes_a_narrow_interval(one):
    inside = one.low > -MARGIN and one.high < MARGIN
    assert (verdicts.of_absence(one, MARGIN) == SUPPORTED) == inside


def test_few_runs_leave_both_an_effect_and_its_absence_undecided_and_many_refute_the_claim():
    assert verdicts.of_effect(found(0.02, -0.15, 0.2, 0.8), -1, MARGIN) == NOT_SUPPORTED
    wide = found(-0.5, -0.96, 0.7, 0.4)
    assert verdicts.of_effect(wide, -1, MARGIN) == verdicts.of_absence(wide, MARGIN) == UNDECIDED


def test_what_has_no_number_or_no_interval_is_not_testable():
    missing = Estimate.missing(2, "2 points; at least 3 are needed")
    rules = (lambda e: verdicts.of_effect(e, 1, MARGIN), lambda e: verdicts.of_absence(e, MARGIN))
    assert {rule(missing) for rule in rules} == {NOT_TESTABLE}


def test_without_a_p_the_interval_decides():
    assert verdicts.of_effect(found(-0.6, -0.8, -0.4, math.nan), -1, MARGIN) == SUPPORTED
    assert verdicts.of_effect(found(-0.6, -0.9, 0.4, math.nan), -1, MARGIN) == UNDECIDED


@pytest.mark.parametrize(
    ("each", "whole"),
    [
        ([SUPPORTED, SUPPORTED], SUPPORTED),
        ([SUPPORTED, UNDECIDED], UNDECIDED),
        ([SUPPORTED, NOT_TESTABLE], UNDECIDED),
        ([SUPPORTED, UNDECIDED, NOT_SUPPORTED], NOT_SUPPORTED),
        ([NOT_TESTABLE, NOT_TESTABLE], NOT_TESTABLE),
        ([], NOT_TESTABLE),
    ],
)
def test_a_claim_about_several_panels_holds_if_it_holds_in_each(each, whole):
    assert verdicts.combined(each) == whole


def test_the_two_metrics_of_a_claim_are_kept_apart_and_runs_that_learned_lead():
    clear, open_ = found(-0.6, -0.8, -0.4, 0.001), found(-0.5, -0.96, 0.7, 0.4)
    findings = [
        Finding(METRIC_2022, "a", "Pearson r", clear, MARGIN, -1),
        Finding(METRIC_OURS, "b", "Pearson r", open_, MARGIN, -1),
        Finding(METRIC_OURS, "b", "Pearson r", clear, MARGIN, -1, runs=ALL_RUNS),
    ]
    claim = Claim("x", "something", "somewhere", findings)
    assert (claim.verdict(METRIC_2022), claim.verdict(METRIC_OURS)) == (SUPPORTED, UNDECIDED)
    assert claim.verdict(METRIC_OURS, ALL_RUNS) == SUPPORTED
    assert Claim("x", "something", "somewhere", findings[1:]).verdict(METRIC_2022) == ""
    of_2022 = Claim("x", "something", "somewhere", findings[:1])
    assert [one.last_verdict((METRIC_2022, METRIC_OURS)) for one in (claim, of_2022)] == [UNDECIDED, SUPPORTED]
    assert Claim("x", "something", "somewhere").verdict(METRIC_2022) == NOT_TESTABLE
    table = claims_table([claim, Claim("y", "else", "there", needs="more runs")])
    assert list(table["verdict"]) == [SUPPORTED, UNDECIDED, SUPPORTED, NOT_TESTABLE]
    assert table["needs"].iloc[-1] == "more runs"
    assert table["of_claim_ours_all_runs"].iloc[0] == SUPPORTED


def test_specifications_that_disagree_take_a_tick_away_and_give_none():
    clear, weak = found(-0.6, -0.8, -0.4, 0.001), found(-0.1, -0.2, 0.1, 0.4)
    one = Finding(METRIC_OURS, "a", "Pearson r", clear, MARGIN, -1, survives=False)
    assert one.verdict == UNDECIDED
    assert Finding(METRIC_OURS, "a", "Pearson r", weak, MARGIN, -1, survives=False).verdict == NOT_SUPPORTED


@pytest.mark.parametrize("correlation", [True, False])
def test_power_at_the_margin_follows_from_the_error(correlation):
    """An interval that just reaches from 0 to twice the margin finds an effect at the margin in half of all cases."""
    transformed = math.tanh if correlation else float
    margin = transformed(0.2)
    half = found(transformed(0.2), 0.0, transformed(0.4), 0.05)
    assert verdicts.power_at_margin(half, margin, correlation) == pytest.approx(0.5, abs=0.001)
    narrow = found(transformed(0.2), transformed(0.15), transformed(0.25), 0.0)
    assert verdicts.power_at_margin(narrow, margin, correlation) > 0.999
    nothing = found(0.0, math.nan, math.nan, math.nan)
    assert math.isnan(verdicts.power_at_margin(nothing, margin, correlation))


@pytest.mark.results
def test_the_shipped_simulations_err_in_at_most_one_of_twenty_but_for_ten_runs():
    table = pd.read_csv(ROOT / "docs" / "results" / "standard" / "error_rates.csv")
    assert (table["simulations"] >= 1000).all()
    effect, absence = (table["claimed"] == one for one in ("an effect", "absence"))
    wrong = (effect & (table["planted"] == "nothing")) | (absence & (table["planted"] == "the margin"))
    allowed = (table["runs"] > 10).map({True: 0.05, False: 0.08})  # 3a-agent has ten
    assert wrong.sum() == 90 and (table[SUPPORTED] <= allowed)[wrong].all()
