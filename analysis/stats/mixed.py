"""The primary analysis: a linear mixed model of the gap, with effects of panels and seeds that cross."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy import optimize, stats

from segar.analysis.stats.association import keys, logarithms, require
from segar.analysis.stats.correlation import EXPLAINED, why_not
from segar.analysis.stats.estimate import Estimate, student_p
from segar.analysis.tables import Floats, column
from segar.errors import SegarError

AT_BOUND = 1e-6  # a variance below this part of the residual's is at its bound
STEP = 0.01  # of the logarithms of variances, for derivatives
STARTS = (0.1, 1.0, 10.0)  # of the search: standard deviations of effects, as parts of the residual's


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
    """``y ~ x + (1 | each of random)`` by restricted maximum likelihood, random effects crossed.

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
    if stray := [name for name in log if name not in x]:
        raise SegarError(f"log: '{stray[0]}' is not among x, {', '.join(x)}")
    columns = [column(table, y), *(logarithms(table, name) if name in log else column(table, name) for name in x)]
    for name, values in zip([y, *x], columns, strict=True):
        if why_not(values):
            raise SegarError(f"'{name}' has missing values, or does not vary; leave it out or drop those runs")
    data = np.column_stack(columns)
    if standardise:
        data /= data.std(axis=0, ddof=1)
    places = [keys(table, names) for names in groupings]
    sizes = [int(place.max()) + 1 for place in places]
    basis, triangle = np.linalg.qr(np.column_stack([np.ones(len(data)), data[:, 1:]]))
    if min(sizes) < 2 or (abs(np.diag(triangle)) <= EXPLAINED * np.linalg.norm(triangle, axis=0)).any():
        raise SegarError("the model is singular: an effect has one group, or terms say the same")
    line = basis.T @ data[:, 0]
    members = [np.eye(n)[place] for n, place in zip(sizes, places, strict=True)]
    read = np.column_stack([*members, basis, data[:, 0] - basis @ line])
    products, freedom = read.T @ read, len(data) - len(triangle)
    ratios = most_likely(products, sizes, freedom)
    _, slopes, covariance, residual = fit(ratios, products, sizes, freedom)
    back = np.linalg.inv(triangle)
    note = "an effect's variance is at its bound, 0" if (ratios < AT_BOUND).any() else ""
    errors = np.sqrt(np.diag(back @ (covariance + of_variances(ratios, products, sizes, freedom)) @ back.T))
    terms = ["intercept", *(f"log {name}" if name in log else name for name in x)]
    rows = []
    for term, slope, error in zip(terms, (back @ (line + slopes)).tolist(), errors.tolist(), strict=True):
        half = float(stats.norm.ppf(0.975)) * error
        one = Estimate.between(slope, slope - half, slope + half, len(data), student_p(slope, error, np.inf, 2))
        rows.append({**one.row(term=term), "note": one.note or note})
    variances = np.append(ratios, 1.0) * residual
    shares = pd.DataFrame({"effect": [*map(" x ".join, groupings), "residual"], "groups": [*sizes, len(data)]})
    shares = shares.assign(variance=variances, share=variances / variances.sum())
    return MixedModel(pd.DataFrame(rows), shares, note)


def most_likely(products: Floats, sizes: Sequence[int], freedom: int) -> Floats:
    """The variances of effects, as parts of the residual's, of the largest restricted likelihood."""
    # Without derivatives: where a variance is at its bound, methods with a gradient end early, far from the largest value.
    options = {"xatol": 1e-7, "fatol": 1e-10, "maxiter": 10_000, "maxfev": 10_000}

    def unlikely(roots: Floats) -> float:
        return fit(np.square(roots), products, sizes, freedom)[0]

    starts = [np.full(len(sizes), start) for start in STARTS]
    found = [optimize.minimize(unlikely, start, method="Nelder-Mead", options=options) for start in starts]
    return np.square(min(found, key=lambda one: one.fun).x)


def of_variances(ratios: Floats, products: Floats, sizes: Sequence[int], freedom: int) -> Floats:
    """What the covariance of slopes gains as variances are estimates, too (Kackar and Harville 1984); those at their bound
    count as known."""
    steps = STEP * np.diag(ratios >= AT_BOUND)

    def moved(step: Floats) -> tuple[float, np.ndarray]:
        return fit(ratios * np.exp(step), products, sizes, freedom)[:2]

    turns = np.array([moved(one)[1] - moved(-one)[1] for one in steps]) / (2 * STEP)
    bends = [[moved(a + b)[0] - moved(a - b)[0] - moved(b - a)[0] + moved(-a - b)[0] for b in steps] for a in steps]
    # Half of what bends is the log likelihood, the inverse of whose curvature is the covariance of the logarithms.
    return turns.T @ np.linalg.pinv(np.array(bends) / (8 * STEP**2)) @ turns


def fit(
    ratios: Floats, products: Floats, sizes: Sequence[int], freedom: int
) -> tuple[float, np.ndarray, np.ndarray, float]:
    """Minus twice the restricted log likelihood but for a constant, the slopes, their covariance, and the residual variance.

    Args:
        ratios: variances of the effects, as parts of the residual's.
        products: of all pairs of columns: an indicator for each group of each effect, the design, and the target.
        sizes: groups of each effect.
    """
    root = np.sqrt(np.repeat(ratios, sizes))
    groups = len(root)
    inner = np.eye(groups) + root[:, None] * products[:groups, :groups] * root
    across = root[:, None] * products[:groups, groups:]
    rest = products[groups:, groups:] - across.T @ np.linalg.solve(inner, across)
    information, towards = rest[:-1, :-1], rest[:-1, -1]
    slopes = np.linalg.solve(information, towards)
    residual = max(float(rest[-1, -1] - towards @ slopes) / freedom, np.finfo(float).tiny)
    volumes = np.linalg.slogdet(inner)[1] + np.linalg.slogdet(information)[1]
    return volumes + freedom * np.log(residual), slopes, np.linalg.inv(information) * residual, residual
