"""The tests of the claims about what representations know: figures 4b and 5a, and the appendix's mass and frame stack."""

from collections.abc import Iterator, Sequence
from typing import Any

import pandas as pd

from analysis.report.claims import verdicts
from analysis.report.claims.claim import CORRECTED, PAPER, Finding, effect, mean_difference, small_difference, with_holm
from analysis.report.claims.evidence import Evidence, pearson
from analysis.report.results import FRAME, MEMORY, STACK, Results, paired
from analysis.tables import keep, pick, select

R = "Pearson r"
# The accuracy of the critic as in 2022, and with its marginal, its alignment and its held-out pairs put right.
PROBES = {PAPER: "paper", CORRECTED: "jsd"}
GAPS = {PAPER: "gap_2022", CORRECTED: "gap"}
WORDS = {PAPER: "accuracy and returns of 2022", CORRECTED: "corrected accuracy, full returns"}
LEVELS = ("train", "test")
ACCURACIES = ("accuracy_train", "accuracy_test")
SAME = ("family", "difficulty", "n", "seed")


def self_supervised_probes(evidence: Evidence) -> pd.DataFrame:
    """The accuracies of the runs of figure 5a."""
    return accuracies(evidence.results, evidence.results.of("figure_5a"))


def probes_with_masses(evidence: Evidence) -> pd.DataFrame:
    """The accuracies of the appendix's agents without a memory."""
    masses = evidence.results.masses
    return accuracies(evidence.results, keep(masses, masses["past"] != MEMORY))


def train_above_test(evidence: Evidence, probed: pd.DataFrame) -> Iterator[Finding]:
    """Figure 4b: accuracy on training levels against accuracy on test levels."""
    for settings, probe in PROBES.items():
        part = select(probed, probe=probe)
        differences = part.assign(difference=part["accuracy_train"] - part["accuracy_test"])
        words = f"accuracy on training less on test levels, {WORDS[settings].partition(',')[0]}"
        yield from mean_difference(evidence, settings, words, differences, sign=1)


def relation_to_gap(evidence: Evidence, probed: pd.DataFrame) -> Iterator[Finding]:
    """Figure 4b: gap against accuracy."""
    for settings, given in ((PAPER, ()), (CORRECTED, ("panel", "log_n"))):
        part = select(probed, probe=PROBES[settings])
        found = {levels: pearson(part, f"accuracy_{levels}", GAPS[settings], given) for levels in LEVELS if len(part)}
        for levels, one in with_holm(settings, found).items():
            words = f"accuracy on {levels} levels, {WORDS[settings]}" + (", given panel and log n" if given else "")
            yield Finding(settings, words, f"partial {R}" if given else R, one, verdicts.of_absence(one))


def gap_beside_ppo(evidence: Evidence, runs: pd.DataFrame) -> Iterator[Finding]:
    """Figure 5a's caption: the gap of each self-supervised algorithm beside that of PPO."""
    for settings, against, more in ((PAPER, "base", ""), (CORRECTED, "control", " with as many gradient steps")):
        for algorithm, differences in beside_ppo(runs, GAPS[settings], against).items():
            words = f"gap of {algorithm} less that of PPO{more}"
            yield from mean_difference(evidence, settings, words, differences, sign=1)


def return_beside_ppo(evidence: Evidence, runs: pd.DataFrame) -> Iterator[Finding]:
    """Figure 5a's paragraph on evaluation: the return of each self-supervised algorithm beside that of PPO."""
    for algorithm, differences in beside_ppo(runs, "eta_test_deterministic", "base").items():
        found = evidence.mean(f"5a-similar {algorithm}", differences)
        verdict = verdicts.of_absence(found, small_difference(differences))
        yield Finding(PAPER, f"return on test levels of {algorithm} less PPO", "mean difference", found, verdict)


def trends_of_auxiliary(evidence: Evidence, probed: pd.DataFrame) -> Iterator[Finding]:
    """Figure 5a: gap against accuracy, per algorithm."""
    for settings, probe in PROBES.items():
        found = {}
        for algorithm in auxiliary(probed):
            part = select(probed, probe=probe, algorithm=algorithm)
            for levels in LEVELS if len(part) else ():
                words = f"{algorithm}, accuracy on {levels} levels, {WORDS[settings]}"
                found[words] = pearson(part, f"accuracy_{levels}", GAPS[settings])
        for words, one in with_holm(settings, found).items():
            yield Finding(settings, words, R, one, verdicts.of_insignificance(one))


def mass_shown_beside_hidden(evidence: Evidence, runs: pd.DataFrame) -> Iterator[Finding]:
    """Appendix: agents that see the mass beside agents that do not."""
    for past in (FRAME, STACK, MEMORY):
        part = select(runs, past=past)
        differences = beside(part, "gap", part["mass"] == "shown", part["mass"] == "hidden")
        yield from mean_difference(evidence, CORRECTED, f"gap with the mass shown less hidden, {past}", differences, 1)


def trend_by_mass(evidence: Evidence, probed: pd.DataFrame) -> Iterator[Finding]:
    """Appendix: the trend of gap against accuracy, with the mass shown and hidden."""
    for mass, sign in (("shown", 1), ("hidden", -1)):
        part = select(probed, probe=PROBES[CORRECTED], mass=mass)
        if len(part):
            words = f"gap against accuracy on training levels, mass {mass}"
            yield effect(CORRECTED, words, R, pearson(part, "accuracy_train", "gap"), sign)


def accuracies(results: Results, runs: pd.DataFrame) -> pd.DataFrame:
    """The runs that were probed: their columns, ``probe`` ("paper" or "jsd") and its accuracy on ``train`` and
    ``test``."""
    if results.probes.empty or runs.empty:
        return pd.DataFrame()
    table = results.probes
    rows = (table["representation"] == "trained") & (table["quantity"] == "accuracy") & (table["factor"] == "all")
    rows &= table["probe"].isin(list(PROBES.values()))
    wide = pd.pivot_table(keep(table, rows), "estimate", ["run", "probe"], "levels").reset_index()
    if not {*LEVELS} <= set(wide.columns):
        return pd.DataFrame()
    named = pick(wide, ["run", "probe", *LEVELS]).set_axis(["run", "probe", *ACCURACIES], axis=1)
    return runs.merge(named, on="run").dropna(subset=list(ACCURACIES))


def auxiliary(table: pd.DataFrame) -> list[str]:
    """The algorithms of a table that have a self-supervised loss."""
    return sorted({str(name) for name in table["algorithm"] if str(name).startswith(("curl", "spr"))})


def beside_ppo(table: pd.DataFrame, value: str, against: str) -> dict[str, pd.DataFrame]:
    """For each self-supervised algorithm, its ``difference`` to PPO in the same cells: to PPO alone ("base"),
    or to PPO with as many gradient steps ("control"); an algorithm without a partner is left out."""
    name = table["algorithm"].astype(str)
    control = name.str.endswith("_epochs")
    partner = control if against == "control" else name.str.startswith("ppo") & ~control
    found = {algorithm: beside(table, value, name == algorithm, partner) for algorithm in auxiliary(table)}
    return {algorithm: rows for algorithm, rows in found.items() if len(rows)}


def beside(table: pd.DataFrame, value: str, one: Any, other: Any, same: Sequence[str] = SAME) -> pd.DataFrame:
    """The rows of ``one`` with ``difference``: their ``value`` less that of the row of ``other`` in the same cell."""
    return paired(keep(table, one), keep(table, other), value, same)
