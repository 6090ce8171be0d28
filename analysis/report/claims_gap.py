"""The paper's claims about the gap and W2: figures 3a, 3b and 4a, and what the corrected tests say of them."""

from __future__ import annotations

import dataclasses

import pandas as pd

from analysis.report import verdicts
from analysis.report.claims import CORRECTED, PAPER, Claim, Finding, not_testable
from analysis.report.evidence import GIVEN_CELL, Evidence, pearson
from analysis.report.results import paired
from analysis.report.verdicts import NOT_REPRODUCED, REPRODUCED, UNDECIDED
from analysis.stats.association import holm
from analysis.stats.estimate import Estimate
from analysis.tables import column, count_of, keep, select

R = "Pearson r"
PARTIAL = "partial Pearson r"
MAIN = "the main grid (`experiments=[figure_3a]`, from `SCALE=quick` on)"
OUT = "tests on harder levels (`experiments=[figure_4a]`, from `SCALE=quick` on)"
SEEDS = "two seeds of the main grid (`experiments=[figure_3a]`, from `SCALE=standard` on)"
FIXED = "training sets of one size and different designs (`experiments=[fixed_n]`, from `SCALE=standard` on)"
WORSE = -1  # the sign of the claimed effect: the gap falls where W2 rises


def pooled(evidence: Evidence) -> Claim:
    """Figure 3a."""
    name, where = "3a", "figure 3a and its paragraph"
    statement = "Over all cells, the gap is worse where training and test levels are farther apart in W2 (p = 1.47e-5)."
    if evidence.main.empty:
        return not_testable(name, statement, where, MAIN)
    paper = evidence.association("reference", "gap_2022", "pooled")
    corrected = evidence.correlation("exact gap pooled", evidence.main, "w2_exact", "gap")
    findings = (
        effect(PAPER, "W2 and returns of 2022, all runs pooled", R, paper),
        effect(CORRECTED, "exact W2, full returns, all runs pooled, by blocks", R, corrected),
    )
    follows = {
        REPRODUCED: "The headline holds as a correlation over all cells. It says nothing yet about W2 itself: see "
        "3a-panel, 3a-n, 3a-cell and fixed-n.",
        NOT_REPRODUCED: "The headline is not found in these runs.",
        UNDECIDED: "These runs neither show the headline nor rule it out.",
    }
    return finished(name, statement, where, findings, follows, MAIN)


def within_panels(evidence: Evidence) -> Claim:
    """Figure 3a, once differences between panels are taken out."""
    name, where = "3a-panel", "figure 3a, implied"
    statement = "The correlation is there among runs of the same family and difficulty, too."
    if evidence.main.empty:
        return not_testable(name, statement, where, MAIN)
    findings = controlled(evidence, "given panel")
    follows = {
        REPRODUCED: "Within a panel, W2 and the gap fall together as n grows. W2 and n cannot be told apart here.",
        NOT_REPRODUCED: "The pooled correlation comes from differences between panels.",
        UNDECIDED: "Whether the correlation is more than differences between panels stays open.",
    }
    return finished(name, statement, where, findings, follows, MAIN)


def beyond_n(evidence: Evidence) -> Claim:
    """Figure 3a, once panel and number of levels are taken out."""
    name, where = "3a-n", "figure 3a, implied"
    statement = "W2 matters beyond the number of training levels and the panel."
    if evidence.main.empty:
        return not_testable(name, statement, where, MAIN)
    findings = controlled(evidence, "given panel and log n")
    follows = {
        REPRODUCED: "Something of W2 is left when panel and log n are accounted for linearly. The gap need not be "
        "linear in log n: 3a-cell and fixed-n are the cleaner tests.",
        NOT_REPRODUCED: "Given panel and log n, W2 says next to nothing about the gap: the headline is about how "
        "many levels were sampled, and where.",
        UNDECIDED: "Given panel and log n, nothing is found with the corrected distance, and these runs cannot rule "
        "an effect out: W2 varies too little beyond panel and n. Only the fixed-n design can tell.",
    }
    return finished(name, statement, where, findings, follows, MAIN)


def within_cells(evidence: Evidence) -> Claim:
    """Figure 3a, among training sets of one panel and one size, whatever law the gap follows in n."""
    name, where = "3a-cell", "figure 3a, implied"
    statement = (
        "Of equally many levels of one panel, those that by chance lie farther from the test levels have a worse gap."
    )
    if evidence.main.empty or count_of(evidence.main, "seed") < 2:
        return not_testable(name, statement, where, SEEDS)
    findings = controlled(evidence, GIVEN_CELL)
    follows = {
        REPRODUCED: "W2 says something about the gap that neither panel nor number of levels says.",
        NOT_REPRODUCED: "At one panel and one number of levels, chance differences in W2 do not matter: the headline is about "
        "how many levels were sampled, and where.",
        UNDECIDED: "Sets of one cell differ too little in W2 for these runs; the fixed-n design makes them differ.",
    }
    return finished(name, statement, where, findings, follows, SEEDS)


def controlled(evidence: Evidence, test: str) -> list[Finding]:
    """The partial correlation, with W2 and returns of 2022; and exact, with full returns and the p of a permutation."""
    among = "cells" if test == GIVEN_CELL else "panels"
    paper = evidence.association("reference", "gap_2022", test)
    exact = evidence.association("exact", "gap", test)
    shuffled = evidence.permutation(f"exact gap {test}", evidence.main, "w2_exact", "gap", test)
    corrected = dataclasses.replace(exact, p=shuffled.p, note=f"p of a permutation within {among}")
    return [
        effect(PAPER, f"W2 and returns of 2022, {test}", PARTIAL, paper),
        effect(CORRECTED, f"exact W2, full returns, {test}; permutation within {among}", PARTIAL, corrected),
    ]


def fixed_number(evidence: Evidence) -> Claim:
    """What the paper's causal reading predicts where only W2 varies."""
    name, where = "fixed-n", "figure 3a, implied; not run in the paper"
    statement = "With equally many training levels, sets that are farther from the test levels have a worse gap."
    table = evidence.results.of("fixed_n")
    table = keep(table, table["design"] != "nuisance_only")
    if count_of(table, "design") < 2:
        return not_testable(name, statement, where, FIXED)
    findings = []
    for settings, distance, gap in ((PAPER, "w2_reference", "gap_2022"), (CORRECTED, "w2_exact", "gap")):
        found = evidence.correlation(f"fixed n {distance}", table, distance, gap, ("panel", "n"))
        findings.append(effect(settings, f"{WORDS[settings]}, at one n, given panel, by blocks", PARTIAL, found))
    follows = {
        REPRODUCED: "At one number of levels the gap follows W2: the paper's reading is supported.",
        NOT_REPRODUCED: "At one number of levels the gap does not follow W2: what the headline shows is sample size.",
        UNDECIDED: "At one number of levels the effect is neither found nor ruled out.",
    }
    return finished(name, statement, where, findings, follows, FIXED)


def panels_but_easy(evidence: Evidence) -> Claim:
    """Figure 3b: all but the easiest tasks."""
    statement = "In every family, the gap worsens with W2 in all but the easiest tasks."
    return by_panel(evidence, "3b-trend", "figure 3b, first sentence", statement, ("medium", "hard"))


def easy_panels(evidence: Evidence) -> Claim:
    """Figure 3b: the easiest tasks."""
    name, where = "3b-easy", "figure 3b, first sentence"
    statement = "In the easiest tasks there is no clear trend."
    if evidence.main.empty:
        return not_testable(name, statement, where, MAIN)
    findings = []
    for settings, mode, gap in SETTINGS:
        for panel in panels_of(evidence, ("easy",)):
            found = evidence.association(mode, gap, "within", panel, corrected=settings == CORRECTED)
            findings.append(Finding(settings, f"{panel}, {WORDS[settings]}", R, found, verdicts.of_absence(found)))
    order = "The W2 of 2022 counts the order of drawing, which is most of what varies between easy levels of Empty and Tiles."
    follows = {
        REPRODUCED: f"No trend, and the intervals are narrow enough to say so. {order}",
        NOT_REPRODUCED: f"At least one easy panel does have a trend. {order}",
        UNDECIDED: f"A trend is neither found nor ruled out. {order}",
    }
    return finished(name, statement, where, findings, follows, MAIN)


def empty_is_clear(evidence: Evidence) -> Claim:
    """Figure 3b: what the next sentence says, which contradicts the first."""
    name, where = "3b-empty", "figure 3b, second sentence"
    statement = "The trend is clear in the family Empty (all difficulties, each with a mean of its own)."
    return by_family(evidence, name, where, statement, ("empty",))


def others_are_weak(evidence: Evidence) -> Claim:
    """Figure 3b: Objects and Tiles."""
    name, where = "3b-weak", "figure 3b, second sentence"
    statement = "In Objects and in Tiles the trend is weakly significant at best (no panel has p < 0.01)."
    if evidence.main.empty:
        return not_testable(name, statement, where, MAIN)
    findings = []
    for settings, mode, gap in SETTINGS:
        for panel in panels_of(evidence, families=("objectsx1", "tilesx1")):
            found = evidence.association(mode, gap, "within", panel, corrected=settings == CORRECTED)
            verdict = verdicts.of_insignificance(found, verdicts.WEAK)
            findings.append(Finding(settings, f"{panel}, {WORDS[settings]}", R, found, verdict))
    follows = {
        REPRODUCED: "No trend of a single panel is more than weakly significant, which with so few points per line "
        "says little about its size. The sentence contradicts the one before it (3b-trend).",
        NOT_REPRODUCED: "At least one panel of Objects or Tiles has a trend with p < 0.01. This sentence and the one "
        "before it (3b-trend) contradict each other in the paper.",
    }
    return finished(name, statement, where, findings, follows, MAIN)


def transfer_is_worse(evidence: Evidence) -> Claim:
    """Figure 4a: the size of the gap."""
    name, where = "4a-larger", "figure 4a and its paragraph"
    statement = "On harder levels the gap is considerably larger than on levels of the training distribution."
    harder = evidence.results.harder
    if harder.empty:
        return not_testable(name, statement, where, OUT)
    findings = []
    for settings, _, gap in SETTINGS:
        words = f"gap on harder levels less the own gap, {WORDS[settings]}"
        findings.append(difference(evidence, settings, words, paired(harder, evidence.main, gap, ["run"])))
    follows = {
        REPRODUCED: "Agents lose more on harder levels. Harder levels have other returns anyway: 4a-shift compares "
        "with agents that were trained there.",
        NOT_REPRODUCED: "No loss on harder levels is found that is larger than the one in distribution.",
        UNDECIDED: "Whether the gap on harder levels is larger stays open.",
    }
    return finished(name, statement, where, findings, follows, OUT)


def shift_costs(evidence: Evidence) -> Claim:
    """Figure 4a, once the difficulty of the levels themselves is taken out."""
    name, where = "4a-shift", "figure 4a, implied; not run in the paper"
    statement = "The loss is one of the shift: agents that were trained at the harder difficulty do better there."
    harder = evidence.results.harder
    trained = there_trained(evidence.main, harder) if len(harder) else harder
    if trained.empty:
        return not_testable(name, statement, where, OUT)
    words = "return on harder levels less that of agents trained there, same n and seed"
    findings = [difference(evidence, CORRECTED, words, trained)]
    follows = {
        REPRODUCED: "Part of the gap is the shift itself, not only that harder levels have lower returns.",
        NOT_REPRODUCED: "Agents that were trained at the harder difficulty do no better there.",
        UNDECIDED: "How much of the gap is the shift, and how much the difficulty of the levels, stays open.",
    }
    return finished(name, statement, where, findings, follows, OUT)


def there_trained(main: pd.DataFrame, harder: pd.DataFrame) -> pd.DataFrame:
    """Transfers beside the agent of the same n and seed that was trained where they are tested: ``difference``."""
    at, there = (["test_family", "test_difficulty", "n", "seed"], ["family", "difficulty", "n", "seed"])
    return paired(harder, main, "eta_test_deterministic", at, there)


def transfer_trend(evidence: Evidence) -> Claim:
    """Figure 4a: the trend from medium to hard."""
    name, where = "4a-trend", "figure 4a's paragraph"
    statement = "From medium to hard, the gap worsens with W2, at least in Empty and Objects."
    harder = evidence.results.harder
    if harder.empty:
        return not_testable(name, statement, where, OUT)
    findings = []
    for settings, mode, gap in SETTINGS:
        parts = [(f, select(harder, family=f, difficulty="medium")) for f in ("empty", "objectsx1")]
        found = {family: pearson(part, f"w2_{mode}", gap) for family, part in parts if len(part)}
        for family, one in held(settings, found).items():
            findings.append(effect(settings, f"{family}, medium to hard, {WORDS[settings]}", R, one))
    follows = {
        REPRODUCED: "The trend is there. Out of distribution W2 hardly moves once n is 10 or more, so nearly all of "
        "it rests on the runs with one training level.",
        NOT_REPRODUCED: "The trend is not there in both families.",
        UNDECIDED: "With so few points per line, the trend is not found in both families, nor ruled out.",
    }
    return finished(name, statement, where, findings, follows, OUT)


def transfer_overall(evidence: Evidence) -> Claim:
    """Figure 4a's caption, which claims more than the text."""
    name, where = "4a-all", "caption of figure 4a"
    statement = "Out of distribution, the gap grows with W2 (said without exception)."
    harder = evidence.results.harder
    if harder.empty:
        return not_testable(name, statement, where, OUT)
    paper = pearson(harder, "w2_reference", "gap_2022", ("panel",))
    corrected = evidence.correlation("4a exact", harder, "w2_exact", "gap", ("panel", "log_n"))
    findings = (
        effect(PAPER, "W2 and returns of 2022, given the pair of panels", PARTIAL, paper),
        effect(CORRECTED, "exact W2, full returns, given the pair and log n, by blocks", PARTIAL, corrected),
    )
    follows = {
        REPRODUCED: "Within pairs the gap falls with W2; whether beyond n, the corrected row says.",
        NOT_REPRODUCED: "Within pairs of panels the gap does not fall with W2.",
        UNDECIDED: "Within pairs of panels, the trend is neither found nor ruled out.",
    }
    return finished(name, statement, where, findings, follows, OUT)


SETTINGS = ((PAPER, "reference", "gap_2022"), (CORRECTED, "exact", "gap"))
WORDS = {PAPER: "W2 and returns of 2022", CORRECTED: "exact W2, full returns"}


def by_panel(evidence: Evidence, name: str, where: str, statement: str, difficulties: tuple[str, ...]) -> Claim:
    """A claimed trend in each panel of some difficulties."""
    if evidence.main.empty:
        return not_testable(name, statement, where, MAIN)
    findings = []
    for settings, mode, gap in SETTINGS:
        for panel in panels_of(evidence, difficulties):
            found = evidence.association(mode, gap, "within", panel, corrected=settings == CORRECTED)
            findings.append(effect(settings, f"{panel}, {WORDS[settings]}", R, found))
    follows = {
        REPRODUCED: "The trend is in every panel.",
        NOT_REPRODUCED: "At least one panel has no such trend.",
        UNDECIDED: "Some panels show the trend, others neither show it nor rule it out: each line has few points.",
    }
    return finished(name, statement, where, findings, follows, MAIN)


def by_family(evidence: Evidence, name: str, where: str, statement: str, families: tuple[str, ...]) -> Claim:
    """A claimed trend in each of some families, given the difficulty."""
    findings = []
    for settings, mode, gap in SETTINGS:
        for family in families:
            part = select(evidence.main, family=family)
            if len(part):
                words, x = f"{family}, {WORDS[settings]}, given difficulty", f"w2_{mode}"
                found = pearson(part, x, gap, ("difficulty",))
                if settings == CORRECTED:
                    shuffled = evidence.permutation(f"{family} {x}", part, x, gap)
                    found = dataclasses.replace(found, p=shuffled.p)
                    words += "; permutation within panels"
                findings.append(effect(settings, words, PARTIAL, found))
    follows = {
        REPRODUCED: "The trend is there, given the difficulty.",
        NOT_REPRODUCED: "There is no such trend, given the difficulty.",
        UNDECIDED: "The trend is neither found nor ruled out.",
    }
    return finished(name, statement, where, findings, follows, MAIN)


def finished(
    name: str,
    statement: str,
    where: str,
    findings: list[Finding] | tuple[Finding, ...],
    follows: dict[str, str],
    needs: str,
) -> Claim:
    """The claim with what follows from its verdicts, each reading by itself where they differ; or what it needs."""
    claim = Claim(name, statement, where, findings)
    read = {settings: claim.verdict(settings) for settings in (PAPER, CORRECTED) if claim.has(settings)}
    said = {settings: follows.get(verdict, "") for settings, verdict in read.items()}
    if len(set(read.values())) > 1:
        text = " ".join(f"{settings.capitalize()}: {words}" for settings, words in said.items() if words)
    else:
        text = next(iter(said.values()), "")
    return dataclasses.replace(claim, follows=text, needs="" if text else needs)


def held(settings: str, found: dict[str, Estimate]) -> dict[str, Estimate]:
    """The estimates of one claim's tests; in the corrected reading with Holm's p-values."""
    if settings != CORRECTED:
        return found
    p = holm([one.p for one in found.values()])
    return {name: dataclasses.replace(one, p=float(q)) for (name, one), q in zip(found.items(), p, strict=True)}


def effect(settings: str, test: str, measure: str, found: Estimate, sign: int = WORSE) -> Finding:
    """A finding about a correlation of a claimed sign."""
    return Finding(settings, test, measure, found, verdicts.of_effect(found, sign))


def difference(
    evidence: Evidence,
    settings: str,
    test: str,
    differences: pd.DataFrame,
    sign: int = WORSE,
    measure: str = "mean difference",
) -> Finding:
    """A finding about a mean of paired differences of a claimed sign."""
    found = evidence.mean(f"{settings} {test}", differences)
    return Finding(settings, test, measure, found, verdicts.of_effect(found, sign, small_difference(differences)))


def small_difference(differences: pd.DataFrame) -> float:
    """The difference that would matter: a fifth of the standard deviation of the paired differences."""
    return verdicts.SMALL_D * float(column(differences, "difference").std(ddof=1)) if len(differences) > 1 else 0.0


def panels_of(evidence: Evidence, difficulties: tuple[str, ...] = (), families: tuple[str, ...] = ()) -> list[str]:
    """The panels of the main grid, of some difficulties or families, in the paper's order."""
    parts = [(panel, *panel.rsplit("-", 1)) for panel in evidence.results.panels]
    return [p for p, f, d in parts if (not difficulties or d in difficulties) and (not families or f in families)]


CLAIMS = (
    pooled, within_panels, beyond_n, within_cells, fixed_number, panels_but_easy, easy_panels, empty_is_clear, others_are_weak,
    transfer_is_worse, shift_costs, transfer_trend, transfer_overall,
)  # fmt: skip
