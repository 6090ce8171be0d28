"""The paper's claims about learning (figure 5b, SAC) and about the KS statistic."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd

from analysis.report.claims import CORRECTED, PAPER, Claim, Finding, not_testable
from analysis.report.claims_gap import MAIN, difference, finished
from analysis.report.claims_information import beside
from analysis.report.evidence import Evidence
from analysis.report.verdicts import NOT_REPRODUCED, REPRODUCED, UNDECIDED, of_effect
from analysis.stats.correlation import NotAvailable, explained, indicators
from analysis.stats.estimate import Estimate
from analysis.tables import keep, select

OFF_POLICY = "SAC with shifts (`experiments=[appendix_sac]`, from `SCALE=standard` on)"
W2_STUDY = "the study of distances without training (`experiments=[w2_study]`, from `SCALE=smoke` on)"
SMALL_SHARE = 0.1  # of a variance; less does not matter
TEST_LEVELS = 100  # of the study
OUTCOMES = {PAPER: "eta_train_deterministic", CORRECTED: "success_train_deterministic"}
ON_TEST = {PAPER: "eta_test_deterministic", CORRECTED: "success_test_deterministic"}
WORDS = {PAPER: "return on training levels", CORRECTED: "success on training levels"}


def diversity_decides(evidence: Evidence) -> Claim:
    """Figure 5b's caption."""
    name, where = "5b-diversity", "caption of figure 5b"
    statement = "Performance depends mostly on the diversity of the training tasks."
    if evidence.main.empty:
        return not_testable(name, statement, where, MAIN)
    findings = []
    for settings, column in ((PAPER, "eta_train_deterministic"), (CORRECTED, "success_test_deterministic")):
        found = shares(evidence, f"{name} {column}", column)
        words = f"{column_words(column)}: R² of the number of levels less R² of the panel"
        findings.append(Finding(settings, words, "difference of R²", found, of_effect(found, 1, SMALL_SHARE)))
    follows = {
        REPRODUCED: "The number of levels explains more of the performance than family and difficulty do.",
        NOT_REPRODUCED: "Family and difficulty explain more of the performance than the number of levels does. On "
        "test levels, the number of levels matters more than on training levels.",
        UNDECIDED: "Which of the two explains more stays open.",
    }
    return finished(name, statement, where, findings, follows, MAIN)


def shares(evidence: Evidence, name: str, column: str) -> Estimate:
    """R² of a column on the number of levels (each by itself) less R² on the panel."""
    table = evidence.main
    y = table[[column]].to_numpy(np.float64)
    sets = [indicators(list(table[key].astype(str))) for key in ("n", "panel")]
    return evidence.by_blocks(name, table, np.column_stack([y, *sets]), difference_of_r2(sets[0].shape[1]))


def difference_of_r2(width: int) -> Callable[[np.ndarray], float]:
    """R² of the first column on the next ``width`` ones less R² on the rest; NaN where one cannot be had."""

    def difference(values: np.ndarray) -> float:
        y, sets = values[:, 0], (values[:, 1 : 1 + width], values[:, 1 + width :])
        one, other = (explained(y, x) for x in sets)
        return float("nan") if isinstance(one, NotAvailable) or isinstance(other, NotAvailable) else one - other

    return difference


def easy_is_quick(evidence: Evidence) -> Claim:
    """Figure 5b's paragraph: within one budget, easier configurations get further."""
    name, where = "5b-easy", "figure 5b's paragraph"
    statement = "In equally many frames, agents get further in easier tasks: easy before hard, Empty before the others."
    table = evidence.main
    if table.empty:
        return not_testable(name, statement, where, MAIN)
    findings = []
    for settings, column in OUTCOMES.items():
        hard = beside(
            table, column, table["difficulty"] == "easy", table["difficulty"] == "hard", ("family", "n", "seed")
        )
        if len(hard):
            findings.append(difference(evidence, settings, f"{WORDS[settings]}, easy less hard", hard, sign=1))
        for family in ("objectsx1", "tilesx1"):
            pair = beside(
                table, column, table["family"] == "empty", table["family"] == family, ("difficulty", "n", "seed")
            )
            if len(pair):
                findings.append(difference(evidence, settings, f"{WORDS[settings]}, empty less {family}", pair, sign=1))
    follows = {
        REPRODUCED: "After equally many frames, agents are further in the easier tasks.",
        NOT_REPRODUCED: "Not every comparison goes that way: returns of families are on different scales, and "
        "success says more.",
        UNDECIDED: "Not every comparison is decided by these runs.",
    }
    return finished(name, statement, where, findings, follows, MAIN)


def sac_solves_easy(evidence: Evidence) -> Claim:
    """Appendix: SAC on easy tasks, against PPO."""
    name, where = "A-sac-easy", "appendix, SAC"
    statement = "SAC quickly solves the easy tasks, as opposed to PPO."
    table = evidence.results.of("appendix_sac")
    if table.empty:
        return not_testable(name, statement, where, OFF_POLICY)
    both = pd.concat([table.assign(kind="sac"), evidence.main.assign(kind="ppo")], ignore_index=True)
    both = select(both, difficulty="easy")
    findings = []
    for settings, column in ON_TEST.items():
        paired = beside(both, column, both["kind"] == "sac", both["kind"] == "ppo")
        if len(paired):
            words = f"{column_words(column)}, SAC less PPO, easy panels (SAC had fewer frames)"
            findings.append(difference(evidence, settings, words, paired, sign=1))
    follows = {
        REPRODUCED: "SAC is ahead of PPO on easy levels.",
        NOT_REPRODUCED: "SAC is not ahead of PPO on easy levels.",
        UNDECIDED: "Whether SAC is ahead of PPO on easy levels stays open.",
    }
    needs = f"{OFF_POLICY} and the main grid, with numbers of levels in common"
    return finished(name, statement, where, findings, follows, needs)


def sac_struggles(evidence: Evidence) -> Claim:
    """Appendix: SAC on harder tasks."""
    name, where = "A-sac-hard", "appendix, SAC"
    statement = "SAC struggles on harder tasks."
    table = evidence.results.of("appendix_sac")
    findings = []
    for settings, column in ON_TEST.items():
        easy, hard = table["difficulty"] == "easy", table["difficulty"] == "hard"
        paired = beside(table, column, easy, hard, ("family", "n", "seed"))
        if len(paired):
            findings.append(difference(evidence, settings, f"{column_words(column)}, easy less hard", paired, sign=1))
    if not findings:
        return not_testable(name, statement, where, OFF_POLICY)
    follows = {
        REPRODUCED: "SAC does worse on hard levels than on easy ones.",
        NOT_REPRODUCED: "SAC does not do worse on hard levels.",
        UNDECIDED: "Whether SAC does worse on hard levels stays open.",
    }
    return finished(name, statement, where, findings, follows, OFF_POLICY)


def ks_shrinks(evidence: Evidence) -> Claim:
    """Appendix, limitations: the rate of the KS statistic."""
    name, where = "A-ks", "appendix, on the Kolmogorov-Smirnov statistic"
    statement = "The distance between the distribution functions of a sample and its law shrinks exponentially in n."
    table = evidence.results.studies.get("w2_study", {}).get("distances", pd.DataFrame())
    if table.empty:
        return not_testable(name, statement, where, W2_STUDY)
    # Joint distribution functions of more entities differ by 1 for most n, where no rate can be seen.
    inside = (table["train"] == table["test"]) & (table["ks"] > 0)
    part = keep(table, [a and name.startswith("empty-") for a, name in zip(inside, table["train"], strict=True)])
    if part.empty:
        return not_testable(name, statement, where, W2_STUDY)
    log_ks, panel = np.log(part["ks"].to_numpy(np.float64)), indicators(list(part["train"]))
    exponential, power = part["n"].to_numpy(np.float64), effective(part)
    values = np.column_stack([log_ks, panel, exponential, panel, power])
    found = evidence.by_blocks(name, part, values, difference_of_r2(panel.shape[1] + 1), ("train", "seed"))
    values = np.column_stack([log_ks, np.ones(len(part)), panel, power])
    slope = evidence.by_blocks(f"{name} slope", part, values, last_slope, ("train", "seed"))
    words = "Empty: R² of log KS on n (exponential) less R² on the logarithm of the effective n (a power)"
    findings = (Finding(CORRECTED, words, "difference of R²", found, of_effect(found, 1, 0.0)),)
    follows = {
        REPRODUCED: "An exponential fits better than a power of n.",
        NOT_REPRODUCED: f"A power of n fits better: KS falls as n to the {slope.estimate:.2f} (95 % interval "
        f"{slope.low:.2f} to {slope.high:.2f}), near the root that theory says. Only the probability of a large "
        "distance falls exponentially.",
        UNDECIDED: "Neither law fits clearly better.",
    }
    return finished(name, statement, where, findings, follows, W2_STUDY)


def last_slope(values: np.ndarray) -> float:
    """The slope of the last column, in least squares of the first on all others."""
    return float(np.linalg.lstsq(values[:, 1:], values[:, 0], rcond=None)[0][-1])


def effective(table: pd.DataFrame) -> np.ndarray:
    """Log of the effective number of two samples, n training levels and the study's test levels."""
    n = table["n"].to_numpy(np.float64)
    return np.log(n * TEST_LEVELS / (n + TEST_LEVELS))


def column_words(column: str) -> str:
    """A column of the runs in words, e.g. ``return on test levels``."""
    kind, split, _ = column.split("_")
    return f"{'return' if kind == 'eta' else kind} on {'training' if split == 'train' else split} levels"


CLAIMS = (diversity_decides, easy_is_quick)
CLAIMS_OF_APPENDIX = (sac_solves_easy, sac_struggles, ks_shrinks)
