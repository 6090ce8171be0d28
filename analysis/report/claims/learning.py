"""The tests of the claims about learning (figure 5b, SAC) and about the KS statistic."""

from collections.abc import Callable, Iterator

import numpy as np
import pandas as pd

from analysis.plotting.names import family_name
from analysis.report.claims.claim import METRIC_2022, METRIC_OURS, Finding, mean_difference
from analysis.report.claims.evidence import Evidence
from analysis.report.claims.information import beside
from analysis.report.number_format import estimate_text, plain, with_interval
from analysis.report.results import LESS_REGRET
from analysis.report.rules import MARGINS
from analysis.stats.correlation import NotAvailable, explained, indicators
from analysis.tables import column, keep, select

TEST_LEVELS = 100  # of the study
OUTCOMES = {METRIC_2022: "eta_train_deterministic", METRIC_OURS: "success_train_deterministic"}
PLANNED_SEEDS = 5  # of SAC, see rules.yaml
ON_TEST = {METRIC_2022: "eta_test_deterministic", METRIC_OURS: "success_test_deterministic"}


def distances_of_empty(evidence: Evidence) -> pd.DataFrame:
    """The KS statistics in distribution of the family Empty, from the study of distances.

    Joint distribution functions of more entities differ by 1 for most n, where no rate can be seen.
    """
    table = evidence.results.studies.get("w2_study", {}).get("distances", pd.DataFrame())
    if table.empty:
        return table
    return keep(table, (table["train"] == table["test"]) & (table["ks"] > 0) & table["train"].str.startswith("empty-"))


def diversity_above_panel(evidence: Evidence, runs: pd.DataFrame) -> Iterator[Finding]:
    """Figure 5b's caption: R² of the performance on the number of levels, each by itself, less R² on the panel."""
    for settings, outcome in ((METRIC_2022, OUTCOMES[METRIC_2022]), (METRIC_OURS, ON_TEST[METRIC_OURS])):
        by_n, by_panel = (indicators(list(runs[key].astype(str))) for key in ("n", "panel"))
        values = np.column_stack([column(runs, outcome), by_n, by_panel])
        found = evidence.by_blocks(runs, values, difference_of_r2(by_n.shape[1]))
        words = f"{column_words(outcome)}: R² of the number of levels less R² of the panel"
        yield Finding(settings, words, "difference of R²", found, MARGINS["explained"], 1)


def both_r2(evidence: Evidence, runs: pd.DataFrame) -> str:
    """R² of the success on test levels on the number of levels and on the panel, of the runs that learned and of all."""
    parts = {"runs that learned": runs, "all runs": evidence.ungated.main}
    said = []
    for which, part in parts.items():
        y = column(part, ON_TEST[METRIC_OURS])
        by_n, by_panel = (explained(y, indicators(list(part[key].astype(str)))) for key in ("n", "panel"))
        if isinstance(by_n, NotAvailable) or isinstance(by_panel, NotAvailable):
            return ""
        said.append(f"{plain(by_n)} on n and {plain(by_panel)} on the panel in {which} (n = {len(part)})")
    return f"R² of success on test levels: {'; '.join(said)}."


def difference_of_r2(width: int) -> Callable[[np.ndarray], float]:
    """R² of the first column on the next ``width`` ones less R² on the rest; NaN where one cannot be had."""

    def difference(values: np.ndarray) -> float:
        y, sets = values[:, 0], (values[:, 1 : 1 + width], values[:, 1 + width :])
        one, other = (explained(y, x) for x in sets)
        return float("nan") if isinstance(one, NotAvailable) or isinstance(other, NotAvailable) else one - other

    return difference


def easier_tasks_first(evidence: Evidence, runs: pd.DataFrame) -> Iterator[Finding]:
    """Figure 5b's paragraph: within one budget, easier configurations get further."""
    comparisons = (
        ("difficulty", "easy", "hard"),
        ("family", "empty", "objectsx1"),
        ("family", "empty", "hazardtilesx1"),
    )
    for settings, outcome in OUTCOMES.items():
        for key, easier, harder in comparisons:
            same = ("difficulty" if key == "family" else "family", "n", "seed")
            differences = beside(runs, outcome, runs[key] == easier, runs[key] == harder, same)
            words = f"{column_words(outcome)}, {family_name(easier)} less {family_name(harder)}"
            yield from mean_difference(evidence, settings, words, differences, 1, margin_of(outcome))


def sac_beside_ppo(evidence: Evidence, runs: pd.DataFrame) -> Iterator[Finding]:
    """Appendix: SAC on easy tasks, beside PPO after as many frames."""
    easy = select(runs, difficulty="easy")
    for settings, outcome in ON_TEST.items():
        differences = beside(easy, outcome, is_sac(easy), ~is_sac(easy), ("family", "n", "seed", "frames"))
        words = f"{column_words(outcome)}, SAC less PPO after as many frames, easy panels"
        yield from mean_difference(evidence, settings, words, differences, 1, margin_of(outcome))


def sac_easy_beside_hard(evidence: Evidence, runs: pd.DataFrame) -> Iterator[Finding]:
    """Appendix: SAC on easy tasks beside SAC on hard ones."""
    sac = keep(runs, is_sac(runs))
    for settings, outcome in ON_TEST.items():
        words = f"{column_words(outcome)}, easy less hard"
        yield from mean_difference(evidence, settings, words, easy_less_hard(sac, outcome), 1, margin_of(outcome))


def sac_in_other_ways(evidence: Evidence, runs: pd.DataFrame) -> str:
    """The same with the seeds that were planned, and with what the planner reaches taken out."""
    sac = evidence.results.with_less_regret(keep(runs, is_sac(runs)))
    planned = keep(sac, sac["seed"] <= PLANNED_SEEDS)
    tests = [(f"success on test levels, the first {PLANNED_SEEDS} seeds", planned, ON_TEST[METRIC_OURS])]
    tests += [("return on test levels less the planner's", sac, LESS_REGRET)] if LESS_REGRET in sac else []
    said = [
        f"{words} {estimate_text(evidence.mean(easy_less_hard(part, outcome)), '')}" for words, part, outcome in tests
    ]
    return f"Easy less hard, in other ways, which decide nothing: {'; '.join(said)}."


def easy_less_hard(runs: pd.DataFrame, outcome: str) -> pd.DataFrame:
    """The runs on easy levels with ``difference``: their outcome less that of the run on hard ones."""
    return beside(runs, outcome, runs["difficulty"] == "easy", runs["difficulty"] == "hard", ("family", "n", "seed"))


def is_sac(runs: pd.DataFrame) -> pd.Series:
    """Which runs are of SAC: DrQ is SAC from pixels with shifts."""
    return runs["algorithm"].astype(str).str.startswith(("sac", "drq"))


def margin_of(outcome: str) -> float:
    """The difference that matters, of a share of levels; 0, which stands for a part of a standard deviation, of returns."""
    return MARGINS["success"] if outcome.startswith("success") else 0.0


def rate_of_ks(evidence: Evidence, distances: pd.DataFrame) -> Iterator[Finding]:
    """Appendix, limitations: whether the KS statistic falls exponentially in n, or as a power of the effective n."""
    log_ks, panel = np.log(column(distances, "ks")), indicators(list(distances["train"]))
    values = np.column_stack([log_ks, panel, column(distances, "n"), panel, log_effective_n(distances)])
    found = evidence.by_blocks(distances, values, difference_of_r2(panel.shape[1] + 1), ("train", "seed"))
    words = "Empty: R² of log KS on n (exponential) less R² on the logarithm of the effective n (a power)"
    yield Finding(METRIC_OURS, words, "difference of R²", found, MARGINS["explained"], 1)


def slope_of_ks(evidence: Evidence, distances: pd.DataFrame) -> dict[str, str]:
    """The power of the effective n with which KS falls, with its interval: ``slope``."""
    log_ks, panel = np.log(column(distances, "ks")), indicators(list(distances["train"]))
    values = np.column_stack([log_ks, np.ones(len(distances)), panel, log_effective_n(distances)])
    found = evidence.by_blocks(distances, values, last_slope, ("train", "seed"))
    return {"slope": with_interval(found)}


def last_slope(values: np.ndarray) -> float:
    """The slope of the last column, in least squares of the first on all others."""
    return float(np.linalg.lstsq(values[:, 1:], values[:, 0], rcond=None)[0][-1])


def log_effective_n(table: pd.DataFrame) -> np.ndarray:
    """The logarithm of the effective number of two samples: n training levels, and the study's test levels."""
    n = column(table, "n")
    return np.log(n * TEST_LEVELS / (n + TEST_LEVELS))


def column_words(column: str) -> str:
    """A column of the runs in words, e.g. ``return on test levels``."""
    kind, split, _ = column.split("_")
    return f"{'return' if kind == 'eta' else kind} on {'training' if split == 'train' else split} levels"
