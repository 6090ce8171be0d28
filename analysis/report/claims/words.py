"""What is said beside the verdicts of the paper's claims: numbers that decide nothing, and what a pooled number hides."""

from collections import Counter
from collections.abc import Callable, Mapping
from functools import partial

import pandas as pd

from segar.analysis.plotting.names import word_for
from segar.analysis.report.claims.evidence import Evidence, matrix
from segar.analysis.report.claims.rows import PAPER_AGENT, SAC, rows_of
from segar.analysis.report.claims.statements import STATEMENTS, tested
from segar.analysis.report.claims.verdicts import is_significant
from segar.analysis.report.number_format import NONE, effect, estimate_text, plain, with_interval
from segar.analysis.report.results import ETA, SUCCESS
from segar.analysis.stats.correlation import explained
from segar.analysis.stats.estimate import Estimate
from segar.analysis.tables import column, count_of, keep, select

# Other outcomes that the rules name; the return on test levels falls as the regret grows.
SECOND = {"gap_success": "gap in success", "gap": "gap in returns", ETA: "return on test levels (less regret)"}
SEEN_SEEDS = [1, 2, 3, 4, 5, 6]  # of SAC, see rules.yaml


def agents_that_learned(evidence: Evidence, runs: pd.DataFrame) -> str:
    """How many runs of the paper's own agent count; "" where all do."""
    everything = evidence.all_results.of(PAPER_AGENT)
    lost = Counter(everything["family"]) - Counter(runs["family"])
    said = ", ".join(f"{count} of {word_for(family)}" for family, count in lost.items())
    return f"{len(runs)} of {len(everything)} runs learned their training levels (without {said})." if lost else ""


def without_one_level(evidence: Evidence, runs: pd.DataFrame, claim: str) -> str:
    """What is left of a correlation without the runs with one training level."""
    part = keep(runs, runs["n"] > 1)
    if part.empty or len(part) == len(runs):
        return ""
    found = tested(evidence, part, claim)
    said = [f"{estimate_text(one.found)} ({one.settings}, {one.test}: {one.verdict})" for one in found]
    return f"Without the runs with one training level: {'; '.join(said)}." if said else ""


def seen_before(evidence: Evidence, runs: pd.DataFrame, claim: str, **where: str) -> str:
    """What the seeds of SAC say that are not judged."""
    found = tested(evidence, runs, claim, where={**where, "seed": SEEN_SEEDS})
    said = [f"{estimate_text(one.found, '')} ({one.settings})" for one in found]
    return f"Seeds 1 to 6, which decide nothing: {' and '.join(said)}." if said else ""


def at_each_n(evidence: Evidence, runs: pd.DataFrame, claim: str) -> str:
    """The same at each number of levels by itself, and of the gaps in success and in returns; a gap is negative."""
    of = STATEMENTS["claims"][claim]["tests"][0]["of"]
    parts = [(f"n = {n}", select(runs, n=n), {}) for n in sorted({*runs["n"]})]
    parts += [(words, runs, {"of": name, "margin": ""}) for name, words in SECOND.items() if name != of]
    said = [
        f"{words} {estimate_text(one.found, '')}"
        for words, part, changes in parts
        for one in tested(evidence, part, claim, **changes)
    ]
    return f"In other ways, which decide nothing: {'; '.join(said)}." if said else ""


def slope_of_ks(evidence: Evidence, distances: pd.DataFrame) -> dict[str, str]:
    """The power of the effective n with which KS falls, with its interval: ``slope``."""
    found = evidence.slope(distances, "log_effective_n", "log_ks", ["train"], ("train", "seed"))
    return {"slope": with_interval(found)}


def success_at_both_ends(evidence: Evidence, runs: pd.DataFrame) -> str:
    """The success of agents on the fewest and on the most rule sets, on training levels and on unseen ones."""
    numbers = sorted({*runs["rule_sets"]})
    parts = [select(runs, rule_sets=number) for number in (numbers[0], numbers[-1])]
    trained = [evidence.mean(part, "success_train_deterministic") for part in parts]
    unseen = [evidence.mean(part, SUCCESS) for part in parts]
    said = (
        f"From {numbers[0]:,.0f} to {numbers[-1]:,.0f} rule sets, mean success goes on training levels from "
        f"{' to '.join(map(share, trained))} and on unseen rule sets from {' to '.join(map(share, unseen))} "
        f"(n = {' and '.join(f'{len(part)}' for part in parts)} runs)"
    )
    falls = trained[-1].estimate < trained[0].estimate
    return said + (": a gap also closes where success in training falls." if falls else ".")


def share(found: Estimate) -> str:
    """``0.95 [0.88, 1.00]``, an interval that ends at 0 and 1; or the share alone where it has none."""
    value, ends = effect(found, plain)
    return value if ends == NONE else f"{value} [{plain(max(found.low, 0.0))}, {plain(min(found.high, 1.0))}]"


def without_one_rule_set(evidence: Evidence, runs: pd.DataFrame) -> str:
    """:func:`success_at_both_ends`, and what is left of the correlation without the runs on one rule set."""
    more = keep(runs, runs["rule_sets"] > 1)
    if count_of(more, "rule_sets") < 2 or len(more) == len(runs):
        return success_at_both_ends(evidence, runs)
    (one,) = tested(evidence, more, "rule-sets")
    said = f"Without the runs on one rule set, {estimate_text(one.found)} ({one.verdict})."
    return f"{said} {success_at_both_ends(evidence, runs)}"


def fall_over_all_runs(evidence: Evidence, runs: pd.DataFrame) -> str:
    """Where success falls with more rule sets over all runs, that it does."""
    (one,) = tested(evidence.ungated, rows_of("numbers of rule sets", evidence.ungated), "rule-sets-unseen")
    falls = one.found.estimate < 0 and is_significant(one.found)
    return f"Over all runs, it falls: {estimate_text(one.found)}." if falls else ""


def what_each_adds(evidence: Evidence, runs: pd.DataFrame, claim: str) -> str:
    """What the measures of either side of a difference of R² add to the R² of panel and n."""
    (test,) = STATEMENTS["claims"][claim]["tests"]
    parts = (["cell"], test["by"], test["less"])
    alone, by, less = (explained(column(runs, test["of"]), matrix(runs, names)) for names in parts)
    return f"Panel and n explain {alone:.3f} of the variance; these add {by - alone:.3f}, exact W2 {less - alone:.3f}."


def each_platform(evidence: Evidence, turns: pd.DataFrame) -> str:
    """By how much SEGAR is faster than the nearest and the farthest of the other platforms."""
    factors = 10 ** turns.groupby("platform", dropna=False)["faster"].median()
    return f"SEGAR is {min(factors):,.0f} to {max(factors):,.0f} times as fast as each of {len(factors)} platforms (medians)."


AT_EACH_N = ("4b-factors", "matched-w2", "matched-coverage", "states-w2", "states-coverage", "dose-w2", "dose-coverage")
# Numbers that the sentences of a claim name in braces, from its evidence and rows.
NUMBERS: Mapping[str, Callable[[Evidence, pd.DataFrame], Mapping[str, str]]] = {"A-ks": slope_of_ks}
# What is said after the sentence of a claim's verdict, with numbers from its evidence and rows.
BESIDE: Mapping[str, Callable[[Evidence, pd.DataFrame], str]] = {
    "light": each_platform,
    "3a": partial(without_one_level, claim="3a"),
    "3a-cell": partial(without_one_level, claim="3a-cell"),
    "3a-agent": agents_that_learned,
    "4a-trend": partial(without_one_level, claim="4a-trend"),
    **{name: partial(at_each_n, claim=name) for name in AT_EACH_N},
    **{name: partial(what_each_adds, claim=name) for name in ("D-exogenous", "D-policies")},
    "A-sac-easy": partial(seen_before, claim="A-sac-easy", difficulty="easy"),
    "A-sac-hard": partial(seen_before, claim="A-sac-hard", agent=SAC),
    "rule-sets": without_one_rule_set,
    "rule-sets-unseen": fall_over_all_runs,
}
