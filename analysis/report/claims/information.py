"""The tests of the claims about what representations know: figures 4b and 5a, and the appendix's mass and frame stack."""

from collections.abc import Iterator, Sequence
from typing import Any

import pandas as pd

from analysis.plotting.names import algorithm_name
from analysis.report.claims.claim import METRIC_2022, METRIC_OURS, Finding, correlation, mean_difference, with_holm
from analysis.report.claims.evidence import Evidence
from analysis.report.results import FRAME, MEMORY, STACK, Results, paired
from analysis.report.rules import MARGINS
from analysis.tables import keep, pick, select

# The accuracy of the critic as in 2022, and with its marginal, its alignment and its held-out pairs put right.
PROBES = {METRIC_2022: "paper", METRIC_OURS: "jsd"}
GAPS = {METRIC_2022: "gap_2022", METRIC_OURS: "gap"}
WORDS = {METRIC_2022: "accuracy and returns of 2022", METRIC_OURS: "corrected accuracy, full returns"}
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
    for settings, given in ((METRIC_2022, ()), (METRIC_OURS, ("panel", "levels"))):
        part = select(probed, probe=PROBES[settings])
        for levels in LEVELS if len(part) else ():
            found = evidence.correlation(part, f"accuracy_{levels}", GAPS[settings], given)
            words = f"accuracy on {levels} levels, {WORDS[settings]}" + (", given panel and n" if given else "")
            yield correlation(settings, words, found, 0, given)


def gap_beside_ppo(evidence: Evidence, runs: pd.DataFrame) -> Iterator[Finding]:
    """Figure 5a's caption: the gap of each self-supervised algorithm beside that of PPO."""
    for algorithm, differences in beside_ppo(runs, "gap_2022", "base").items():
        words = f"gap of {algorithm_name(algorithm)} less that of PPO, returns of 2022"
        yield from mean_difference(evidence, METRIC_2022, words, differences, sign=1)
    for algorithm, differences in beside_ppo(runs, "gap_success", "control").items():
        words = f"gap in success of {algorithm_name(algorithm)} less that of PPO with as many gradient steps"
        yield from mean_difference(evidence, METRIC_OURS, words, differences, 1, MARGINS["success"])


def success_beside_ppo(evidence: Evidence, runs: pd.DataFrame) -> Iterator[Finding]:
    """Figure 5a's paragraph on evaluation: what each self-supervised algorithm reaches on test levels beside PPO."""
    for algorithm, differences in beside_ppo(runs, "eta_test_deterministic", "base").items():
        words = f"return on test levels of {algorithm_name(algorithm)} less PPO"
        yield from mean_difference(evidence, METRIC_2022, words, differences, sign=0)
    for algorithm, differences in beside_ppo(runs, "success_test_deterministic", "base").items():
        words = f"success on test levels of {algorithm_name(algorithm)} less PPO"
        yield from mean_difference(evidence, METRIC_OURS, words, differences, 0, MARGINS["success"])


def trends_of_auxiliary(evidence: Evidence, probed: pd.DataFrame) -> Iterator[Finding]:
    """Figure 5a: gap against accuracy given panel, per algorithm: its panels are too few to be compared."""
    for settings, probe in PROBES.items():
        for algorithm in auxiliary(probed):
            part = select(probed, probe=probe, algorithm=algorithm)
            for levels in LEVELS if len(part) else ():
                words = f"{algorithm_name(algorithm)}, accuracy on {levels} levels, {WORDS[settings]}"
                found = evidence.correlation(part, f"accuracy_{levels}", GAPS[settings], ("panel",))
                yield correlation(settings, f"{words}, given panel", found, 0, "panel")


def mass_shown_beside_hidden(evidence: Evidence, runs: pd.DataFrame) -> Iterator[Finding]:
    """Appendix: agents that see the mass beside agents that do not."""
    for past in (FRAME, STACK, MEMORY):
        part = select(runs, past=past)
        differences = beside(part, "gap_success", part["mass"] == "shown", part["mass"] == "hidden")
        words = f"gap in success with the mass shown less hidden, {past}"
        yield from mean_difference(evidence, METRIC_OURS, words, differences, 1, MARGINS["success"])


def trend_by_mass(evidence: Evidence, probed: pd.DataFrame) -> Iterator[Finding]:
    """Appendix: the trend of gap against accuracy, with the mass shown and hidden."""
    parts = {mass: select(probed, probe=PROBES[METRIC_OURS], mass=mass) for mass in ("shown", "hidden")}
    found = {mass: evidence.correlation(part, "accuracy_train", "gap") for mass, part in parts.items() if len(part)}
    for mass, one in with_holm(found).items():
        words = f"gap against accuracy on training levels, mass {mass}"
        yield correlation(METRIC_OURS, words, one, 1 if mass == "shown" else -1, corrected=True)


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


def is_plain_ppo(algorithm: str) -> bool:
    """Whether it is PPO without a self-supervised loss and without more gradient steps."""
    return algorithm.startswith("ppo") and not algorithm.endswith("_epochs")


def beside_ppo(table: pd.DataFrame, value: str, against: str) -> dict[str, pd.DataFrame]:
    """For each self-supervised algorithm, its ``difference`` to PPO in the same cells: to PPO alone ("base"),
    or to PPO with as many gradient steps ("control"); an algorithm without a partner is left out."""
    name = table["algorithm"].astype(str)
    partner = name.str.endswith("_epochs") if against == "control" else name.map(is_plain_ppo)
    found = {algorithm: beside(table, value, name == algorithm, partner) for algorithm in auxiliary(table)}
    return {algorithm: rows for algorithm, rows in found.items() if len(rows)}


def beside(table: pd.DataFrame, value: str, one: Any, other: Any, same: Sequence[str] = SAME) -> pd.DataFrame:
    """The rows of ``one`` with ``difference``: their ``value`` less that of the row of ``other`` in the same cell."""
    return paired(keep(table, one), keep(table, other), value, same)
