"""Makes the report of a study: its claims, its figures with their data, a page and a PDF."""

import shlex
from functools import partial
from pathlib import Path

from analysis.report.claims.claim import CLAIMS, Claim, claims_table
from analysis.report.document.files import write_document, write_picture
from analysis.report.study.claims import WORDS, claim_or_reason
from analysis.report.study.document import document
from analysis.report.study.figures import FIGURES
from analysis.report.study.reading import Study, read_study
from analysis.tables import write_csv

PAPERS = ("of", "settings", "runs", "where", "follows")  # columns of claims that only the paper's report fills


def make_study_report(folder: Path, out: Path) -> tuple[Study, list[Claim]]:
    """Reads the tables in ``folder``, and writes claims, figures and report into ``out``; returns the study and its claims.

    A claim that cannot be tested is in the report with the reason, which is printed, too.

    Raises:
        RunFolderError: a table is not there, or somebody else's study names code of its own.
    """
    study, command = read_study(folder), f"python -m analysis.report results={shlex.quote(str(folder))}"
    claims = [claim_or_reason(study, name, one) for name, one in study.asked.get("claims", {}).items()]
    pictures = {name: write_picture(partial(draw, study), out, name, command) for name, draw in FIGURES.items()}
    table = claims_table(claims)
    table = table.drop(columns=[one for one in table if one.startswith("of_claim") or one in PAPERS])
    for claim in claims:
        if claim.needs:
            print(f"{claim.name} cannot be tested; it needs {claim.needs}.")
    write_csv(out / CLAIMS, table.replace({"verdict": WORDS}), 4)
    write_document(document(study, claims, pictures), out)
    return study, claims
