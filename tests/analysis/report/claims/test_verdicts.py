"""When a claim counts as reproduced: the rules, for any numbers."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.report.claims import verdicts
from analysis.report.claims.claim import CORRECTED, PAPER, Claim, Finding, claims_table
from analysis.report.claims.verdicts import NOT_REPRODUCED, NOT_TESTABLE, REPRODUCED, UNDECIDED, VERDICTS
from analysis.stats.estimate import Estimate

REAL = st.floats(-1, 1)


def found(estimate, low, high, p):
    return Estimate(estimate, low, high, 45, p)


@st.composite
def estimates(draw):
    low, estimate, high = sorted(draw(st.tuples(REAL, REAL, REAL)))
    return found(estimate, low, high, draw(st.floats(0, 1)))


@given(estimates())
def test_an_effect_and_its_opposite_are_never_both_reproduced(one):
    both = {verdicts.of_effect(one, 1), verdicts.of_effect(one, -1)}
    assert both <= set(VERDICTS)
    assert both != {REPRODUCED}


@given(estimates())
def test_mirrored_numbers_give_mirrored_verdicts(one):
    mirrored = found(-one.estimate, -one.high, -one.low, one.p)
    assert verdicts.of_effect(one, 1) == verdicts.of_effect(mirrored, -1)
    assert verdicts.of_absence(one) == verdicts.of_absence(mirrored)


@given(estimates())
def test_an_effect_that_is_not_significant_is_never_reproduced(one):
    if one.p >= verdicts.ALPHA:
        assert verdicts.of_effect(one, -1) != REPRODUCED


@given(estimates())
def test_that_there_is_nothing_takes_a_narrow_interval(one):
    inside = one.low > -verdicts.SMALL_R and one.high < verdicts.SMALL_R
    assert (verdicts.of_absence(one) == REPRODUCED) == inside


def test_the_headline_of_the_paper_would_be_reproduced():
    assert verdicts.of_effect(found(-0.6, -0.76, -0.37, 1.47e-5), -1) == REPRODUCED
    assert verdicts.of_effect(found(-0.6, -0.76, -0.37, 1.47e-5), 1) == NOT_REPRODUCED


def test_few_runs_leave_both_an_effect_and_its_absence_undecided():
    wide = found(-0.5, -0.96, 0.7, 0.4)
    assert verdicts.of_effect(wide, -1) == verdicts.of_absence(wide) == UNDECIDED


def test_an_interval_without_effects_that_matter_refutes_the_claim():
    assert verdicts.of_effect(found(0.02, -0.15, 0.2, 0.8), -1) == NOT_REPRODUCED


def test_what_has_no_number_is_not_testable():
    missing = Estimate.missing(2, "2 points; at least 3 are needed")
    rules = (lambda e: verdicts.of_effect(e, 1), verdicts.of_absence, verdicts.of_insignificance)
    assert {rule(missing) for rule in rules} == {NOT_TESTABLE}


def test_without_a_p_the_interval_decides():
    assert verdicts.of_effect(found(-0.6, -0.8, -0.4, math.nan), -1) == REPRODUCED
    assert verdicts.of_effect(found(-0.6, -0.9, 0.4, math.nan), -1) == UNDECIDED


@pytest.mark.parametrize(
    ("each", "whole"),
    [
        ([REPRODUCED, REPRODUCED], REPRODUCED),
        ([REPRODUCED, UNDECIDED], UNDECIDED),
        ([REPRODUCED, NOT_TESTABLE], UNDECIDED),
        ([REPRODUCED, UNDECIDED, NOT_REPRODUCED], NOT_REPRODUCED),
        ([NOT_TESTABLE, NOT_TESTABLE], NOT_TESTABLE),
        ([], NOT_TESTABLE),
    ],
)
def test_a_claim_about_several_panels_holds_if_it_holds_in_each(each, whole):
    assert verdicts.combined(each) == whole


def test_the_two_readings_of_a_claim_are_kept_apart():
    one = found(-0.6, -0.8, -0.4, 0.001)
    findings = [Finding(PAPER, "a", "Pearson r", one, REPRODUCED), Finding(CORRECTED, "b", "Pearson r", one, UNDECIDED)]
    claim = Claim("x", "something", "somewhere", findings)
    assert (claim.verdict(PAPER), claim.verdict(CORRECTED)) == (REPRODUCED, UNDECIDED)
    assert Claim("x", "something", "somewhere", findings[1:]).verdict(PAPER) == ""
    assert Claim("x", "something", "somewhere").verdict(PAPER) == NOT_TESTABLE
    table = claims_table([claim, Claim("y", "else", "there", needs="more runs")])
    assert list(table["verdict"]) == [REPRODUCED, UNDECIDED, NOT_TESTABLE]
    assert table["needs"].iloc[-1] == "more runs"
