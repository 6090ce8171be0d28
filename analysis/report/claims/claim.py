"""A claim: a statement, its findings, and what follows."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

from analysis.report.claims import verdicts
from analysis.stats.estimate import Estimate

CLAIMS = "claims.csv"  # of claims_table
METRIC_2022, METRIC_OURS = "2022 metric", "our metric"  # of distances and returns
LEARNED, ALL_RUNS = "runs that learned", "all runs"
OF_PAPER, OF_OURS = "paper", "ours"  # who makes the claim


@dataclass(frozen=True)
class Finding:
    """One test of a claim."""

    settings: str  # METRIC_2022 or METRIC_OURS
    test: str  # what was measured, in words
    measure: str  # what the estimate is, e.g. "Pearson r"
    found: Estimate
    margin: float  # effects smaller than this do not matter
    sign: int  # of the claimed effect; 0 where none is claimed
    runs: str = LEARNED  # LEARNED leads; ALL_RUNS is the same test with the runs that did not learn, too
    survives: bool = True  # whether the specifications of the same test agree, where there are any
    corrected: bool = False  # whether its p is Holm's, over the tests of its claim

    @property
    def verdict(self) -> str:
        """The verdict on this test by itself."""
        if self.sign:
            verdict = verdicts.of_effect(self.found, self.sign, self.margin)
        else:
            verdict = verdicts.of_absence(self.found, self.margin)
        return verdicts.UNDECIDED if verdict == verdicts.SUPPORTED and not self.survives else verdict

    @property
    def power(self) -> float:
        """How probable it is that this design finds an effect as large as the margin."""
        return verdicts.power_at_margin(self.found, self.margin, is_correlation(self.measure))

    def row(self) -> dict[str, object]:
        """The finding as a row of ``claims.csv``."""
        said = {"settings": self.settings, "runs": self.runs, "test": self.test, "measure": self.measure}
        return self.found.row(**said, margin=self.margin, power=self.power, verdict=self.verdict)


@dataclass(frozen=True)
class Claim:
    """A statement of the paper, or a question that we add, and what the tables say of it."""

    name: str
    statement: str  # in our words
    where: str  # in the paper
    findings: Sequence[Finding] = ()
    follows: str = ""
    needs: str = ""  # where it cannot be tested: what would make it so
    note: str = ""
    of: str = OF_PAPER
    runs: str = LEARNED  # which runs its verdict is about

    def verdict(self, settings: str = METRIC_2022, runs: str = "") -> str:
        """The verdict in these settings; empty where the claim has no test in them, but has in others."""
        if self.findings and not self.has(settings):
            return ""
        return verdicts.combined(one.verdict for one in self.tests(settings, runs or self.runs))

    def has(self, settings: str) -> bool:
        """Whether there is any test in these settings."""
        return any(one.settings == settings for one in self.findings)

    def tests(self, settings: str, runs: str = LEARNED) -> list[Finding]:
        """The findings in these settings, with these runs."""
        return [one for one in self.findings if one.settings == settings and one.runs == runs]

    def with_words(self, follows: str = "", needs: str = "") -> Claim:
        """The claim with what follows from its findings, or with what it would take to test it."""
        return dataclasses.replace(self, follows=follows, needs=needs)


def claims_table(claims: Sequence[Claim]) -> pd.DataFrame:
    """``claims.csv``: one row per test; a claim without tests has one row that says what it needs."""
    rows = []
    for claim in claims:
        head = {"claim": claim.name, "of": claim.of, "where": claim.where, "statement": claim.statement}
        of_claim = {
            f"of_claim_{name}{suffix}": claim.verdict(settings, runs)
            for settings, name in ((METRIC_2022, "2022"), (METRIC_OURS, "ours"))
            for runs, suffix in ((LEARNED, ""), (ALL_RUNS, "_all_runs"))
        }
        tail = {**of_claim, "needs": claim.needs, "follows": claim.follows}
        rows += [{**head, **one.row(), **tail} for one in claim.findings]
        if not claim.findings:
            rows.append({**head, "verdict": verdicts.NOT_TESTABLE, **tail})
    columns = ["claim", "of", "where", "statement", "settings", "runs", "test", "measure", "estimate", "low", "high", "n",
               "p", "margin", "power", "verdict", "note", "of_claim_2022", "of_claim_ours", "of_claim_2022_all_runs",
               "of_claim_ours_all_runs", "follows", "needs"]  # fmt: skip
    return pd.DataFrame(rows, columns=columns)


def is_correlation(measure: str) -> bool:
    """Whether an estimate of this measure is a correlation."""
    return measure.endswith("Pearson r")
