"""The paper's claims about what representations know: figures 4b and 5a, and the appendix's mass and frame stack."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import pandas as pd

from analysis.report import verdicts
from analysis.report.claims import CORRECTED, PAPER, Claim, Finding, not_testable
from analysis.report.claims_gap import difference, effect, finished, held, small_difference
from analysis.report.evidence import Evidence, pearson
from analysis.report.results import FRAME, MEMORY, STACK, Results, paired
from analysis.report.verdicts import NOT_REPRODUCED, REPRODUCED, UNDECIDED
from analysis.tables import keep, pick, select

R = "partial Pearson r"
PROBED = "probes of the agents of the main grid (`probes.parquet`)"
SELF_SUPERVISED = "CURL and SPR beside PPO (`experiments=[figure_5a]`, from `SCALE=standard` on)"
MASSES = "agents that see the mass and agents that do not (`experiments=[appendix_mass]`, from `SCALE=standard` on)"
# The accuracy of the critic as in 2022, and with its marginal, its alignment and its held-out pairs put right.
PROBES = {PAPER: "paper", CORRECTED: "jsd"}
GAPS = {PAPER: "gap_2022", CORRECTED: "gap"}
WORDS = {PAPER: "accuracy and returns of 2022", CORRECTED: "corrected accuracy, full returns"}
ACCURACIES = ("accuracy_train", "accuracy_test")
SAME = ("family", "difficulty", "n", "seed")


def train_above_test(evidence: Evidence) -> Claim:
    """Figure 4b: accuracy on training levels against accuracy on test levels."""
    name, where = "4b-train", "figure 4b's paragraph"
    statement = "The representation scores higher on training levels than on test levels."
    probed = accuracies(evidence.results, evidence.main)
    if probed.empty:
        return not_testable(name, statement, where, PROBED)
    findings = []
    for settings, probe in PROBES.items():
        part = select(probed, probe=probe)
        if len(part):
            differences = part.assign(difference=part["accuracy_train"] - part["accuracy_test"])
            words = f"accuracy on training less on test levels, {WORDS[settings].partition(',')[0]}"
            findings.append(difference(evidence, settings, words, differences, sign=1))
    follows = {
        REPRODUCED: "The critic of 2022 is scored on the very pairs that it was fitted on, so part of the difference "
        "is its own over-fitting; the corrected row scores held-out episodes.",
        NOT_REPRODUCED: "Accuracy on training levels is not higher.",
        UNDECIDED: "Whether accuracy on training levels is higher stays open.",
    }
    return finished(name, statement, where, findings, follows, PROBED)


def no_relation(evidence: Evidence) -> Claim:
    """Figure 4b: gap against accuracy."""
    name, where = "4b-none", "figure 4b's paragraph and caption"
    statement = "With PPO, the gap is not related to how much the representation knows."
    probed = accuracies(evidence.results, evidence.main)
    if probed.empty:
        return not_testable(name, statement, where, PROBED)
    findings = []
    for settings, probe in PROBES.items():
        part = select(probed, probe=probe)
        if part.empty:
            continue
        given = () if settings == PAPER else ("panel", "log_n")
        found = {levels: pearson(part, f"accuracy_{levels}", GAPS[settings], given) for levels in ("train", "test")}
        for levels, one in held(settings, found).items():
            words = f"accuracy on {levels} levels, {WORDS[settings]}" + (", given panel and log n" if given else "")
            findings.append(Finding(settings, words, R if given else "Pearson r", one, verdicts.of_absence(one)))
    follows = {
        REPRODUCED: "No relation, and the intervals are narrow enough to say so. The accuracy of 2022 measures how "
        "the columns of a representation depend on each other, not what they know of factors.",
        NOT_REPRODUCED: "There is a relation. The accuracy of 2022 measures how the columns of a representation "
        "depend on each other, so only the corrected rows speak of information.",
        UNDECIDED: "No relation is found on all levels, but one that matters is not ruled out.",
    }
    return finished(name, statement, where, findings, follows, PROBED)


def self_supervision_helps(evidence: Evidence) -> Claim:
    """Figure 5a's caption."""
    name, where = "5a-gap", "caption of figure 5a"
    statement = "Self-supervised losses can improve the generalization gap."
    table = evidence.results.of("figure_5a")
    findings = []
    for settings, gap in GAPS.items():
        against = "base" if settings == PAPER else "control"
        for algorithm, differences in beside_ppo(table, gap, against).items():
            words = f"gap of {algorithm} less that of PPO" + (
                " with as many gradient steps" if against != "base" else ""
            )
            findings.append(difference(evidence, settings, words, differences, sign=1))
    if not findings:
        return not_testable(name, statement, where, SELF_SUPERVISED)
    follows = {
        REPRODUCED: "The losses make the gap smaller.",
        NOT_REPRODUCED: "At least one of the losses does not make the gap smaller.",
        UNDECIDED: "Whether the losses make the gap smaller stays open.",
    }
    return finished(name, statement, where, findings, follows, SELF_SUPERVISED)


def similar_to_ppo(evidence: Evidence) -> Claim:
    """Figure 5a's paragraph on evaluation."""
    name, where = "5a-similar", "figure 5a's paragraph"
    statement = "On test levels, CURL and SPR do about as well as PPO."
    table = evidence.results.of("figure_5a")
    findings = []
    for algorithm, differences in beside_ppo(table, "eta_test_deterministic", "base").items():
        found = evidence.mean(f"{name} {algorithm}", differences)
        verdict = verdicts.of_absence(found, small_difference(differences))
        findings.append(
            Finding(PAPER, f"return on test levels of {algorithm} less PPO", "mean difference", found, verdict)
        )
    if not findings:
        return not_testable(name, statement, where, SELF_SUPERVISED)
    follows = {
        REPRODUCED: "The difference is small, and known to be.",
        NOT_REPRODUCED: "At least one of them does not do as PPO does.",
        UNDECIDED: "No difference is found, and a larger one is not ruled out.",
    }
    return finished(name, statement, where, findings, follows, SELF_SUPERVISED)


def insignificant_trends(evidence: Evidence) -> Claim:
    """Figure 5a: gap against accuracy, per algorithm."""
    name, where = "5a-trends", "figure 5a's paragraph"
    statement = "None of the trends of gap against information is significant with CURL and SPR."
    table = evidence.results.of("figure_5a")
    probed = accuracies(evidence.results, table)
    findings = []
    for settings, probe in PROBES.items():
        found = {}
        for algorithm in auxiliary(table):
            part = select(probed, probe=probe, algorithm=algorithm) if len(probed) else probed
            for levels in ("train", "test") if len(part) else ():
                words = f"{algorithm}, accuracy on {levels} levels, {WORDS[settings]}"
                found[words] = pearson(part, f"accuracy_{levels}", GAPS[settings])
        for words, one in held(settings, found).items():
            findings.append(Finding(settings, words, "Pearson r", one, verdicts.of_insignificance(one)))
    if not findings:
        return not_testable(name, statement, where, f"{SELF_SUPERVISED}, and their probes (`probes.parquet`)")
    follows = {
        REPRODUCED: "No trend is significant, which few runs alone would explain.",
        NOT_REPRODUCED: "At least one trend is significant.",
    }
    return finished(name, statement, where, findings, follows, SELF_SUPERVISED)


def mass_helps(evidence: Evidence) -> Claim:
    """Appendix: agents that see the mass against agents that do not."""
    name, where = "A-mass", "appendix, framestack and mass"
    statement = "Knowing the mass gives a smaller gap."
    table = evidence.results.masses
    note = (
        "The paper's setting cannot be tested: the mass is 1 in all its tasks, its label is inverted, and its four "
        "facets share their gaps. Here the ball's mass varies tenfold."
    )
    findings = []
    for past in (FRAME, STACK, MEMORY):
        part = select(table, past=past)
        differences = beside(part, "gap", part["mass"] == "shown", part["mass"] == "hidden")
        if len(differences):
            words = f"gap with the mass shown less hidden, {past}"
            findings.append(difference(evidence, CORRECTED, words, differences, sign=1))
    if not findings:
        return Claim(name, statement, where, needs=MASSES, notes=(note,))
    follows = {
        REPRODUCED: "Where mass matters, agents that see it have a smaller gap.",
        NOT_REPRODUCED: "Even where mass matters, seeing it does not make the gap smaller.",
        UNDECIDED: "Even where mass matters, whether seeing it makes the gap smaller stays open.",
    }
    claim = finished(name, statement, where, findings, follows, MASSES)
    return dataclasses.replace(claim, notes=(note,))


def mass_flips_trend(evidence: Evidence) -> Claim:
    """Appendix: the trend of gap against accuracy."""
    name, where = "A-flip", "appendix, framestack and mass"
    statement = "Knowing the mass flips the trend: then the gap is smaller where the representation knows more."
    frames = keep(evidence.results.masses, evidence.results.masses["past"] != MEMORY)
    probed = accuracies(evidence.results, frames)
    findings = []
    for mass, sign in (("shown", 1), ("hidden", -1)):
        part = select(probed, probe=PROBES[CORRECTED], mass=mass) if len(probed) else probed
        if len(part):
            words = f"gap against accuracy on training levels, mass {mass}"
            findings.append(effect(CORRECTED, words, "Pearson r", pearson(part, "accuracy_train", "gap"), sign))
    if not findings:
        return not_testable(name, statement, where, f"{MASSES}, and their probes (`probes.parquet`)")
    follows = {
        REPRODUCED: "The trend has opposite signs, as claimed.",
        NOT_REPRODUCED: "The trend does not flip.",
        UNDECIDED: "Whether the trend flips stays open.",
    }
    return finished(name, statement, where, findings, follows, MASSES)


def accuracies(results: Results, runs: pd.DataFrame) -> pd.DataFrame:
    """The runs that were probed: their columns, ``probe`` ("paper" or "jsd") and its accuracy on ``train`` and
    ``test``."""
    if results.probes.empty or runs.empty:
        return pd.DataFrame()
    table = results.probes
    rows = (table["representation"] == "trained") & (table["quantity"] == "accuracy") & (table["factor"] == "all")
    rows &= table["probe"].isin(list(PROBES.values()))
    wide = pd.pivot_table(keep(table, rows), "estimate", ["run", "probe"], "levels").reset_index()
    if not {"train", "test"} <= set(wide.columns):
        return pd.DataFrame()
    named = pick(wide, ["run", "probe", "train", "test"]).set_axis(["run", "probe", *ACCURACIES], axis=1)
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


CLAIMS = (train_above_test, no_relation, self_supervision_helps, similar_to_ppo, insignificant_trends)
CLAIMS_OF_APPENDIX = (mass_helps, mass_flips_trend)
