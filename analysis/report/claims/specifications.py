"""Specification curves: a test of a claim in every combination of reasonable choices (Simonsohn, Simmons and Nelson 2020)."""

from collections.abc import Iterator, Mapping
from functools import lru_cache
from itertools import product

import numpy as np
import pandas as pd

from segar.analysis.report.claims.claim import METRIC_OURS
from segar.analysis.report.claims.evidence import GIVEN_CELL, Evidence
from segar.analysis.report.claims.prediction import MEASURES
from segar.analysis.report.claims.rows import LEVELS, PROBES, rows_of
from segar.analysis.report.claims.statements import STATEMENTS, tested
from segar.analysis.report.claims.verdicts import is_known, is_significant
from segar.analysis.report.results import ETA, LESS_REGRET, SUCCESS
from segar.analysis.report.rules import MARGINS
from segar.analysis.stats.estimate import Estimate
from segar.analysis.tables import column, keep, select
from segar.experiments.reproduction.experiment_file import SIGNS

CHOICES = ("claim", "number of levels", "measure", "outcome", "runs")
Specification = tuple[str, str, str, str, str, Estimate]  # the claim, its choices, and what they give
SHARE = 0.8  # of the specifications that must agree
# Each choice in words, with the column that stands for it; a column that the tables do not have is left out.
FORMS = {"n as a factor": "levels", "log n": "log_n", "1/sqrt n": "inverse_root_n"}
DISTANCES = {name: MEASURES[name] for name in ("exact W2", "W2 of positions", "exact W2 without its floor")}
DISTANCES["W2 of 2022"] = "w2_reference"
OUTCOMES = {"return": "gap", "success": "gap_success", "regret": LESS_REGRET}
ALL_COUNTS, SEVERAL = "all", "more than one"  # which runs, by their number of training levels or rule sets
NOT_GIVEN = "not given"
# The claims that have specifications of distances: what is given, but for the number of levels.
OF_DISTANCE = {"3a": (), "3a-panel": ("panel",), "3a-n": ("panel",), "3a-cell": ("cell",), "3a-agent": ("panel",)}


@lru_cache(maxsize=1)
def specifications(evidence: Evidence) -> pd.DataFrame:
    """One row per specification: ``claim``, its ``number of levels``, ``measure``, ``outcome``, ``runs``, and the estimate.

    Claims, the figure, the text and the CSV file of a report ask for the same table, which takes some seconds.
    """
    found = (of_distances(evidence), of_rule_sets(evidence), of_diversity(evidence), of_accuracies(evidence))
    rows = [
        one.row(**dict(zip(CHOICES, choices, strict=True))) for part in found for *choices, one in part if is_known(one)
    ]
    return pd.DataFrame(rows)


def of_distances(evidence: Evidence) -> Iterator[Specification]:
    """The specifications of correlations with a distance."""
    main, agent = (prepared(evidence, rows_of(name, evidence)) for name in ("main grid", "the paper's agent"))
    for claim, given in OF_DISTANCE.items():
        runs = agent if claim == "3a-agent" else main
        forms = FORMS if claim == "3a-n" else {GIVEN_CELL if claim == "3a-cell" else NOT_GIVEN: ""}
        outcomes = there(OUTCOMES, runs)
        if claim == "3a":  # panels have other successes, whatever the distance
            outcomes = outcomes[:1]
        asked = product(by_number(runs, "n"), there(DISTANCES, runs), outcomes)
        for (which, part), (distance, x), (outcome, y) in asked:
            rows = keep(part, np.isfinite(column(part, x)) & np.isfinite(column(part, y)))
            for form, n in forms.items():
                found = evidence.correlation(rows, x, y, (*given, *filter(None, [n])))
                yield claim, form, distance, outcome, which, found


def of_rule_sets(evidence: Evidence) -> Iterator[Specification]:
    """Those of rule-sets, with one rule set and without."""
    for which, part in by_number(rows_of("numbers of rule sets", evidence), "rule_sets"):
        for one in tested(evidence, part, "rule-sets"):
            yield "rule-sets", NOT_GIVEN, "number of rule sets", "success", which, one.found


def of_diversity(evidence: Evidence) -> Iterator[Specification]:
    """Those of 5b-diversity: success or return on test levels, with one training level and without."""
    outcomes = {"success": SUCCESS, "return": ETA}
    for (which, part), (outcome, y) in product(by_number(evidence.results.main, "n"), outcomes.items()):
        for one in tested(evidence, part, "5b-diversity", of=y):
            if one.settings == METRIC_OURS:
                yield "5b-diversity", "factor", "R²", outcome, which, one.found


def by_number(runs: pd.DataFrame, of: str) -> list[tuple[str, pd.DataFrame]]:
    """All runs, and those with more than one training level or rule set, where these are others."""
    parts = [(ALL_COUNTS, runs)] if len(runs) else []
    several = keep(runs, runs[of] > 1) if parts else runs
    return parts + [(SEVERAL, several)] * (0 < len(several) < len(runs))


def of_accuracies(evidence: Evidence) -> Iterator[Specification]:
    """The specifications of 4b-none."""
    probed = prepared(evidence, rows_of("probes", evidence))
    for probe, levels, (outcome, y) in product(PROBES.values(), LEVELS, there(OUTCOMES, probed)):
        rows = select(probed, probe=probe)
        for form, n in FORMS.items():
            measure = f"{'accuracy of 2022' if probe == 'paper' else 'corrected accuracy'} on {levels} levels"
            found = evidence.correlation(rows, f"accuracy_{levels}", y, ("panel", n))
            yield "4b-none", form, measure, outcome, ALL_COUNTS, found


def prepared(evidence: Evidence, runs: pd.DataFrame) -> pd.DataFrame:
    """The runs with the columns of all choices that the tables allow: ``inverse_root_n``, ``less_regret``, and measures of
    training sets."""
    if runs.empty:
        return runs
    runs = runs.assign(inverse_root_n=1 / np.sqrt(column(runs, "n")))
    return evidence.results.with_training_sets(evidence.results.with_less_regret(runs))


def there(choices: Mapping[str, str], runs: pd.DataFrame) -> list[tuple[str, str]]:
    """The choices whose column the table has."""
    return [(words, name) for words, name in choices.items() if name in runs and len(runs)]


def survives(table: pd.DataFrame, claim: str) -> bool:
    """Whether the specifications of a claim agree with it, by the rules; a claim without any is not held back."""
    rows = select(table, claim=claim).to_dict("records") if len(table) else []
    if not rows:
        return True
    found = [Estimate.of_row({str(k): v for k, v in row.items()}) for row in rows]
    sign = SIGNS[STATEMENTS["claims"][claim]["tests"][0]["expected"]]
    if sign:
        one_way = all(one.estimate * sign > 0 for one in found)
        return one_way and float(np.mean([is_significant(one) for one in found])) >= SHARE
    margin = MARGINS["correlation"]
    small = np.mean([-margin < one.low and one.high < margin for one in found])
    return bool(small >= SHARE and not any(one.low > margin or one.high < -margin for one in found))
