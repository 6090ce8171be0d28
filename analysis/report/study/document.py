"""The text of a study's report."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from segar.analysis.report.captions import TEXTS
from segar.analysis.report.claims.claim import Claim
from segar.analysis.report.document.blocks import Block, Bullets, Document, Heading, Paragraph, Picture, Table
from segar.analysis.report.document.files import as_block
from segar.analysis.report.document.missing import preliminary, what_is_missing
from segar.analysis.report.document.sections import how_verdicts_are_decided, what_was_run
from segar.analysis.report.document.tables import means
from segar.analysis.report.number_format import effect, estimate_text, plain
from segar.analysis.report.results import ETA, paired
from segar.analysis.report.study.claims import TESTED, WORDS
from segar.analysis.report.study.reading import SUCCESS, Study
from segar.analysis.runs import SAME_LEVELS, SHARED_LEVELS
from segar.analysis.stats.association import keys
from segar.analysis.stats.estimate import Estimate
from segar.analysis.tables import column, count_of, pick, select
from segar.experiments.reproduction.experiment_file import FEWEST_BLOCKS
from segar.experiments.reproduction.grid import LEVEL_SEED
from segar.support import counted

# Of the rules, those by which a claim with one test is judged, and the margins of correlations and of means.
OWN_VERDICTS, OWN_MARGINS = ("effect", "absence", "untestable"), ("correlation", "deviations")


def document(study: Study, claims: Sequence[Claim], pictures: Mapping[str, Picture | str]) -> Document:
    """The whole report."""
    drawn = {name: as_block(one) for name, one in pictures.items()}
    blocks: list[Block] = [*opening(study, claims), *claims]
    blocks += [Heading("Gap against distance"), drawn["gap_against_distance"], drawn["gap"]]
    blocks += [Heading("Success"), drawn["success"], cells(study), *other_levels(study)]
    blocks += [Heading("Learning"), drawn["curves"], *what_was_run(study.evidence)]
    if claims:
        head, rules = how_verdicts_are_decided(study.evidence, OWN_VERDICTS, OWN_MARGINS)
        holds = Paragraph("A claim **holds** where these rules say supported.")
        blocks += [head, holds, rules, Paragraph(TEXTS["given"])]
    return Document(str(study.asked["title"]), f"The study `{study.asked['name']}`", blocks, (TESTED,), WORDS)


def opening(study: Study, claims: Sequence[Claim]) -> Iterator[Block]:
    """What there is, what is missing, and the claims in sentences."""
    runs, sets = study.runs, len(set(keys(study.runs, ["panel", "seed"])))
    counts = {"runs": (len(runs), "run"), "panels": (len(study.panels), "panel"), "sets": (sets, "level set")}
    counts |= {"kinds": (len(study.agents), "kind")}
    yield from preliminary(study.evidence.all_results)
    yield Paragraph(TEXTS["opening"].format(**{name: counted(*one) for name, one in counts.items()}), "lead")
    yield from what_is_missing(study.evidence)
    yield from repeated(runs)
    yield Heading("Claims")
    if not claims:
        yield Paragraph("The study's file has no claims.")
        return
    sentences = []
    for claim in claims:
        verdict = WORDS.get(claim.verdict(TESTED), claim.verdict(TESTED)).capitalize()
        numbers = " ".join(estimate_text(one.found, one.measure) for one in claim.findings)
        sentences.append(f"**{claim.name}** {claim.statement} {verdict}. {numbers}")
    yield Bullets(sentences)


def repeated(runs: pd.DataFrame) -> Iterator[Block]:
    """Warnings of what means mix: agents on one level set, few level sets, several versions of the code."""
    most = max(len(part) for _, part in runs.groupby(["panel", "agent", "n", "seed"], dropna=False))
    if most > 1:
        yield Paragraph(TEXTS["several_agents"].format(most=most), "warning")
    if np.any(column(runs, "seed") != column(runs, LEVEL_SEED)):
        yield Paragraph(SAME_LEVELS, "warning")
    if "levels_shared" in runs:
        yield Paragraph(SHARED_LEVELS.format(column(runs, "levels_shared").max()), "warning")
    if "code" in runs and any(part["code"].nunique() > 1 for _, part in runs.groupby(["panel", "agent"], dropna=False)):
        yield Paragraph(TEXTS["several_versions"], "warning")
    fewest = min(count_of(part, "seed") for _, part in runs.groupby("panel", dropna=False))
    if fewest < FEWEST_BLOCKS:
        sets = counted(fewest, "level set")
        yield Paragraph(TEXTS["few_sets"].format(sets=sets, fewest=FEWEST_BLOCKS), "warning")


def cells(study: Study) -> Table:
    """A row for each panel, kind of agent and number of levels."""
    by = ["panel", "agent", "levels"]
    found = {name: means(study.evidence, study.runs, by, name) for name in (study.w2, "gap", *SUCCESS)}
    rows = []
    for at, row in enumerate(found["gap"].to_dict("records")):
        part = select(study.runs, **{name: row[name] for name in by})
        numbers = (float(column(found[name], "estimate")[at]) for name in (study.w2, *SUCCESS))
        rows.append([str(row["panel"]), str(row["agent"]), str(row["levels"]), str(len(part)), str(count_of(part, "seed")),
                     *map(plain, numbers), *effect(Estimate.of_row(row))])  # fmt: skip
    head = (
        *by[:2], "training levels", "runs", "level sets", "exact W2", "success, training", "success, test", "gap", "95 %",
    )  # fmt: skip
    caption = " ".join(filter(None, ["Means over runs; the gap with its interval over level sets.", study.about_w2]))
    return Table(head, rows, 2, caption, folded=len(rows) > 30)


def other_levels(study: Study) -> list[Block]:
    """What the agents achieve on other levels, beside their own test levels."""
    moved = study.evidence.results.moved
    if moved.empty:
        return []
    known = pick(study.runs, ["run", "agent", "seed"])
    there = paired(moved, study.runs, ETA, ["run"]).drop(columns=["seed"]).merge(known, on="run")
    there = there.assign(levels=there["n"])
    by = ["panel", "agent", "test", "levels"]
    found = means(study.evidence, there, by, "difference")
    shares = means(study.evidence, there, by, SUCCESS[1])
    rows = [
        [*(str(row[name]) for name in by), plain(float(share)), *effect(Estimate.of_row(row))]
        for row, share in zip(found.to_dict("records"), column(shares, "estimate"), strict=True)
    ]
    head = (*by[:3], "training levels", "success there", "return there less own test levels", "95 %")
    return [Heading("On other levels"), Table(head, rows, 3, "The same agents on levels of other distributions.")]
