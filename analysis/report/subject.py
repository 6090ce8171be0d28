"""What a report is about: the paper's experiments, or a study of one's own. Both are made by ``make`` in the same way."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import pandas as pd

from segar.analysis.report.claims.claim import METRIC_2022, METRIC_OURS, Claim, claims_table
from segar.analysis.report.claims.evidence import Evidence
from segar.analysis.report.document.blocks import Document, Picture
from segar.analysis.report.figures.drawing import Drawn


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
