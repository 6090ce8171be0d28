"""The tests of the claims about the gap and W2: figures 3a, 3b and 4a, and the questions that we add."""

from collections import Counter
from collections.abc import Iterator

import pandas as pd

from analysis.plotting.names import family_name, panel_name
from analysis.report.claims.claim import (
    METRIC_2022,
    METRIC_OURS,
    Finding,
    correlation,
    mean_difference,
    with_holm,
)
from analysis.report.claims.evidence import GIVEN, Evidence
from analysis.report.number_format import estimate_text, plain
from analysis.report.results import paired
from analysis.report.rules import MARGINS, WHOLE
from analysis.tables import count_of, keep, select

Pairs = tuple[tuple[str, str], ...]

WORSE = -1  # the sign of the claimed effect: the gap falls where W2 rises
# Each metric's mode of W2 and column of the gap.
SETTINGS = ((METRIC_2022, "reference", "gap_2022"), (METRIC_OURS, "exact", "gap"))
WORDS = {METRIC_2022: "W2 and returns of 2022", METRIC_OURS: "exact W2, full returns"}
CONTROL = "nuisance_only"  # a design that is one level many times
PAPER_AGENT = "paper_agent"
# Designs beside each other: farther in W2 at equal coverage and diversity, and worse in these at equal W2.
FAR = (("matched_far", "matched"), ("matched_far_sparse", "matched_sparse"))
SPARSE = (("matched_sparse", "matched"), ("matched_far_sparse", "matched_far"))
# What the rules name second: the gap in returns, and the return on test levels, which falls as the regret grows.
SECOND = {"gap": "gap in returns", "eta_test_deterministic": "return on test levels (less regret)"}
MATCHED = ["family", "difficulty", "n", "seed", "observation"]


def several_seeds(evidence: Evidence) -> pd.DataFrame:
    """The main grid if it has two seeds or more, else no rows."""
    return evidence.main if count_of(evidence.main, "seed") > 1 else evidence.main.head(0)


def one_number_of_levels(evidence: Evidence) -> pd.DataFrame:
    """The runs of one number of training levels, if they have several designs; one level many times is a control."""
    table = evidence.results.of("fixed_n")
    table = keep(table, table["design"] != CONTROL)
    return table if count_of(table, "design") > 1 else table.head(0)


def matched_sets(evidence: Evidence) -> pd.DataFrame:
    """The runs on matched sets, from pixels."""
    return evidence.results.of("matched_sets")


def papers_agent(evidence: Evidence) -> pd.DataFrame:
    """The runs of the paper's own agent, if all that were planned are there."""
    there = len(evidence.all_results.of(PAPER_AGENT)) >= WHOLE[PAPER_AGENT]
    runs = evidence.results.of(PAPER_AGENT)
    return runs if there else runs.head(0)


def left_out(everything: pd.DataFrame, learned: pd.DataFrame) -> str:
    """The runs that did not learn, by family: ``5 of Tiles of 2022``; "" where all did."""
    which = Counter(everything["family"]) - Counter(learned["family"])
    return ", ".join(f"{count} of {family_name(family)}" for family, count in which.items())


def agents_that_learned(evidence: Evidence, runs: pd.DataFrame) -> str:
    """How many runs of the paper's own agent count; "" where all do."""
    everything = evidence.all_results.of(PAPER_AGENT)
    lost = left_out(everything, runs)
    return f"{len(runs)} of {len(everything)} runs learned their training levels (without {lost})." if lost else ""


def in_main_grid(evidence: Evidence, runs: pd.DataFrame, test: str) -> Iterator[Finding]:
    """Figure 3a: the correlation over all runs, or the partial one given what the name of the test says."""
    for settings, mode, gap in SETTINGS:
        found = evidence.of_main(mode, gap, test)
        yield correlation(settings, f"{WORDS[settings]}, {test}", found, WORSE, GIVEN[test])


def of_papers_agent(evidence: Evidence, runs: pd.DataFrame) -> Iterator[Finding]:
    """Figure 3a with the paper's own agent: given panel, because its three panels are too few to be compared."""
    for settings, mode, gap in SETTINGS:
        found = evidence.correlation(runs, f"w2_{mode}", gap, ("panel",))
        yield correlation(settings, f"{WORDS[settings]}, the paper's agent, given panel", found, WORSE, "panel")


def at_one_number(evidence: Evidence, runs: pd.DataFrame) -> Iterator[Finding]:
    """What the paper's causal reading predicts where only W2 varies; with clustered sets and without them."""
    parts = {"all designs": runs, "without clustered sets": keep(runs, runs["design"] != "clustered")}
    for settings, mode, gap in SETTINGS:
        for words, part in parts.items():
            if count_of(part, "design") > 1:
                found = evidence.correlation(part, f"w2_{mode}", gap, ("panel", "levels"))
                yield correlation(settings, f"{WORDS[settings]}, at one n, given panel, {words}", found, WORSE, "panel")


def of_pairs(evidence: Evidence, runs: pd.DataFrame, pairs: Pairs, words: str) -> Iterator[Finding]:
    """The designed study: the gap in success of the first designs less that of the second ones, over pairs of runs."""
    yield from mean_difference(
        evidence, METRIC_OURS, f"gap in success, {words}", beside_designs(runs, pairs, "gap_success"), WORSE,
        MARGINS["success"],
    )  # fmt: skip


def second_outcome(evidence: Evidence, runs: pd.DataFrame, pairs: Pairs, value: str) -> Iterator[Finding]:
    """The same of one of :data:`SECOND`, if there are such pairs."""
    return mean_difference(evidence, METRIC_OURS, SECOND[value], beside_designs(runs, pairs, value), WORSE)


def second_outcomes_in_words(evidence: Evidence, runs: pd.DataFrame, pairs: Pairs) -> str:
    """All second outcomes in a sentence."""
    parts = [
        f"{one.test} {estimate_text(one.found, '')}, margin {plain(one.margin)} (by itself {one.verdict})"
        for value in SECOND
        for one in second_outcome(evidence, runs, pairs, value)
    ]
    return f"The second outcomes, which decide nothing: {'; '.join(parts)}." if parts else ""


def without_one_level(evidence: Evidence, runs: pd.DataFrame, given: tuple[str, ...]) -> str:
    """What is left of a correlation of the main grid without the runs with one training level."""
    part = keep(runs, runs["n"] > 1)
    if part.empty or len(part) == len(runs):
        return ""
    found = [
        correlation(settings, "", evidence.correlation(part, f"w2_{mode}", gap, given), WORSE, given)
        for settings, mode, gap in SETTINGS
    ]
    said = [f"{estimate_text(one.found)} ({one.settings}: {one.verdict})" for one in found]
    return f"Without the runs with one training level, {' and '.join(said)}."


def trend_without_one_level(evidence: Evidence, harder: pd.DataFrame) -> str:
    """What is left of the trend from medium to hard without the runs with one training level."""
    parts = from_medium(keep(harder, harder["n"] > 1))
    found = {
        family: correlation(METRIC_OURS, "", evidence.correlation(part, "w2_exact", "gap"), WORSE)
        for family, part in parts.items()
        if len(part)
    }
    said = [f"in {family_name(family)}, {estimate_text(one.found)} ({one.verdict})" for family, one in found.items()]
    return f"Without the runs with one training level ({METRIC_OURS}): {'; '.join(said)}." if said else ""


def beside_designs(runs: pd.DataFrame, pairs: Pairs, value: str) -> pd.DataFrame:
    """The runs of the first design of each pair with ``difference``: their value less that of the second one's run."""
    parts = [paired(select(runs, design=a), select(runs, design=b), value, MATCHED) for a, b in pairs]
    return pd.concat(parts, ignore_index=True)


def in_panels(
    evidence: Evidence,
    runs: pd.DataFrame,
    sign: int,
    difficulties: tuple[str, ...] = (),
    families: tuple[str, ...] = (),
) -> Iterator[Finding]:
    """Figure 3b: the correlation in each panel of some difficulties or families by itself; ``sign`` 0 claims that none is."""
    places = [(panel, *panel.rsplit("-", 1)) for panel in evidence.results.panels]
    panels = [p for p, f, d in places if (not difficulties or d in difficulties) and (not families or f in families)]
    for settings, mode, gap in SETTINGS:
        found = {panel: evidence.correlation(select(runs, panel=panel), f"w2_{mode}", gap) for panel in panels}
        for panel, one in (with_holm(found) if sign else found).items():
            yield correlation(settings, panel_name(panel), one, sign, corrected=sign != 0)


def in_empty(evidence: Evidence, runs: pd.DataFrame) -> Iterator[Finding]:
    """Figure 3b: the trend in the family Empty, given the difficulty."""
    part = select(runs, family="empty")
    for settings, mode, gap in SETTINGS if len(part) else ():
        found = evidence.correlation(part, f"w2_{mode}", gap, ("difficulty",))
        yield correlation(
            settings, f"{family_name('empty')}, {WORDS[settings]}, given difficulty", found, WORSE, "difficulty"
        )


def larger_on_harder_levels(evidence: Evidence, harder: pd.DataFrame) -> Iterator[Finding]:
    """Figure 4a: the gap on harder levels beside the gap of the same agent on its own test levels."""
    for settings, _, gap in SETTINGS:
        words = f"gap on harder levels less the own gap, {WORDS[settings]}"
        yield from mean_difference(evidence, settings, words, paired(harder, evidence.main, gap, ["run"]), WORSE)


def cost_of_shift(evidence: Evidence, harder: pd.DataFrame) -> Iterator[Finding]:
    """Figure 4a, once the difficulty of the levels themselves is taken out: agents beside those trained where they are
    tested."""
    at, there = ["test_family", "test_difficulty", "n", "seed"], ["family", "difficulty", "n", "seed"]
    differences = paired(harder, evidence.main, "eta_test_deterministic", at, there)
    words = "return on harder levels less that of agents trained there, same n and seed"
    return mean_difference(evidence, METRIC_OURS, words, differences, WORSE)


def trend_to_hard(evidence: Evidence, harder: pd.DataFrame) -> Iterator[Finding]:
    """Figure 4a: the trend from medium to hard."""
    for settings, mode, gap in SETTINGS:
        parts = from_medium(harder)
        found = {name: evidence.correlation(part, f"w2_{mode}", gap) for name, part in parts.items() if len(part)}
        for family, one in with_holm(found).items():
            yield correlation(settings, f"{family_name(family)}, medium to hard", one, WORSE, corrected=True)


def from_medium(harder: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The tests on hard levels of agents from medium ones, by the families that the paper names."""
    return {family: select(harder, family=family, difficulty="medium") for family in ("empty", "objectsx1")}


def each_pair_of_panels(evidence: Evidence, harder: pd.DataFrame) -> Iterator[Finding]:
    """Figure 4a's caption, which claims more than the text: the trend in each pair of panels, without exception."""
    for settings, mode, gap in SETTINGS:
        parts = {panel: select(harder, panel=panel) for panel in dict.fromkeys(harder["panel"])}
        found = {panel: evidence.correlation(part, f"w2_{mode}", gap) for panel, part in parts.items()}
        for panel, one in with_holm(found).items():
            yield correlation(settings, f"from {panel_name(panel)}", one, WORSE, corrected=True)
