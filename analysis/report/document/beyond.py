"""What goes beyond the paper: each experiment with its figure and tables, or a sentence that says that it was not run."""

from collections.abc import Callable, Sequence

import pandas as pd

from segar.analysis.plotting.names import word_for
from segar.analysis.report.captions import TABLES, TEXTS
from segar.analysis.report.claims.claim import METRIC_OURS
from segar.analysis.report.claims.evidence import Evidence
from segar.analysis.report.claims.prediction import matched_predictions
from segar.analysis.report.claims.scores import CELLS, COMPARED, IMPROVEMENT, IQM, REGRET, SUCCESS, comparison, scored
from segar.analysis.report.claims.statements import stated
from segar.analysis.report.claims.tests import SAME, differences
from segar.analysis.report.document.blocks import Block, Bullets, Heading, Paragraph, Table
from segar.analysis.report.document.tables import frames_of, means, means_table, row_of
from segar.analysis.report.number_format import NONE, effect, estimate_text, listed, p_value, plain
from segar.analysis.report.results import shifts_in_words
from segar.analysis.stats.estimate import Estimate
from segar.analysis.tables import count_of, select

CONTRASTS = ("gap in success", "n", "family", "difference", "95 %", "p", "pairs")  # columns of contrasts
Drawer = Callable[[str], list[Block]]


def blocks(evidence: Evidence, drawn: Drawer, boxes: Callable[..., list[Block]]) -> list[Block]:
    """All experiments beyond the paper, in the order of the report, with the ``boxes`` of the claims about them."""
    parts: list[Block] = [Heading("Beyond the paper")]
    for title, figure, tables_of in EXPERIMENTS:
        parts += [Heading(title, 3), *drawn(figure), *(tables_of(evidence) if tables_of else ())]
        parts += boxes(*CLAIMS.get(figure, ()))
    return parts


def compared(evidence: Evidence) -> list[Block]:
    """Normalised scores of the algorithms of each experiment that compares some, or why there are none."""
    results = evidence.all_results
    said = [f"{title}: {runs_compared(evidence, experiment)}." for experiment, title in COMPARED.items()]
    table = comparison(results)
    if table.empty:
        return [Bullets(said)]
    rows = []
    for experiment, algorithm in dict.fromkeys(zip(table["experiment"], table["algorithm"], strict=True)):
        part = select(table, experiment=experiment, algorithm=algorithm)
        iqm, success, regret, improvement = (row_of(part, measure=one) for one in (IQM, SUCCESS, REGRET, IMPROVEMENT))
        rows.append([
            COMPARED[experiment], word_for(algorithm), f"{iqm.n}",
            *(text for one in (iqm, success, regret, improvement) for text in effect(one, plain)),
            p_value(improvement.p),
        ])  # fmt: skip
    head = ("experiment", "algorithm", "runs", "IQM of scores", "95 %", "success", "95 %", "regret", "95 %",
            "P(score above PPO's)", "95 %", "p")  # fmt: skip
    return [Bullets(said), Table(head, rows, 2, TABLES["scores"])]


def runs_compared(evidence: Evidence, experiment: str) -> str:
    """How many runs of each algorithm are compared, and how many are left out; or why there are none."""
    runs = scored(evidence.all_results, experiment)
    if isinstance(runs, str):
        return runs
    algorithms, seeds, cells = (len(runs.groupby(list(by), dropna=False)) for by in (("algorithm",), ("seed",), CELLS))
    text = f"{algorithms} algorithms with {len(runs) // algorithms} runs each, of {seeds} seeds in {cells} cells"
    lost = len(evidence.all_results.of(experiment)) - len(runs)
    return text + (f"; {lost} runs of seeds that lack others are left out" if lost else "")


def matched(evidence: Evidence) -> list[Block]:
    """The mean gap of each kind of matched set, and how well each measure predicts the gap of sets that it did not see."""
    runs = evidence.results.of("matched_sets")
    if count_of(runs, "design") < 2:
        return []
    named = runs.assign(sets=[word_for(one) for one in runs["design"]])
    parts = [means_table(means(evidence, named, ["sets"], "gap_success"), {"sets": "training sets"}, "gap in success",
                         TABLES["gap"])]  # fmt: skip
    return [*parts, contrasts(evidence, runs), predictions(evidence, runs)]


def contrasts(evidence: Evidence, runs: pd.DataFrame) -> Table:
    """What matched-w2 and matched-coverage compare, in each family and at each n by itself."""
    rows = []
    compared = {"matched-w2": "farther less not farther in W2", "matched-coverage": "worse less not worse coverage"}
    for claim, words in compared.items():
        (test,) = stated(claim, METRIC_OURS, runs)
        for n, part in differences(runs, test.of, test.between, test.same).groupby("n", sort=True, dropna=False):
            of_family = {word_for(name): select(part, family=name) for name in dict.fromkeys(part["family"])}
            for place, some in {"all": part, **of_family}.items():
                found = evidence.mean(some)
                rows.append([words, f"{n}", place, *effect(found), p_value(found.p), f"{found.n:.0f}"])
    return Table(CONTRASTS, rows, 3, TABLES["contrasts"])


def predictions(evidence: Evidence, runs: pd.DataFrame) -> Table:
    """R² out of sample of the gap in success, from family, n and each measure of the training set."""
    found, value = matched_predictions(evidence, runs), "R² out of sample, beyond family and n"
    return means_table(found, {"measure": "measure"}, value, TABLES["prediction"], plain)


def physics(evidence: Evidence) -> list[Block]:
    """The loss in return in each physics of the test levels."""
    return shifts(evidence, evidence.results.other_physics, "test_variation")


def looks(evidence: Evidence) -> list[Block]:
    """The loss in return with each kind of textures, and on harder levels."""
    return shifts(evidence, evidence.results.other_looks, "shift")


def shifts(evidence: Evidence, part: pd.DataFrame, tested: str) -> list[Block]:
    """The mean ``difference`` for each of what agents were ``trained`` in and ``tested`` in, a column for each of their numbers
    of training levels."""
    if part.empty:
        return []
    named = shifts_in_words(part, tested)
    found = means(evidence, named.assign(levels=named["n"]), ["trained", tested, "levels"], "difference")
    counts = sorted({*found["levels"]})
    rows = []
    for (trained, there), some in found.groupby(["trained", tested], sort=True, dropna=False):  # type: ignore[misc]
        of_n = {row["levels"]: effect(Estimate.of_row(row)) for row in some.to_dict("records")}
        cells = (" ".join(text for text in of_n.get(n, ()) if text != NONE) or NONE for n in counts)
        rows.append([str(trained), str(there), *cells, listed(some["n"])])
    head = ("trained in", "tested in", *(f"n = {n}" for n in counts), "runs each")
    return [Table(head, rows, 2, TABLES["shift"])]


def attributed(evidence: Evidence) -> list[Block]:
    """Each group's part of the gap, per family and number of levels."""
    table = evidence.attribution
    if table.empty:
        return []
    shown = table.assign(levels=table["n"].astype(str))
    shown = shown.assign(family=shown["family"].map(word_for), group=shown["group"].map(word_for))
    found = means(evidence, shown, ["family", "levels", "group"], "part")
    head = {"family": "family", "levels": "training levels", "group": "factors"}
    return [means_table(found, head, "part", TABLES["attribution"])]


def true_factors(evidence: Evidence) -> list[Block]:
    """The success of agents that see factors less that of agents that see pixels."""
    seen, main = evidence.all_results.of("upper_bound"), evidence.ungated.main
    if seen.empty or main.empty:
        return []
    both = pd.concat([main.assign(sees="pixels"), seen.assign(sees="factors")], ignore_index=True)
    pairs = differences(both, "success_test_deterministic", {"sees": ("factors", "pixels")}, SAME)
    if pairs.empty:
        return []
    difference = estimate_text(evidence.mean(pairs), "")
    return [
        Paragraph(TEXTS["true_factors"].format(difference=difference, frames=frames_of(seen), pixels=frames_of(main)))
    ]


# The claims about what a figure shows.
CLAIMS = {"rule_sets": ("rule-sets", "rule-sets-unseen", "rule-set-distance"), "trials": ("memory",)}
# Title, figure, and tables if any.
EXPERIMENTS: Sequence[tuple[str, str, Callable[[Evidence], list[Block]] | None]] = (
    ("Diversity of the training set", "diversity", None),
    ("Other physics", "rules", physics),
    ("Unseen rule sets", "rule_sets", None),
    ("A memory over trials", "trials", None),
    ("Other textures", "visual", looks),
    ("Hardness by reward", "hardness", None),
    ("Agents that see the factors", "upper_bound", true_factors),
    ("W2 without training", "w2_study", None),
    ("Which factors make the gap", "attribution", attributed),
)
