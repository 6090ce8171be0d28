"""Reads the claims: the words of each from ``statements.yaml``, its findings from its test."""

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from analysis.report.claims import gap, information, learning, verdicts
from analysis.report.claims.claim import CORRECTED, PAPER, Claim, Finding
from analysis.report.claims.evidence import GIVEN_CELL, Evidence

Rows = Callable[[Evidence], pd.DataFrame]
Test = Callable[[Evidence, pd.DataFrame], Iterable[Finding]]

STATEMENTS: Mapping[str, Mapping[str, Any]] = yaml.safe_load(Path(__file__).with_name("statements.yaml").read_text())

# The rows that each evidence of statements.yaml stands for.
ROWS: Mapping[str, Rows] = {
    "main grid": lambda evidence: evidence.main,
    "several seeds": gap.several_seeds,
    "one number of levels": gap.one_number_of_levels,
    "harder levels": lambda evidence: evidence.results.harder,
    "probes": lambda evidence: information.accuracies(evidence.results, evidence.main),
    "self-supervised agents": lambda evidence: evidence.results.of("figure_5a"),
    "probes of self-supervised agents": information.self_supervised_probes,
    "masses": lambda evidence: evidence.results.masses,
    "probes with masses": information.probes_with_masses,
    "SAC": lambda evidence: evidence.results.of("appendix_sac"),
    "distances without training": learning.distances_of_empty,
}

# The test of each claim of statements.yaml: its findings, from the evidence and the rows of its evidence.
TESTS: Mapping[str, Test] = {
    "3a": gap.pooled,
    "3a-panel": partial(gap.controlled, test="given panel"),
    "3a-n": partial(gap.controlled, test="given panel and log n"),
    "3a-cell": partial(gap.controlled, test=GIVEN_CELL),
    "fixed-n": gap.at_one_number,
    "3b-trend": partial(gap.in_panels, judge=gap.of_worse_gap, difficulties=("medium", "hard")),
    "3b-easy": partial(gap.in_panels, judge=verdicts.of_absence, difficulties=("easy",)),
    "3b-empty": gap.in_empty,
    "3b-weak": partial(gap.in_panels, judge=gap.of_weak_trend, families=("objectsx1", "tilesx1")),
    "4a-larger": gap.larger_on_harder_levels,
    "4a-shift": gap.cost_of_shift,
    "4a-trend": gap.trend_to_hard,
    "4a-all": gap.within_pairs_of_panels,
    "4b-train": information.train_above_test,
    "4b-none": information.relation_to_gap,
    "5a-gap": information.gap_beside_ppo,
    "5a-similar": information.return_beside_ppo,
    "5a-trends": information.trends_of_auxiliary,
    "5b-diversity": learning.diversity_above_panel,
    "5b-easy": learning.easier_tasks_first,
    "A-mass": information.mass_shown_beside_hidden,
    "A-flip": information.trend_by_mass,
    "A-sac-easy": learning.sac_beside_ppo,
    "A-sac-hard": learning.sac_easy_beside_hard,
    "A-ks": learning.rate_of_ks,
}
# Numbers that the sentences of a claim name in braces, from its evidence and rows.
NUMBERS: Mapping[str, Callable[[Evidence, pd.DataFrame], Mapping[str, str]]] = {"A-ks": learning.slope_of_ks}


def read_claims(evidence: Evidence) -> list[Claim]:
    """All claims of the paper with their findings, in the order of ``statements.yaml``."""
    return [read_claim(name, evidence) for name in STATEMENTS["claims"]]


def read_claim(name: str, evidence: Evidence) -> Claim:
    """The claim with its findings, and what follows from its verdicts; or what it takes to test it."""
    words, needs = STATEMENTS["claims"][name], STATEMENTS["evidence"]
    rows = ROWS[words["evidence"]](evidence)
    findings = tuple(TESTS[name](evidence, rows)) if len(rows) else ()
    claim = Claim(name, words["says"], words["where"], findings, note=words.get("note", ""))
    follows = consequence(claim, words)
    if not follows:
        lacks = words.get("else_needs", words["evidence"]) if len(rows) else words["evidence"]
        return claim.with_words(needs=needs[lacks])
    return claim.with_words(follows=follows.format(**NUMBERS[name](evidence, rows)) if name in NUMBERS else follows)


def consequence(claim: Claim, words: Mapping[str, str]) -> str:
    """The sentences for the claim's verdicts: one where both readings agree, else one for each; "" where there is none."""
    read = {settings: claim.verdict(settings) for settings in (PAPER, CORRECTED) if claim.has(settings)}
    sentences = {settings: words.get(verdict.replace(" ", "_"), "") for settings, verdict in read.items()}
    if len(set(read.values())) > 1:
        return " ".join(f"{settings.capitalize()}: {text}" for settings, text in sentences.items() if text)
    return next(iter(sentences.values()), "")
