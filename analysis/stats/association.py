"""Does one column of a table of runs go with another: pooled, within panels, given covariates, with and without outliers.

A *panel* is a (family, difficulty) in which runs differ by their number of levels and their seed only.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from segar.analysis.stats.correlation import correlate, indicators, residuals, without_outliers
from segar.analysis.tables import Floats, column
from segar.errors import SegarError, did_you_mean

PANEL = ("family", "difficulty")  # columns


def associations(table: pd.DataFrame, x: str, y: str) -> pd.DataFrame:
    """Every correlation of ``x`` and ``y`` that the questions about a gap ask for, one row each.

    ``test``      "pooled", "given panel", "given panel and log n", "given cell" (a panel and a number of levels: what is
                  left is that runs of one cell differ), and "within" for each panel by itself
    ``method``    "pearson" or "spearman"; partial where something is given
    ``outliers``  "kept"; "removed: points", |z| >= 3 in x or in y, as the paper has it; "removed: residuals", |z| >= 3
                  in what panels (and nothing else) leave of x or of y. ``removed`` counts them
    ``p_holm``    Holm's correction of ``p`` among the panels of the same method and outlier rule; nan for other tests

    and ``estimate``, ``low``, ``high`` (95 %), ``n`` (runs), ``p`` (two-sided), ``note`` (why there is no number).

    Args:
        table: one row per run, with its family, difficulty and n.

    Raises:
        SegarError: a column is missing, or a logarithm does not exist.
    """
    require(table, x, y, *PANEL, "n")
    names, words = keys(table, PANEL), labels(table, PANEL)
    whole = [column(table, name) for name in (x, y)]
    given = np.column_stack([np.ones(len(table)), indicators(names)])
    rules = {
        "kept": np.ones(len(table), np.bool_),
        "removed: points": without_outliers(*whole),
        "removed: residuals": without_outliers(*(residuals(one, given) for one in whole)),
    }
    rows: list[dict[str, Any]] = []
    for rule, keep in rules.items():
        part, part_names = table.loc[keep], names[keep]
        removed = int((~keep).sum())
        a, b = (one[keep] for one in whole)
        panels = indicators(part_names)
        tests = [("pooled", "", correlate(a, b)), ("given panel", "", correlate(a, b, panels))]
        both, cells = np.column_stack([panels, logarithms(part, "n")]), indicators(keys(part, [*PANEL, "n"]))
        tests += [("given panel and log n", "", correlate(a, b, both)), ("given cell", "", correlate(a, b, cells))]
        for name in np.unique(part_names):
            mine = part_names == name
            tests.append(("within", words[names == name][0], correlate(a[mine], b[mine])))
        for test, label, one in tests:
            for method, r in (("pearson", one.pearson), ("spearman", one.spearman)):
                rows.append(r.row(test=test, panel=label, method=method, outliers=rule, removed=removed))
    found = pd.DataFrame(rows)
    found["p_holm"] = np.nan
    within = found["test"] == "within"
    for _, group in found[within].groupby(["method", "outliers"], dropna=False):
        found.loc[group.index, "p_holm"] = holm(np.asarray(group["p"]))
    return found


def holm(p: Any) -> Floats:
    """Holm's step-down correction of p-values [n]; nan stays, and does not count as a test.

    As statsmodels' ``multipletests``, which collects garbage at each call and so takes 0.1 s.
    """
    p = np.asarray(p, np.float64)
    order = np.argsort(p)  # nan last
    stepped = np.maximum.accumulate(p[order] * (np.isfinite(p).sum() - np.arange(len(p))))
    out = np.empty_like(p)
    out[order] = np.minimum(stepped, 1.0)
    return out


def keys(table: pd.DataFrame, names: Sequence[str]) -> NDArray[np.int64]:
    """Which combination of the columns each row has, int64 [rows]: numbers from 0, in the order of the values as text.

    Raises:
        SegarError: a column has no value in some rows.
    """
    found = np.zeros(len(table), np.int64)
    for name in names:
        place, distinct = pd.factorize(table[name])
        if (place < 0).any():
            raise SegarError(
                f"{(place < 0).sum()} of {len(table)} rows have no {name}, which says what belongs together: give them one,"
                " or leave them out"
            )
        rank = np.argsort(np.argsort([str(value) for value in distinct], kind="stable"))
        found = np.unique(found * len(rank) + rank[place], return_inverse=True)[1]
    return found


def labels(table: pd.DataFrame, names: Sequence[str]) -> NDArray[Any]:
    """Words for the combination of columns in each row, e.g. ``empty-hard``; '' where there are no columns. Others may have
    the same ones: :func:`keys` tells them apart."""
    columns = [table[name].astype(str).to_numpy() for name in names]
    return np.array(
        ["-".join(parts) for parts in zip(*columns, strict=True)] if columns else [""] * len(table), dtype=str
    )


def logarithms(table: pd.DataFrame, name: str) -> Floats:
    """The logarithms of a column; raises :class:`SegarError` where there is none."""
    values = column(table, name)
    if not (values > 0).all():
        raise SegarError(f"a value of {name} has no logarithm")
    return np.log(values)


def require(table: pd.DataFrame, *names: str) -> None:
    """Raises :class:`SegarError` unless the table has each of these columns once."""
    known = [str(name) for name in table.columns]
    for name in names:
        if name not in known:
            raise SegarError(f"the table has no column '{name}'.{did_you_mean(name, known)}")
        if known.count(name) > 1:
            raise SegarError(f"the table has {known.count(name)} columns '{name}'; leave one, or rename them")
