"""Reads the claims: the words of each from ``statements.yaml``, its findings from its tests."""

import dataclasses
from collections.abc import Mapping

from segar.analysis.report.claims.claim import (
    ALL_RUNS,
    LEARNED,
    METRIC_2022,
    METRIC_OURS,
    OF_PAPER,
    Claim,
    Finding,
    with_holm,
)
from segar.analysis.report.claims.evidence import Evidence
from segar.analysis.report.claims.planned import planned_of
from segar.analysis.report.claims.rows import ROWS
from segar.analysis.report.claims.specifications import specifications, survives
from segar.analysis.report.claims.statements import STATEMENTS, tested
from segar.analysis.report.claims.words import BESIDE, NUMBERS


def read_claims(evidence: Evidence) -> list[Claim]:
    """All claims with their findings, in the order of ``statements.yaml``."""
    table = specifications(evidence)
    found = with_holm([claim_of(name, evidence, survives(table, name)) for name in STATEMENTS["claims"]])
    return [one if one.untested else with_consequence(one, evidence) for one in found]


def claim_of(name: str, evidence: Evidence, survives: bool) -> Claim:
    """The claim with its findings, and the runs that were planned for it; ``survives``: whether its specifications agree."""
    words = STATEMENTS["claims"][name]
    if "untested" in words:
        return Claim(name, words["says"], words["where"], untested=words["untested"], needs=words["needs"])
    leading = (dataclasses.replace(one, survives=survives) for one in findings_of(name, evidence))
    of_all = (dataclasses.replace(one, runs=ALL_RUNS) for one in findings_of(name, evidence.ungated))
    return Claim(
        name,
        words["says"],
        words["where"],
        (*leading, *of_all),
        note=words.get("note", ""),
        of=words.get("of", OF_PAPER),
        runs=words.get("runs", LEARNED),
        planned=planned_of(name, evidence),
    )


def with_consequence(claim: Claim, evidence: Evidence) -> Claim:
    """The claim with what follows from its verdicts, or with what it takes to test it."""
    name, words, needs = claim.name, STATEMENTS["claims"][claim.name], STATEMENTS["evidence"]
    rows = ROWS[words["evidence"]](evidence)
    follows, lacks = consequence(claim, words), ""
    if not follows:
        lacks = needs[words.get("else_needs", words["evidence"]) if len(rows) else words["evidence"]]
    if claim.planned.is_short:
        names = ",".join(STATEMENTS["planned"][words["evidence"]])
        lacks = f"{claim.planned.to_come}, `experiments=[{names}]`"
    if not len(rows):
        return claim.with_words(needs=lacks)
    said = follows.format(**NUMBERS[name](evidence, rows)) if follows and name in NUMBERS else follows
    beside = BESIDE[name](evidence, rows) if name in BESIDE else ""
    return claim.with_words(" ".join(filter(None, (said, beside))), lacks)


def findings_of(name: str, evidence: Evidence) -> list[Finding]:
    """The findings of a claim's tests; none where the runs that it is about are missing."""
    words = STATEMENTS["claims"][name]
    rows = ROWS[words["evidence"]](evidence)
    return tested(evidence, rows, name) if len(rows) else []


def consequence(claim: Claim, words: Mapping[str, str]) -> str:
    """The sentences for the claim's verdicts: one where both readings agree, else one for each; "" where there is none."""
    read = {settings: claim.verdict(settings) for settings in (METRIC_2022, METRIC_OURS) if claim.has(settings)}
    sentences = {settings: words.get(verdict.replace(" ", "_"), "") for settings, verdict in read.items()}
    if len(set(read.values())) > 1:
        return " ".join(f"{settings.capitalize()}: {text}" for settings, text in sentences.items() if text)
    return next(iter(sentences.values()), "")
