"""Reads the claims: the words of each from ``statements.yaml``, its findings from its tests."""

import dataclasses
from collections.abc import Mapping

from analysis.report.claims.claim import ALL_RUNS, METRIC_2022, METRIC_OURS, OF_PAPER, Claim, Finding
from analysis.report.claims.evidence import Evidence
from analysis.report.claims.rows import ROWS
from analysis.report.claims.specifications import specifications, survives
from analysis.report.claims.statements import STATEMENTS, tested
from analysis.report.claims.tests import with_holm
from analysis.report.claims.words import BESIDE, NUMBERS, OF_TESTS


def read_claims(evidence: Evidence) -> list[Claim]:
    """All claims with their findings, in the order of ``statements.yaml``."""
    table = specifications(evidence)
    return [read_claim(name, evidence, survives(table, name)) for name in STATEMENTS["claims"]]


def read_claim(name: str, evidence: Evidence, survives: bool = True) -> Claim:
    """The claim with its findings, and what follows from its verdicts; or what it takes to test it.

    Args:
        survives: whether the claim's specifications agree with it.
    """
    words, needs = STATEMENTS["claims"][name], STATEMENTS["evidence"]
    rows = ROWS[words["evidence"]](evidence)
    leading = (dataclasses.replace(one, survives=survives) for one in findings_of(name, evidence))
    of_all = (dataclasses.replace(one, runs=ALL_RUNS) for one in findings_of(name, evidence.ungated))
    claim = Claim(
        name,
        words["says"],
        words["where"],
        (*leading, *of_all),
        note=words.get("note", ""),
        of=words.get("of", OF_PAPER),
    )
    follows = consequence(claim, words)
    if not follows:
        lacks = words.get("else_needs", words["evidence"]) if len(rows) else words["evidence"]
        return claim.with_words(needs=needs[lacks])
    said = follows.format(**NUMBERS[name](evidence, rows)) if name in NUMBERS else follows
    beside = BESIDE[name](evidence, rows) if name in BESIDE else ""
    of_tests = OF_TESTS[name](claim) if name in OF_TESTS else ""
    return claim.with_words(follows=" ".join(filter(None, (said, beside, of_tests))))


def findings_of(name: str, evidence: Evidence) -> list[Finding]:
    """The findings of a claim's tests; none where the runs that it is about are missing."""
    words = STATEMENTS["claims"][name]
    rows = ROWS[words["evidence"]](evidence)
    found = tested(evidence, rows, name) if len(rows) else []
    if not words.get("holm"):
        return found
    parts = ([one for one in found if one.settings == settings] for settings in (METRIC_2022, METRIC_OURS))
    return [one for part in parts for one in with_holm(part)]


def consequence(claim: Claim, words: Mapping[str, str]) -> str:
    """The sentences for the claim's verdicts: one where both readings agree, else one for each; "" where there is none."""
    read = {settings: claim.verdict(settings) for settings in (METRIC_2022, METRIC_OURS) if claim.has(settings)}
    sentences = {settings: words.get(verdict.replace(" ", "_"), "") for settings, verdict in read.items()}
    if len(set(read.values())) > 1:
        return " ".join(f"{settings.capitalize()}: {text}" for settings, text in sentences.items() if text)
    return next(iter(sentences.values()), "")
