"""What a claim is: the paper's statement in our words, what was found, and what follows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import pandas as pd

from analysis.report import verdicts
from analysis.report.verdicts import NOT_TESTABLE
from analysis.stats.estimate import Estimate

PAPER, CORRECTED = "as in the paper", "corrected"


@dataclass(frozen=True)
class Finding:
    """One test of a claim."""

    settings: str  # PAPER or CORRECTED
    test: str  # what was measured, in words
    measure: str  # what the estimate is, e.g. "Pearson r"
    found: Estimate
    verdict: str

    def row(self) -> dict[str, object]:
        """The finding as a row of ``claims.csv``."""
        one = self.found
        numbers = {"estimate": one.estimate, "low": one.low, "high": one.high, "n": one.n, "p": one.p}
        return {"settings": self.settings, "test": self.test, "measure": self.measure, **numbers, "verdict": self.verdict,
                "note": one.note}  # fmt: skip


@dataclass(frozen=True)
class Claim:
    """A statement of the paper, and what the tables say of it."""

    name: str
    statement: str  # in our words
    where: str  # in the paper
    findings: Sequence[Finding] = ()
    follows: str = ""
    needs: str = ""  # where it is not testable: what would make it so
    notes: Sequence[str] = field(default_factory=tuple)

    def verdict(self, settings: str = PAPER) -> str:
        """The verdict in these settings; empty where the claim has no test in them, but has in others."""
        if self.findings and not self.has(settings):
            return ""
        return verdicts.combined(one.verdict for one in self.findings if one.settings == settings)

    def has(self, settings: str) -> bool:
        """Whether there is any test in these settings."""
        return any(one.settings == settings for one in self.findings)


def not_testable(name: str, statement: str, where: str, needs: str) -> Claim:
    """A claim for which there are no runs, and what would provide them."""
    return Claim(name, statement, where, needs=needs)


def claims_table(claims: Sequence[Claim]) -> pd.DataFrame:
    """``claims.csv``: one row per test; a claim without tests has one row that says what it needs."""
    rows = []
    for claim in claims:
        head = {"claim": claim.name, "where": claim.where, "statement": claim.statement}
        tail = {"of_claim": claim.verdict(PAPER), "of_claim_corrected": claim.verdict(CORRECTED), "needs": claim.needs}
        tail["follows"] = claim.follows
        rows += [{**head, **one.row(), **tail} for one in claim.findings]
        if not claim.findings:
            rows.append({**head, "verdict": NOT_TESTABLE, **tail})
    columns = ["claim", "where", "statement", "settings", "test", "measure", "estimate", "low", "high", "n", "p",
               "verdict", "note", "of_claim", "of_claim_corrected", "follows", "needs"]  # fmt: skip
    return pd.DataFrame(rows, columns=columns)
