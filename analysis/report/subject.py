"""What a report is about: the paper's experiments, or a study of one's own. Both are made by ``make`` in the same way."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import pandas as pd

from segar.analysis.report.claims.claim import METRIC_2022, METRIC_OURS, Claim, claims_table
from segar.analysis.report.claims.evidence import Evidence
from segar.analysis.report.claims.reading import read_claims
from segar.analysis.report.document import sections
from segar.analysis.report.document.blocks import Document, Picture
from segar.analysis.report.document.tables import statistics
from segar.analysis.report.figures import FIGURES
from segar.analysis.report.figures.drawing import Drawn
from segar.analysis.report.results import read_results
from segar.analysis.report.study import document, figures
from segar.analysis.report.study.claims import TESTED, WORDS, claim_or_reason
from segar.analysis.report.study.reading import read_study

PAPERS = ("of", "settings", "runs", "where", "follows")  # columns of claims that only the paper's report fills


@dataclass(frozen=True)
class Subject:
    """The parts of a report, each of which is made when it is asked for."""

    evidence: Evidence
    figures: Mapping[str, Callable[[], Drawn]]  # by name; each may raise NoFigure
    claims: Callable[[], list[Claim]]
    document: Callable[[list[Claim], Mapping[str, Picture | str]], Document]
    statistics: Callable[[], Mapping[str, pd.DataFrame]] = dict  # by the names of their CSV files
    claims_table: Callable[[list[Claim]], pd.DataFrame] = claims_table
    readings: Sequence[str] = (METRIC_2022, METRIC_OURS)  # in which claims are tested, as findings name them
    words: Mapping[str, str] = field(default_factory=dict)  # for verdicts, where others are better

    def sentence(self, claim: Claim) -> str:
        """What became of a claim, or what it takes to test it."""
        verdicts = filter(None, (claim.verdict(reading) for reading in self.readings))
        said = f"{claim.name}: {', '.join(self.words.get(one, one) for one in verdicts)}: {claim.statement}"
        return f"{said} It needs {claim.needs}." if claim.needs else said


def paper(folder: Path) -> Subject:
    """The paper's experiments, whose tables are in a folder; raises :class:`RunFolderError`."""
    evidence = Evidence(read_results(folder))
    return Subject(
        evidence,
        {name: partial(draw, evidence) for name, draw in FIGURES.items()},
        claims=lambda: read_claims(evidence),
        statistics=lambda: statistics(evidence),
        document=lambda claims, drawn: sections.document(evidence, claims, drawn),
    )


def study(folder: Path) -> Subject:
    """The study whose tables are in a folder; raises :class:`RunFolderError`, also where somebody else's study names code of
    its own. A claim that cannot be tested is in the report with the reason."""
    asked = read_study(folder)
    return Subject(
        asked.evidence,
        {name: partial(draw, asked) for name, draw in figures.FIGURES.items()},
        claims=lambda: [claim_or_reason(asked, name, one) for name, one in asked.asked.get("claims", {}).items()],
        claims_table=tested_claims,
        document=lambda claims, drawn: document.document(asked, claims, drawn),
        readings=(TESTED,),
        words=WORDS,
    )


def tested_claims(claims: list[Claim]) -> pd.DataFrame:
    """``claims.csv`` of a study: one row per test."""
    table = claims_table(claims)
    table = table.drop(columns=[one for one in table if one.startswith("of_claim") or one in PAPERS])
    return table.replace({"verdict": WORDS})
