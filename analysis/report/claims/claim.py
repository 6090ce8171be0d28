"""A claim: a statement, its findings, and what follows."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

import pandas as pd

from segar.analysis.report.claims import verdicts
from segar.analysis.report.rules import ALPHA, PRESENT
from segar.analysis.stats.association import holm
from segar.analysis.stats.estimate import Estimate

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
    lacks_room: str = ""  # why no effect as large as the margin could be seen, if so
    beside: str = ""  # what quantities that know nothing of levels say in place of a distance

    @property
    def verdict(self) -> str:
        """The verdict on this test by itself."""
        if self.lacks_room:
            return verdicts.NOT_TESTABLE
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
        found = dataclasses.replace(self.found, note="; ".join(filter(None, (self.found.note, self.lacks_room))))
        return found.row(**said, margin=self.margin, power=self.power, verdict=self.verdict, beside=self.beside)


@dataclass(frozen=True)
class Planned:
    """How many runs were planned for a claim, and how many of them are there, whether or not they learned."""

    planned: int = 0
    present: int = 0
    hours: float = math.nan  # that one of them took, training and evaluation

    @property
    def is_short(self) -> bool:
        """Whether too many are missing for a verdict."""
        return self.present < PRESENT * self.planned

    @property
    def to_come(self) -> str:
        """The missing runs, with what they cost."""
        missing = self.planned - self.present
        cost = f" ({missing * self.hours:.1f} hours on one core)" if math.isfinite(self.hours) else ""
        return f"{missing} more runs or their tests{cost}"

    def __str__(self) -> str:
        return f"{self.present} of {self.planned} planned runs are there, {self.planned - self.present} are missing"


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
    planned: Planned = Planned()
    untested: str = ""  # the verdict where no run of any plan is about it
    corrected: Mapping[tuple[str, str], float] = field(default_factory=dict)
    """Holm's p over its family, by settings and runs."""

    def verdict(self, settings: str = METRIC_2022, runs: str = "") -> str:
        """The verdict in these settings; empty where the claim has no test in them, but has in others."""
        if self.findings and not self.has(settings):
            return ""
        if self.untested:
            return self.untested
        if self.planned.is_short:
            return verdicts.NOT_YET
        found = verdicts.combined(one.verdict for one in self.tests(settings, runs))
        return verdicts.UNDECIDED if self.taken_by(settings, runs) else found

    def last_verdict(self, readings: Sequence[str]) -> str:
        """The verdict in the last of these settings in which the claim has a test."""
        return [found for one in readings if (found := self.verdict(one))][-1]

    def taken_by(self, settings: str, runs: str = "") -> float:
        """The corrected p that takes a verdict away which its tests support by themselves; 0 where none does."""
        found = verdicts.combined(one.verdict for one in self.tests(settings, runs))
        p = self.corrected.get((settings, runs or self.runs), 0.0)
        return p if found == verdicts.SUPPORTED and p >= ALPHA else 0.0

    def largest_p(self, settings: str, runs: str) -> float:
        """The largest p of its tests, all of which must hold; 1 where one has none, NaN for a claim of absence."""
        tests = self.tests(settings, runs)
        if any(one.sign == 0 for one in tests):
            return math.nan
        return max((one.found.p if math.isfinite(one.found.p) else 1.0 for one in tests), default=1.0)

    def has(self, settings: str) -> bool:
        """Whether there is any test in these settings."""
        return any(one.settings == settings for one in self.findings)

    def tests(self, settings: str, runs: str = "") -> list[Finding]:
        """The findings in these settings, with these runs; left out, those that the verdict is about."""
        return [one for one in self.findings if one.settings == settings and one.runs == (runs or self.runs)]


def with_holm(claims: Sequence[Claim]) -> list[Claim]:
    """The claims with Holm's p of each claim of an effect, over all claims of the same maker, tested or not."""
    corrected: dict[str, dict[tuple[str, str], float]] = {one.name: {} for one in claims}
    for of, settings, runs in product((OF_PAPER, OF_OURS), (METRIC_2022, METRIC_OURS), (LEARNED, ALL_RUNS)):
        p = {one.name: one.largest_p(settings, runs) for one in claims if one.of == of and not one.untested}
        p = {name: value for name, value in p.items() if math.isfinite(value)}
        for name, value in zip(p, holm([*p.values()]), strict=True):
            corrected[name][settings, runs] = float(value)
    return [dataclasses.replace(one, corrected=corrected[one.name]) for one in claims]


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
        counted = {"planned": claim.planned.planned, "present": claim.planned.present}
        tail = {**of_claim, **counted, "needs": claim.needs, "follows": claim.follows}
        rows += [
            {**head, **one.row(), "p_holm": claim.corrected.get((one.settings, one.runs)), **tail}
            for one in claim.findings
        ]
        if not claim.findings:
            rows.append({**head, "verdict": claim.verdict(METRIC_OURS), **tail})
    columns = ["claim", "of", "where", "statement", "settings", "runs", "test", "measure", "estimate", "low", "high", "n",
               "p", "p_holm", "margin", "power", "beside", "verdict", "note", "of_claim_2022", "of_claim_ours",
               "of_claim_2022_all_runs",
               "of_claim_ours_all_runs", "planned", "present", "follows", "needs"]  # fmt: skip
    return pd.DataFrame(rows, columns=columns)


def is_correlation(measure: str) -> bool:
    """Whether an estimate of this measure is a correlation."""
    return measure.endswith("Pearson r")
