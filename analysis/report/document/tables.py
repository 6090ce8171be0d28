"""The tables of statistics: as CSV files with all digits that mean something, and as the report prints them.

Of an experiment beyond the paper that was not run there are none.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pandas as pd

from segar.analysis.plotting.names import panel_name, word_for
from segar.analysis.report.captions import TABLES, TEXTS
from segar.analysis.report.claims.claim import METRIC_OURS
from segar.analysis.report.claims.evidence import BLOCKS, DISTANCES, GAPS, PERMUTATION, Evidence
from segar.analysis.report.claims.prediction import matched_predictions
from segar.analysis.report.claims.scores import CELLS, COMPARED, IMPROVEMENT, IQM, REGRET, SUCCESS, comparison, scored
from segar.analysis.report.claims.specifications import specifications
from segar.analysis.report.claims.statements import stated
from segar.analysis.report.claims.tests import SAME, differences
from segar.analysis.report.document.blocks import Block, Bullets, Paragraph, Table
from segar.analysis.report.number_format import NONE, effect, effect_of_r, estimate_text, listed, p_value, plain, signed
from segar.analysis.report.results import PANEL, panels_of, shifts_in_words
from segar.analysis.report.rules import GATE_MARGIN
from segar.analysis.stats.estimate import Estimate
from segar.analysis.tables import column, count_of, mean_by, pick, select

CONTRASTS = ("gap in success", "n", "family", "difference", "95 %", "p", "pairs")  # columns of contrasts
LEARNED_FROM = "success_train_deterministic"  # what the gate looks at
CELL_COLUMNS = (
    "w2_reference", "w2_exact", "eta_train_deterministic", "eta_test_deterministic", "gap", "gap_se", "gap_2022",
    "success_train_deterministic", "success_test_deterministic", "death_test_deterministic",
)  # fmt: skip


STATISTICS = ("predictions", "scores", "associations", "resampled", "mixed_models", "explained", "predictors", "specifications",
              "cells")  # fmt: skip
"""The names of all tables of :func:`statistics`."""


def statistics(evidence: Evidence) -> dict[str, pd.DataFrame]:
    """All tables of statistics, by the name of their CSV file."""
    if evidence.results.main.empty:
        return {}
    matched = evidence.results.of("matched_sets")
    compared = comparison(evidence.all_results)
    return {
        **({"predictions": matched_predictions(evidence, matched)} if count_of(matched, "design") > 1 else {}),
        **({"scores": compared} if len(compared) else {}),
        "associations": evidence.associations,
        "resampled": evidence.resampled,
        "mixed_models": evidence.mixed,
        "explained": evidence.explained,
        "predictors": evidence.predictors,
        "specifications": specifications(evidence),
        "cells": cells(evidence.all_results.main),
    }


def cells(main: pd.DataFrame) -> pd.DataFrame:
    """One row per family, difficulty and n: means over seeds."""
    shown = [name for name in CELL_COLUMNS if name in main]
    seeds = main.groupby([*PANEL, "n"], sort=True, dropna=False).size()
    return mean_by(main, [*PANEL, "n"], shown).assign(seeds=np.asarray(seeds))


def frames_of(table: pd.DataFrame) -> str:
    """Numbers of frames, with commas."""
    return ", ".join(f"{n:,}" for n in sorted(set(table["frames"])))


def main_table(evidence: Evidence) -> Table:
    """Pooled and partial correlations, with the interval of blocks and the p of a permutation."""
    by = ["w2", "gap", "test"]
    permuted = pick(select(evidence.resampled, way=PERMUTATION), [*by, "p"]).rename(columns={"p": "permuted"})
    found = select(evidence.resampled, way=BLOCKS).merge(permuted, on=by, how="left", validate="1:1")
    rows = [
        [r["test"], DISTANCES[r["w2"]], GAPS[r["gap"]], *effect_of_r(Estimate.of_row(r)), p_value(r["p"]),
         p_value(r["permuted"]), f"{r['n']:.0f}"]
        for r in found.to_dict("records")
    ]  # fmt: skip
    head = ("test", "distance", "returns", "r", "95 %", "p", "p, permuted", "runs")
    return Table(head, rows, 3, TABLES["main"])


def mixed_table(evidence: Evidence) -> Table:
    """Slopes of the mixed models."""
    words = [one if one == "log n" else "W2" for one in evidence.mixed["term"]]
    found = evidence.mixed.replace({"w2": DISTANCES, "gap": GAPS}).assign(term=words)
    head = {"w2": "distance", "gap": "returns", "model": "model", "note": "note", "term": "term"}
    return means_table(found, head, "slope", TABLES["mixed"])


def gate_table(evidence: Evidence) -> Table:
    """How many runs of each panel learned, and what idle and random play reach there."""
    everything = evidence.all_results.main
    idle, chance = (evidence.all_results.player(name, "success") for name in ("idle", "random"))
    counted = Counter(evidence.results.main["panel"])
    rows = [
        [panel_name(panel), f"{counted[panel]}", f"{len(part)}", plain(float(column(part, LEARNED_FROM).mean())),
         plain(idle.get(panel, np.nan)), plain(chance.get(panel, np.nan))]
        for panel in panels_of(everything)
        for part in (select(everything, panel=panel),)
    ]  # fmt: skip
    head = ("panel", "runs that learned", "runs", "success on training levels", "idle play", "random play")
    return Table(head, rows, 1, TABLES["gate"].format(margin=GATE_MARGIN))


def means(evidence: Evidence, table: pd.DataFrame, group: Sequence[str], value: str) -> pd.DataFrame:
    """Mean of a column per group, with the interval of blocks."""
    rows = []
    for key, part in table.groupby(list(group), sort=True, dropna=False):
        found = evidence.mean(part, value)
        rows.append(found.row(**dict(zip(group, key if isinstance(key, tuple) else (key,), strict=True))))
    return pd.DataFrame(rows)


def means_table(
    found: pd.DataFrame, group: Mapping[str, str], value: str, caption: str, show: Callable[[float, int], str] = signed
) -> Table:
    """The result of :func:`means`, as printed."""
    rows = [
        [*(str(r[name]) for name in group), *effect(Estimate.of_row(r), show), f"{r['n']:.0f}"]
        for r in found.to_dict("records")
    ]
    return Table((*group.values(), value, "95 %", "runs"), rows, len(group), caption)


def row_of(table: pd.DataFrame, **equal: str) -> Estimate:
    """The estimate in the row that has these values; NaN where there is none."""
    rows = select(table, **equal)
    return Estimate.missing(0, "") if rows.empty else Estimate.of_row(rows.iloc[0].to_dict())


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
    gaps, predicted = means(evidence, named, ["sets"], "gap_success"), matched_predictions(evidence, runs)
    value = "R² out of sample, beyond family and n"
    return [
        means_table(gaps, {"sets": "training sets"}, "gap in success", TABLES["gap"]),
        contrasts(evidence, runs),
        means_table(predicted, {"measure": "measure"}, value, TABLES["prediction"], plain),
    ]


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
    seen, main = evidence.all_results.of("upper_bound"), evidence.all_results.main
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
