"""The paper's experiments as the subject of a report."""

from functools import partial
from pathlib import Path

from segar.analysis.report.claims.evidence import Evidence
from segar.analysis.report.claims.reading import read_claims
from segar.analysis.report.document.sections import document
from segar.analysis.report.document.tables import statistics
from segar.analysis.report.figures import FIGURES
from segar.analysis.report.results import read_results
from segar.analysis.report.subject import Subject


def paper(folder: Path) -> Subject:
    """The experiments whose tables are in a folder; raises :class:`RunFolderError`."""
    evidence = Evidence(read_results(folder))
    return Subject(
        evidence,
        {name: partial(draw, evidence) for name, draw in FIGURES.items()},
        claims=lambda: read_claims(evidence),
        statistics=lambda: statistics(evidence),
        document=lambda claims, drawn: document(evidence, claims, drawn),
    )
