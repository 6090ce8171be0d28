"""The answer in five lines, which opens the report."""

from collections.abc import Mapping, Sequence

import numpy as np

from analysis.report.claims import verdicts
from analysis.report.claims.claim import LEARNED, METRIC_2022, METRIC_OURS, Claim, Finding, is_correlation
from analysis.report.claims.evidence import Evidence
from analysis.report.claims.rows import papers_agent
from analysis.report.claims.words import agents_that_learned, left_out, second_outcome
from analysis.report.document.blocks import Block, Bullets, Heading
from analysis.report.number_format import estimate_text
from analysis.tables import select

OF_W2 = ("matched-w2", "states-w2")  # the studies that take W2 and the number of levels apart


def in_a_word(claims: Mapping[str, Claim]) -> str:
    """The answer to the title's question, by the rule in ``rules.yaml``: yes, partly, no, or not known yet."""
    headline, itself = (
        claims["3a"].verdict(METRIC_OURS),
        of_itself([claims[name].verdict(METRIC_OURS) for name in OF_W2]),
    )
    both = [headline, itself].count(verdicts.SUPPORTED)
    if both:
        return "yes" if both == 2 else "partly"
    return "no" if {headline, itself} == {verdicts.NOT_SUPPORTED} else "not known yet"


def of_itself(read: Sequence[str]) -> str:
    """What the matched sets say of W2 itself: supported where one study supports it and none says the opposite."""
    if verdicts.NOT_SUPPORTED in read:
        return verdicts.NOT_SUPPORTED
    return verdicts.SUPPORTED if verdicts.SUPPORTED in read else verdicts.UNDECIDED


def why(claims: Mapping[str, Claim]) -> str:
    """The answer in two sentences: the headline, and W2 at equal numbers of levels."""
    said = {}
    for name in ("3a", *OF_W2):
        claim, found = claims[name], leading(claims[name], METRIC_OURS)
        runs = f"; {claim.planned}" if claim.planned.is_short else ""
        said[name] = claim.verdict(METRIC_OURS) + (f" ({number(found)}{runs})" if found else "")
    return (
        f"Over all cells, the gap is worse at larger W2: {said['3a']}. At equal numbers of levels, farther sets are worse: "
        f"{said['matched-w2']} from pixels, {said['states-w2']} from states."
    )


def answer(evidence: Evidence, claims: Mapping[str, Claim]) -> list[Block]:
    """The answer in five lines, with numbers from the tests of claims."""
    if evidence.ungated.main.empty:
        lines = ["These runs have no main grid, so they do not answer this question."]
    else:
        lines = [
            whole_grid(evidence, claims),
            beyond_n(claims),
            of_matched_sets(evidence, claims),
            levels_close(evidence),
            agent(evidence, claims),
        ]
    return [Heading("In five lines"), Bullets([line for line in lines if line])]


def whole_grid(evidence: Evidence, claims: Mapping[str, Claim]) -> str:
    """The verdict on the paper's headline, and which runs it is about."""
    everything, main = evidence.ungated.main, evidence.main
    runs, lost = f"all {len(main)} runs", left_out(everything, main)
    if lost:
        runs = f"the {len(main)} of {len(everything)} runs that learned their training levels (without {lost})"
    found = leading(claims["3a"], METRIC_OURS)
    if found is None:
        return f"The gap and W2 of {runs} say nothing of the paper's headline."
    return (
        f"Over {runs}, gap and W2 are correlated by {number(found)} ({found.beside} in place of W2). The "
        f"paper's headline, that the gap is worse where "
        f"training and test levels are farther apart, is {claims['3a'].verdict(METRIC_OURS)}."
    )


def beyond_n(claims: Mapping[str, Claim]) -> str:
    """What is left of the headline given the number of levels."""
    found = leading(claims["3a-n"], METRIC_OURS)
    if found is None:
        return ""
    return (
        f"W2 falls as the number n of training levels grows. Given panel and n, {number(found)} remains: that W2 matters "
        f"beyond n is {claims['3a-n'].verdict(METRIC_OURS)}."
    )


def levels_close(evidence: Evidence) -> str:
    """The gap in success with the fewest training levels and with the most."""
    main = evidence.main
    counts = sorted({*main["n"]})
    if len(counts) < 2:
        return ""
    few, many = (evidence.mean(select(main, n=n), "gap_success") for n in (counts[0], counts[-1]))
    levels = "one training level" if counts[0] == 1 else f"{counts[0]} training levels"
    return (
        f"With {levels}, success on test levels less that on training levels is {estimate_text(few, '')}; with {counts[-1]}, "
        f"it is {estimate_text(many, '')}."
    )


def agent(evidence: Evidence, claims: Mapping[str, Claim]) -> str:
    """The verdict with the paper's own agent, and which of its runs it is about."""
    claim = claims["3a-agent"]
    found = leading(claim, METRIC_2022)
    if found is None:
        return f"What the paper's own agent says cannot be tested. It would take {claim.needs}."
    learned = agents_that_learned(evidence, papers_agent(evidence))
    return (
        f"With the paper's own agent, given panel and not n, {number(found)}: the headline is {claim.verdict(METRIC_2022)}. "
        f"{learned}"
    ).strip()


def of_matched_sets(evidence: Evidence, claims: Mapping[str, Claim]) -> str:
    """What the matched sets say of distance and coverage: of the gap in success, and of their second outcome."""
    measures = {"matched-w2": "farther in W2", "matched-coverage": "worse in coverage and diversity"}
    found = {name: leading(claims[name], METRIC_OURS) for name in measures}
    parts = [
        f"those {measures[name]} by {estimate_text(one.found, '')} ({claims[name].verdict(METRIC_OURS)})"
        for name, one in found.items()
        if one is not None
    ]
    if not parts:
        return "Whether it is W2 or coverage that matters was not run at this scale (`experiments=[matched_sets]`)."
    named = {"matched-w2": "W2", "matched-coverage": "Coverage"}
    stands = [named[name] for name in measures if claims[name].verdict(METRIC_OURS) == verdicts.SUPPORTED]
    said = {
        0: "Neither W2 nor coverage is shown to predict the gap in success by itself",
        2: "W2 and coverage each predict the gap in success",
    }
    what = said.get(
        len(stands), f"{stands[0] if stands else ''} predicts the gap in success, and the other is not shown to"
    )
    runs = evidence.results.of("matched_sets")
    returns = [one.found for name in measures for one in second_outcome(evidence, runs, name, "gap")]
    texts = " and ".join(estimate_text(one, "") for one in returns)
    second = f" In returns, the second outcome, they differ by {texts}." if returns else ""
    return (
        f"{what}. Of training sets that are matched in the rest, on average over families and n, the gaps in success differ: "
        f"{', and '.join(parts)}.{second}"
    )


def leading(claim: Claim, settings: str) -> Finding | None:
    """The first test of a claim that has a number, with the runs that learned; None where there is none."""
    return next((one for one in claim.tests(settings, LEARNED) if np.isfinite(one.found.estimate)), None)


def number(one: Finding) -> str:
    """An estimate with its interval and what it rests on."""
    return estimate_text(one.found, "r" if is_correlation(one.measure) else "difference")
