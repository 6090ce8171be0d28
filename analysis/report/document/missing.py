"""What was planned and is not in the tables, with what it would cost."""

from segar.analysis.report.captions import TEXTS
from segar.analysis.report.claims.evidence import Evidence
from segar.analysis.report.claims.reading import hours_of_one
from segar.analysis.report.document.blocks import Block, Heading, Paragraph, Table
from segar.analysis.report.number_format import plain
from segar.analysis.report.results import Results
from segar.experiments.reproduction.experiment_file import PLAN, SCALES


def preliminary(results: Results) -> list[Block]:
    """A mark of what is not to be believed yet: the smallest scale, and a reproduction that is not finished."""
    if results.scale == SCALES[0]:
        return [Paragraph(TEXTS["smallest"], "warning")]
    if (results.folder / PLAN).exists() and len(results.missing):
        return [Paragraph(TEXTS["unfinished"].format(missing=len(results.missing)), "warning")]
    return []


def what_is_missing(evidence: Evidence) -> list[Block]:
    """A table of what was planned and is not there, by experiment; nothing where all is there."""
    results = evidence.all_results
    if results.missing.empty:
        return []
    found, rows = [], []
    for (name, title), part in results.missing.groupby(["name", "experiment"], sort=False, dropna=False):  # type: ignore[misc]
        unfinished = set(part.loc[part["reason"].isin(["not begun", "not finished"]), "run"])
        found.append((str(name), str(title), len(unfinished), len({*part["run"]} - unfinished)))
    for name, title, runs, tests in sorted(found, key=lambda one: -one[2] - one[3]):
        hours = plain((runs + tests) * hours_of_one(results, [name]), 1)
        rows.append([f"`{name}`", title, f"{runs}", f"{tests}", hours])
    head = ("experiment", "what it is about", "missing runs", "runs that lack tests or probes", "hours on one core")
    caption = (
        "Each is named in `missing.csv`. Hours: of training and evaluation, as runs of it took that are there, or those of an "
        "earlier plan. Agents that lack tests are trained again, because the tables do not hold them."
    )
    return [Heading("What is missing"), Table(head, rows, 2, caption)]
