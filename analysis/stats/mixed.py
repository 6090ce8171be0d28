"""The primary analysis: a linear mixed model of the gap, with effects of panels and seeds that cross."""

import dataclasses
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import statsmodels.formula.api as smf
from statsmodels.tools.sm_exceptions import ConvergenceWarning

from segar.analysis.stats.association import keys, logarithms, require
from segar.analysis.stats.correlation import why_not
from segar.analysis.stats.estimate import Estimate
from segar.analysis.tables import column
from segar.errors import SegarError


@dataclass(frozen=True)
class MixedModel:
    """What a mixed model found.

    ``fixed``: one row per term, ``term``, ``estimate``, ``low``, ``high``, ``n`` (runs), ``p`` (Wald's, two-sided),
    ``level``, ``note``. ``random``: one row per effect, ``effect``, ``groups``, ``variance``, ``share`` of the variance
    that the fixed terms leave; the last is "residual".
    """

    fixed: pd.DataFrame
    random: pd.DataFrame
    note: str

    def term(self, name: str) -> Estimate:
        """One fixed term; raises :class:`SegarError` if there is none of that name."""
        rows = self.fixed[self.fixed["term"] == name]
        if rows.empty:
            raise SegarError(f"the model has no term '{name}'; it has {', '.join(self.fixed['term'])}")
        return Estimate.of_row(rows.iloc[0].to_dict())


def mixed_model(
    table: pd.DataFrame,
    y: str,
    x: Sequence[str],
    random: Sequence[str | Sequence[str]] = (("family", "difficulty"), "seed"),
    *,
    log: Sequence[str] = (),
    standardise: bool = False,
) -> MixedModel:
    """``y ~ x + (1 | each of random)`` by restricted maximum likelihood (statsmodels), random effects crossed.

    With few panels Wald's intervals are somewhat too short; :func:`segar.analysis.stats.resampling.cluster_jackknife` of the
    slope is the check.

    Args:
        x: columns with fixed effects.
        random: columns, or combinations of columns, each with a random intercept.
        log: those of ``x`` that enter by their logarithm, as ``log n``.
        standardise: divide y and x by their standard deviations, so that slopes compare.

    Raises:
        SegarError: a column is missing, something does not vary, or there are too few runs.
    """
    groupings = [(one,) if isinstance(one, str) else tuple(one) for one in random]
    require(table, y, *x, *(name for names in groupings for name in names))
    if len(table) < len(x) + 3:
        raise SegarError(f"{len(table)} runs are too few for a model with {len(x)} terms")
    data, terms = model_table(table, y, x, log, standardise)
    parts, effects = {}, []
    for k, names in enumerate(groupings):
        data[f"g{k}"] = pd.Categorical(keys(table, names))
        effects.append((" x ".join(names), len(set(data[f"g{k}"]))))
        parts[f"g{k}"] = f"0 + C(g{k})"
    formula = "y ~ " + " + ".join(f"x{k}" for k in range(len(terms)))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        model = smf.mixedlm(formula, data, groups=np.ones(len(data)), vc_formula=parts, re_formula="0")
        try:
            found: Any = model.fit(reml=True)
        except np.linalg.LinAlgError as error:
            raise SegarError("the model is singular: an effect has one group, or terms say the same") from error
    serious = [str(one.message) for one in caught if issubclass(one.category, ConvergenceWarning)]
    note = "an effect's variance is at its bound, 0" if any("boundary" in text for text in serious) else ""
    names = {"Intercept": "intercept", **{f"x{k}": term for k, term in enumerate(terms)}}
    interval: Any = found.conf_int()
    rows = []
    for key, name in names.items():
        low, high = (float(end) for end in interval.loc[key])
        slope, p = float(found.fe_params[key]), float(found.pvalues[key])
        one = Estimate.between(slope, low, high, len(data), p)
        rows.append(dataclasses.replace(one, note=one.note or note).row(term=name))
    variances = np.append(np.asarray(found.vcomp, np.float64), float(found.scale))
    effects.append(("residual", len(data)))
    shares = pd.DataFrame(effects, columns=["effect", "groups"])
    shares = shares.assign(variance=variances, share=variances / variances.sum())
    return MixedModel(pd.DataFrame(rows), shares, note)


def model_table(
    table: pd.DataFrame, y: str, x: Sequence[str], log: Sequence[str], standardise: bool
) -> tuple[pd.DataFrame, list[str]]:
    """Columns ``y``, ``x0``, ``x1`` ... as the model reads them, and the names of the terms."""
    stray = [name for name in log if name not in x]
    if stray:
        raise SegarError(f"log: '{stray[0]}' is not among x, {', '.join(x)}")
    data = {"y": column(table, y)}
    for k, name in enumerate(x):
        data[f"x{k}"] = logarithms(table, name) if name in log else column(table, name)
    terms = [f"log {name}" if name in log else name for name in x]
    for key, values in data.items():
        if why_not(values):
            name = y if key == "y" else x[int(key[1:])]
            raise SegarError(f"'{name}' has missing values, or does not vary; leave it out or drop those runs")
        if standardise:
            data[key] = values / values.std(ddof=1)
    return pd.DataFrame(data), terms
