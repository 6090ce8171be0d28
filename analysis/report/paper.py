"""The paper's experiments as the subject of a report."""

from collections import Counter
from functools import partial
from pathlib import Path

from analysis.report.claims.claim import METRIC_2022, METRIC_OURS, Claim, claims_table
from analysis.report.claims.evidence import Evidence
from analysis.report.claims.reading import read_claims
from analysis.report.document.sections import document
from analysis.report.document.tables import statistics
from analysis.report.figures import FIGURES
from analysis.report.number_format import estimate_text
from analysis.report.results import read_results
from analysis.report.subject import Subject

READINGS = (METRIC_2022, METRIC_OURS)


def paper(folder: Path) -> Subject:
    """The experiments whose tables are in a folder; raises :class:`RunFolderError`."""
    evidence = Evidence(read_results(folder))
    return Subject(
        evidence,
        READINGS,
        {name: partial(draw, evidence) for name, draw in FIGURES.items()},
        claims=lambda: read_claims(evidence),
        statistics=lambda: statistics(evidence),
        claims_table=claims_table,
        document=lambda claims, drawn: document(evidence, claims, drawn),
        sentences=partial(sentences, evidence),
    )


def sentences(evidence: Evidence, claims: list[Claim]) -> list[str]:
    """How many claims have each verdict in both metrics, and the headline."""
    said = []
    for settings in READINGS:
        counted = Counter(claim.verdict(settings) for claim in claims)
        said.append(f"{settings}: " + ", ".join(f"{count} {name}" for name, count in sorted(counted.items()) if name))
    if len(evidence.main):
        found = evidence.of_main("reference", "gap_2022", "pooled")
        said.append(f"gap against W2 of 2022, pooled, runs that learned: {estimate_text(found)}")
    return said
