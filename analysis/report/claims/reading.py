"""Reads the claims: the words of each from ``statements.yaml``, its findings from its test."""

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from analysis.report.claims import gap, information, learning, rule_sets
from analysis.report.claims.claim import ALL_RUNS, METRIC_2022, METRIC_OURS, OF_PAPER, Claim, Finding, tests_counted
from analysis.report.claims.evidence import GIVEN_CELL, Evidence
from analysis.report.claims.specifications import specifications, survives

Rows = Callable[[Evidence], pd.DataFrame]
Test = Callable[[Evidence, pd.DataFrame], Iterable[Finding]]

STATEMENTS: Mapping[str, Mapping[str, Any]] = yaml.safe_load(Path(__file__).with_name("statements.yaml").read_text())

# The rows that each evidence of statements.yaml stands for.
ROWS: Mapping[str, Rows] = {
    "main grid": lambda evidence: evidence.main,
    "several seeds": gap.several_seeds,
    "one number of levels": gap.one_number_of_levels,
    "matched sets": gap.matched_sets,
    "the paper's agent": gap.papers_agent,
    "harder levels": lambda evidence: evidence.results.harder,
    "probes": lambda evidence: information.accuracies(evidence.results, evidence.main),
    "self-supervised agents": lambda evidence: evidence.results.of("figure_5a"),
    "probes of self-supervised agents": information.self_supervised_probes,
    "masses": lambda evidence: evidence.results.masses,
    "probes with masses": information.probes_with_masses,
    "SAC": lambda evidence: evidence.results.of("appendix_sac"),
    "distances without training": learning.distances_of_empty,
    "numbers of rule sets": rule_sets.rule_set_runs,
    "ten rule sets": rule_sets.runs_on_ten,
    "trials": rule_sets.trial_runs,
}

# The test of each claim of statements.yaml: its findings, from the evidence and the rows of its evidence.
TESTS: Mapping[str, Test] = {
    "3a": partial(gap.in_main_grid, test="pooled"),
    "3a-panel": partial(gap.in_main_grid, test="given panel"),
    "3a-n": partial(gap.in_main_grid, test="given panel and n"),
    "3a-cell": partial(gap.in_main_grid, test=GIVEN_CELL),
    "3a-agent": gap.of_papers_agent,
    "fixed-n": gap.at_one_number,
    "matched-w2": partial(gap.of_pairs, pairs=gap.FAR, words="farther less not farther, equal coverage and diversity"),
    "matched-coverage": partial(gap.of_pairs, pairs=gap.SPARSE, words="worse coverage less not worse, equal W2"),
    "3b-trend": partial(gap.in_panels, sign=gap.WORSE, difficulties=("medium", "hard")),
    "3b-easy": partial(gap.in_panels, sign=0, difficulties=("easy",)),
    "3b-empty": gap.in_empty,
    "3b-weak": partial(gap.in_panels, sign=0, families=("objectsx1", "tilesx1")),
    "4a-larger": gap.larger_on_harder_levels,
    "4a-shift": gap.cost_of_shift,
    "4a-trend": gap.trend_to_hard,
    "4a-all": gap.each_pair_of_panels,
    "4b-train": information.train_above_test,
    "4b-none": information.relation_to_gap,
    "5a-gap": information.gap_beside_ppo,
    "5a-similar": information.success_beside_ppo,
    "5a-trends": information.trends_of_auxiliary,
    "5b-diversity": learning.diversity_above_panel,
    "5b-easy": learning.easier_tasks_first,
    "A-mass": information.mass_shown_beside_hidden,
    "A-flip": information.trend_by_mass,
    "A-sac-easy": learning.sac_beside_ppo,
    "A-sac-hard": learning.sac_easy_beside_hard,
    "A-ks": learning.rate_of_ks,
    "rule-sets": rule_sets.gap_by_rule_sets,
    "rule-sets-unseen": rule_sets.success_by_rule_sets,
    "rule-set-distance": rule_sets.gap_by_distance,
    "memory": rule_sets.memory_beside_none,
}
# Numbers that the sentences of a claim name in braces, from its evidence and rows.
NUMBERS: Mapping[str, Callable[[Evidence, pd.DataFrame], Mapping[str, str]]] = {"A-ks": learning.slope_of_ks}
# What is said after the sentence of a claim's verdict, with numbers from its evidence and rows.
BESIDE: Mapping[str, Callable[[Evidence, pd.DataFrame], str]] = {
    "3a": partial(gap.without_one_level, given=()),
    "3a-cell": partial(gap.without_one_level, given=("cell",)),
    "3a-agent": gap.agents_that_learned,
    "4a-trend": gap.trend_without_one_level,
    "matched-w2": partial(gap.second_outcomes_in_words, pairs=gap.FAR),
    "matched-coverage": partial(gap.second_outcomes_in_words, pairs=gap.SPARSE),
    "5b-diversity": learning.both_r2,
    "A-sac-hard": learning.sac_in_other_ways,
    "rule-sets": rule_sets.gap_in_words,
}
# What is said after that, from the claim's own tests; those of several panels are counted.
OF_TESTS: Mapping[str, Callable[[Claim], str]] = {
    **dict.fromkeys(("3b-trend", "3b-easy", "3b-weak", "4a-all"), tests_counted),
    "rule-sets-unseen": rule_sets.fall_over_all_runs,
}


def read_claims(evidence: Evidence) -> list[Claim]:
    """All claims with their findings, in the order of ``statements.yaml``."""
    table = specifications(evidence)
    return [read_claim(name, evidence, survives(table, name)) for name in STATEMENTS["claims"]]


def read_claim(name: str, evidence: Evidence, survives: bool = True) -> Claim:
    """The claim with its findings, and what follows from its verdicts; or what it takes to test it.

    Args:
        survives: whether the claim's specifications agree with it.
    """
    words, needs = STATEMENTS["claims"][name], STATEMENTS["evidence"]
    rows = ROWS[words["evidence"]](evidence)
    leading = (dataclasses.replace(one, survives=survives) for one in findings_of(name, evidence))
    of_all = (dataclasses.replace(one, runs=ALL_RUNS) for one in findings_of(name, evidence.ungated))
    claim = Claim(
        name,
        words["says"],
        words["where"],
        (*leading, *of_all),
        note=words.get("note", ""),
        of=words.get("of", OF_PAPER),
    )
    follows = consequence(claim, words)
    if not follows:
        lacks = words.get("else_needs", words["evidence"]) if len(rows) else words["evidence"]
        return claim.with_words(needs=needs[lacks])
    said = follows.format(**NUMBERS[name](evidence, rows)) if name in NUMBERS else follows
    beside = BESIDE[name](evidence, rows) if name in BESIDE else ""
    of_tests = OF_TESTS[name](claim) if name in OF_TESTS else ""
    return claim.with_words(follows=" ".join(filter(None, (said, beside, of_tests))))


def findings_of(name: str, evidence: Evidence) -> list[Finding]:
    """The findings of a claim's test; none where the runs that it is about are missing."""
    rows = ROWS[STATEMENTS["claims"][name]["evidence"]](evidence)
    return list(TESTS[name](evidence, rows)) if len(rows) else []


def consequence(claim: Claim, words: Mapping[str, str]) -> str:
    """The sentences for the claim's verdicts: one where both readings agree, else one for each; "" where there is none."""
    read = {settings: claim.verdict(settings) for settings in (METRIC_2022, METRIC_OURS) if claim.has(settings)}
    sentences = {settings: words.get(verdict.replace(" ", "_"), "") for settings, verdict in read.items()}
    if len(set(read.values())) > 1:
        return " ".join(f"{settings.capitalize()}: {text}" for settings, text in sentences.items() if text)
    return next(iter(sentences.values()), "")
