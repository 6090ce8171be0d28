"""The report as a page of Markdown: what was run, what came out, what is missing, what to beware of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import pandas as pd

from analysis.gap import Found, correlation_rows, line_in_words
from analysis.stats.correlation import NotAvailable
from analysis.words import number, signed

CORRELATION_HEAD = ("gap against", "runs", "Pearson r", "95 %", "p", "Spearman ρ", "95 %", "p")
CELL_COLUMNS = {
    "n": "{:.0f}",
    "eta_train": "{:.2f}",
    "eta_test": "{:.2f}",
    "gap": "{:+.2f}",
    "gap_se": "{:.2f}",
    "success_train": "{:.2f}",
    "success_test": "{:.2f}",
    "death_test": "{:.2f}",
}
BEWARE = """\
- The runs are not independent: training sets of one seed are nested in n, and all seeds share the test levels of a
  panel. P-values that assume independence, as these do, are too small.
- W2 varies with the panel and with n; see the R² of log W2. Only what is left given panel and log n is about W2
  itself.
- Correlations of single panels are not corrected for their number.
- Standard errors count the test levels as a sample; the training levels are no sample, for all of them were played.
"""


def page(table: pd.DataFrame, statistics: dict[str, Any], headline: str, by_family: str) -> str:
    """The whole page; ``table`` has one row per run, ``headline`` and ``by_family`` are the figures' names."""
    parts = ["# Generalization gap against Wasserstein-2", runs_in_words(table, statistics)]
    if statistics["missing"]:
        parts += ["## Missing", missing_list(statistics)]
    parts += [f"![gap against W2]({headline}.png)"]
    for mode, found in statistics["w2"].items():
        parts += [f"## {mode} W2", correlation_table(correlation_rows(found)), f"- {line_in_words(found['line'])}"]
        parts += [f"- R² of log W2 on {explained_in_words(found['log_w2_explained_by'])}"]
    rival = statistics["log_n"]
    rows = [("log n, pooled", rival["pooled"]), ("log n, within panels", rival["within_panel"])]
    parts += ["## The number of training levels instead of W2", correlation_table(rows)]
    parts += [f"![by family and difficulty]({by_family}.png)", "## Cells", cell_table(table), "## Beware", BEWARE]
    return "\n\n".join(part.strip() for part in parts) + "\n"


def runs_in_words(table: pd.DataFrame, statistics: dict[str, Any]) -> str:
    """What was run."""
    seeds = ", ".join(str(seed) for seed in sorted(set(table["seed"])))
    text = (
        f"{statistics['runs']} of {statistics['runs_expected']} runs: {listed(table['algorithm'])} on "
        f"{listed(table['observation'])}, {', '.join(f'{n:,}' for n in sorted(set(table['frames'])))} frames, "
        f"seed {seeds}; {statistics['action_mode']} actions. Gap is the mean return on test levels minus that on "
        "training levels; negative means worse on test."
    )
    if len(statistics["code"]) > 1:
        text += f"\n\n**The runs were made by {len(statistics['code'])} versions of the code** (column `code`)."
    if statistics["unreadable"]:
        names = ", ".join(f"`{name}`" for name in statistics["unreadable"])
        text += f"\n\n**Folders that cannot be read, and are not counted:** {names}."
    return text


def missing_list(statistics: dict[str, Any]) -> str:
    """One line per run that should be there."""
    return "\n".join(f"- {one['cell']}: {one['reason']}" for one in statistics["missing"])


def correlation_table(rows: Iterable[tuple[str, Found]]) -> str:
    """A Markdown table; what is not available says why."""
    cells = []
    for name, found in rows:
        if isinstance(found, NotAvailable):
            cells.append((name, "", f"not available: {found.reason}", "", "", "", "", ""))
            continue
        pearson = (signed(found.pearson), interval(found.pearson_low, found.pearson_high), number(found.pearson_p))
        spearman = (
            signed(found.spearman),
            interval(found.spearman_low, found.spearman_high),
            number(found.spearman_p),
        )
        cells.append((name, str(found.points), *pearson, *spearman))
    return markdown(CORRELATION_HEAD, cells)


def cell_table(table: pd.DataFrame) -> str:
    """A Markdown table with one row per cell, the mean over seeds."""
    distances = [name for name in table if str(name).startswith("w2_")]
    columns = {**CELL_COLUMNS, **dict.fromkeys(distances, "{:.3f}")}
    averaged = [name for name in columns if name != "n"]
    means = table.pivot_table(index=["family", "difficulty", "n"], values=averaged, aggfunc="mean").reset_index()
    rows = [
        (row["family"], row["difficulty"], *(shape.format(row[name]) for name, shape in columns.items()))
        for row in means.to_dict("records")
    ]
    return markdown(("family", "difficulty", *columns), rows)


def explained_in_words(found: Any) -> str:
    """R² on panel, log n and both."""
    if isinstance(found, NotAvailable):
        return f"panel and log n: not available, {found.reason}"
    names = {"panel": "panel", "log_n": "log n", "both": "both"}
    parts = [
        f"{names[key]}: " + (f"not available ({value.reason})" if isinstance(value, NotAvailable) else f"{value:.2f}")
        for key, value in found.items()
    ]
    return "; on ".join(parts)


def interval(low: float | None, high: float | None) -> str:
    """``−0.71 to −0.30``, or a dash."""
    return "–" if low is None or high is None else f"{signed(low)} to {signed(high)}"


def listed(values: Iterable[str]) -> str:
    """Different values, in order, with commas."""
    return ", ".join(sorted(set(values)))


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
