"""Which methods are better, and whether other seeds and other suites would say so: places as sets, variance components."""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats
from statsmodels.formula.api import ols
from statsmodels.stats.anova import anova_lm

from segar.analysis.stats.association import holm, keys, require
from segar.analysis.stats.correlation import why_not
from segar.analysis.stats.estimate import ROUNDING, Estimate, difference, mean_of_replicates
from segar.analysis.tables import Floats, column

FEWEST_SEEDS = 5  # that a row needs for a place
ALPHA = 0.05
REPETITIONS = 4000  # of planted tables of all runs
PLANTED = 200_000  # repetitions of planted means, of which 4000 leave the suites that are needed unknown by a tenth
MOST_SUITES = 100  # of which it is asked whether they are enough


def places(values: pd.DataFrame) -> dict[Any, tuple[int, int]]:
    """The first and the last place that each row may have: rows that no test separates share them.

    Two rows are separated by Student's paired test over the seeds that they share, at 5 % after Holm's correction for all
    pairs.

    Args:
        values: one number per seed (lines) and row (columns), NaN where there is none. Rows with fewer than
            :data:`FEWEST_SEEDS` have no place.
    """
    names = [name for name in values.columns if len(values[name].dropna()) >= FEWEST_SEEDS]
    pairs = list(combinations(names, 2))
    apart = [difference(values[a], values[b]) for a, b in pairs]
    found = [mean_of_replicates(one[~np.isnan(one)], 0.0, 2) for one in apart]
    p = holm([one.p if one.n >= FEWEST_SEEDS else np.nan for one in found])
    above, below = dict.fromkeys(names, 0), dict.fromkeys(names, 0)
    for (a, b), one, corrected in zip(pairs, found, p, strict=True):
        if corrected < ALPHA:
            better, worse = (a, b) if one.estimate > 0 else (b, a)
            above[worse] += 1
            below[better] += 1
    return {name: (1 + above[name], len(names) - below[name]) for name in names}


@dataclass(frozen=True)
class Generalizability:
    """How much of what differs between numbers is due to methods, and whether it would be seen again.

    Attributes:
        components: variances of ``method``, ``suite``, ``method and suite``, ``training levels`` (the seed within a suite,
            which methods share) and ``run``, the rest. None is below 0.
        coefficient: the share of ``method`` in the variance of the methods' means over these suites and seeds, with the exact
            interval of the ratio of mean squares (Feldt 1965), where suites and seeds are drawn at random.
        methods, suites, seeds: how many there are.
    """

    components: Mapping[str, float]
    coefficient: Estimate
    methods: int
    suites: int
    seeds: int

    def names_winner(self, suites: int, seeds: int) -> float:
        """How often the method with the highest mean on so many suites and seeds is the best one, in planted tables with these
        components and as many methods."""
        own = self.components
        noise = (own["method and suite"] + own["run"] / seeds) / suites
        rng = np.random.default_rng(0)
        true, error = rng.normal(size=(2, PLANTED, self.methods))
        true *= own["method"] ** 0.5
        return float(((true + error * noise**0.5).argmax(axis=1) == true.argmax(axis=1)).mean())

    def suites_needed(self, seeds: int, share: float = 0.9) -> int | None:
        """How many suites name the winner in this share of repetitions; None where :data:`MOST_SUITES` do not."""
        if not self.components["method"]:
            return None
        needed = 1 + bisect_left(range(1, MOST_SUITES + 1), share, key=lambda n: self.names_winner(n, seeds))
        return needed if needed <= MOST_SUITES else None


def generalizability(table: pd.DataFrame, value: str, method: str, suite: str, seed: str) -> Generalizability | None:
    """The variance components of a table with one line for each method, suite and seed, by the mean squares of its analysis of
    variance; None where there are not two of each, some have no line or no number, or all values are one. Raises
    :class:`SegarError` where a line has no method, suite or seed, or a value is no number.

    What rounding leaves of a component is 0, and so is the coefficient of methods that do not differ.
    """
    require(table, value, method, suite, seed)
    methods, suites, seeds = (len(set(keys(table, [one]))) for one in (method, suite, seed))
    has_all = len(set(keys(table, [method, suite, seed]))) == len(table) == methods * suites * seeds
    if min(methods, suites, seeds) < 2 or not has_all or why_not(y := column(table, value)):
        return None
    data = pd.DataFrame({"y": y, "m": keys(table, [method]), "s": keys(table, [suite]), "k": keys(table, [seed])})
    squares = anova_lm(ols("y ~ C(m) * C(s) + C(s):C(k)", data).fit())
    squares.loc[squares["sum_sq"] <= ROUNDING * (data["y"] ** 2).sum(), "sum_sq"] = 0.0
    of = (squares["sum_sq"] / squares["df"]).to_dict()
    m, s, ms, k, e = (float(of[name]) for name in ("C(m)", "C(s)", "C(m):C(s)", "C(s):C(k)", "Residual"))
    components = {
        "method": (m - ms) / (suites * seeds),
        "suite": (s - ms - k + e) / (methods * seeds),
        "method and suite": (ms - e) / seeds,
        "training levels": (k - e) / methods,
        "run": e,
    }
    freedom = squares["df"]["C(m)"], squares["df"]["C(m):C(s)"]
    ratios = (1.0, *stats.f.ppf((0.975, 0.025), *freedom))
    value_, low, high = (max(1 - float(one) * (ms / m if m else np.inf), 0.0) for one in ratios)
    coefficient = Estimate.between(value_, low, high, methods)
    return Generalizability(
        {name: max(one, 0.0) for name, one in components.items()}, coefficient, methods, suites, seeds
    )


def coverage(means: Sequence[float] | Floats, sd: float, seeds: int, levels: int) -> float:
    """How often Student's interval over seeds holds the truth: the mean success of agents, each on suites with these means.

    Planted: the success of an agent on a suite varies from seed to seed as Beta's distribution with standard deviation ``sd``,
    as far as it can, and its ``levels`` are solved at random.
    """
    rng = np.random.default_rng(0)
    means = np.clip(np.asarray(means, float), 0.01, 0.99)
    size = np.maximum(means * (1 - means) / max(sd, 1e-6) ** 2 - 1, 0.1)
    skill = rng.beta(means * size, (1 - means) * size, (REPETITIONS, seeds, len(means)))
    found = (rng.binomial(levels, skill) / levels).mean(axis=2)
    half = stats.t.ppf(1 - ALPHA / 2, seeds - 1) * stats.sem(found, axis=1)
    return float((abs(found.mean(axis=1) - means.mean()) <= half).mean())
