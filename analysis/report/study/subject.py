"""A study of one's own as the subject of a report."""

from functools import partial
from pathlib import Path

import pandas as pd

from segar.analysis.report.claims.claim import Claim, claims_table
from segar.analysis.report.study.claims import TESTED, WORDS, claim_or_reason
from segar.analysis.report.study.document import document
from segar.analysis.report.study.figures import FIGURES
from segar.analysis.report.study.reading import read_study
from segar.analysis.report.subject import Subject

PAPERS = ("of", "settings", "runs", "where", "follows")  # columns of claims that only the paper's report fills


def study(folder: Path) -> Subject:
    """The study whose tables are in a folder; raises :class:`RunFolderError`, also where somebody else's study names code of
    its own. A claim that cannot be tested is in the report with the reason."""
    asked = read_study(folder)
    return Subject(
        asked.evidence,
        {name: partial(draw, asked) for name, draw in FIGURES.items()},
        claims=lambda: [claim_or_reason(asked, name, one) for name, one in asked.asked.get("claims", {}).items()],
        claims_table=tested_claims,
        document=lambda claims, drawn: document(asked, claims, drawn),
        readings=(TESTED,),
        words=WORDS,
    )


def tested_claims(claims: list[Claim]) -> pd.DataFrame:
    """``claims.csv``: one row per test."""
    table = claims_table(claims)
    table = table.drop(columns=[one for one in table if one.startswith("of_claim") or one in PAPERS])
    return table.replace({"verdict": WORDS})
