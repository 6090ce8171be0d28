"""The paper's experiments as the subject of a report."""

from functools import partial
from pathlib import Path

from analysis.report.claims.claim import METRIC_2022, METRIC_OURS, claims_table
from analysis.report.claims.evidence import Evidence
from analysis.report.claims.reading import read_claims
from analysis.report.document.sections import document
from analysis.report.document.tables import statistics
from analysis.report.figures import FIGURES
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
    )
