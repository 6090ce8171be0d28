"""A claim: the paper's statement in our words, its findings, and what follows. Also the helpers that make findings."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from analysis.report.claims import verdicts
from analysis.report.claims.evidence import Evidence
from analysis.stats.association import holm
from analysis.stats.estimate import Estimate
from analysis.tables import column

PAPER, CORRECTED = "as in the paper", "corrected"
CLAIMS = "claims.csv"  # in the folder of a report


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
        return self.found.row(settings=self.settings, test=self.test, measure=self.measure, verdict=self.verdict)


@dataclass(frozen=True)
class Claim:
    """A statement of the paper, and what the tables say of it."""

    name: str
    statement: str  # in our words
    where: str  # in the paper
    findings: Sequence[Finding] = ()
    follows: str = ""
    needs: str = ""  # where it is not testable: what would make it so
    note: str = ""

    def verdict(self, settings: str = PAPER) -> str:
        """The verdict in these settings; empty where the claim has no test in them, but has in others."""
        if self.findings and not self.has(settings):
            return ""
        return verdicts.combined(one.verdict for one in self.findings if one.settings == settings)

    def has(self, settings: str) -> bool:
        """Whether there is any test in these settings."""
        return any(one.settings == settings for one in self.findings)

    def with_words(self, follows: str = "", needs: str = "") -> Claim:
        """The claim with what follows from its findings, or with what it would take to test it."""
        return dataclasses.replace(self, follows=follows, needs=needs)


def claims_table(claims: Sequence[Claim]) -> pd.DataFrame:
    """:data:`CLAIMS`: one row per test; a claim without tests has one row that says what it needs."""
    rows = []
    for claim in claims:
        head = {"claim": claim.name, "where": claim.where, "statement": claim.statement}
        tail = {"of_claim": claim.verdict(PAPER), "of_claim_corrected": claim.verdict(CORRECTED), "needs": claim.needs}
        tail["follows"] = claim.follows
        rows += [{**head, **one.row(), **tail} for one in claim.findings]
        if not claim.findings:
            rows.append({**head, "verdict": verdicts.NOT_TESTABLE, **tail})
    columns = ["claim", "where", "statement", "settings", "test", "measure", "estimate", "low", "high", "n", "p",
               "verdict", "note", "of_claim", "of_claim_corrected", "follows", "needs"]  # fmt: skip
    return pd.DataFrame(rows, columns=columns)


def effect(settings: str, test: str, measure: str, found: Estimate, sign: int) -> Finding:
    """A finding about a correlation of a claimed sign."""
    return Finding(settings, test, measure, found, verdicts.of_effect(found, sign))


def mean_difference(
    evidence: Evidence, settings: str, test: str, differences: pd.DataFrame, sign: int
) -> Iterator[Finding]:
    """A finding about the mean of the column ``difference``, whose claimed sign is given; none where there are no rows."""
    if len(differences):
        found = evidence.mean(f"{settings} {test}", differences)
        verdict = verdicts.of_effect(found, sign, small_difference(differences))
        yield Finding(settings, test, "mean difference", found, verdict)


def small_difference(differences: pd.DataFrame) -> float:
    """The difference that would matter: a fifth of the standard deviation of the paired differences."""
    return verdicts.SMALL_D * float(column(differences, "difference").std(ddof=1)) if len(differences) > 1 else 0.0


def with_holm(settings: str, found: Mapping[str, Estimate]) -> Mapping[str, Estimate]:
    """The estimates of one claim's tests, by name; in the corrected reading with Holm's p-values."""
    if settings != CORRECTED:
        return found
    p = holm([one.p for one in found.values()])
    return {name: dataclasses.replace(one, p=float(q)) for (name, one), q in zip(found.items(), p, strict=True)}
