"""The core of suites that the rules of decisions 0041 and 0050 choose, from success on frozen test levels.

``python docs/site/core.py`` reads ``docs/results/core/scores.csv``, by which the core was chosen; ``panel.csv``, what ``segar
benchmark panel=true`` found on the five suites that it had not played; and ``by_time.csv``, the runs of decision 0051. It
writes ``suites.csv``, ``core.png`` and the page ``findings.md`` beside them.
"""

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from segar.analysis.benchmark.leaderboard_page import (
    SEEDS,
    TRUSTED_COEFFICIENT,
    interval,
    markdown,
    number,
    place_text,
    repetition_tables,
)
from segar.analysis.benchmark.scores import DRAWN, PRACTICE, WEIGHTED
from segar.analysis.plotting import style
from segar.analysis.plotting.figures import legend_below, new_figure, save_figure, zero_line
from segar.analysis.stats.estimate import mean_of_replicates
from segar.analysis.stats.ranking import MOST_SUITES, Generalizability, generalizability, places
from segar.suites import outline

FOLDER = Path(__file__).parents[1] / "results" / "core"
LEARNERS = {
    "imitation": "imitation",
    "ppg_fast-state-laptop": "PPG",
    "ppo_fast-plr_fast-state-laptop": "PPO, PLR",
    "ppo_fast-state-laptop": "PPO",
    "ppo_fast-wide-state-laptop": "PPO, wide",
    "sac_fast-state-laptop": "SAC",
    "tqc": "TQC",
}
FIRST_HALF, SECOND_HALF = range(1, 6), range(6, 11)  # seeds by which the core is chosen; and by which it is confirmed
OF_THEIR_KIND = (("place-pockets-v1",), ("sight-ball-v1",), ("goal-bank-v1", "goal-errand-v1"))
FEWEST, MOST, TOO_EASY = 12, 14, 0.95
KEYS = ["row", "suite", "seed"]
SPREAD = 0.7  # of the width of a suite, over which learners stand side by side


def scores() -> pd.DataFrame:
    """One line per learner, suite and seed; none on ``sight-mass-v1``, which has the test levels of ``property-heavy-v1``."""
    return pd.read_csv(FOLDER / "scores.csv").replace({"row": LEARNERS}).sort_values(KEYS, ignore_index=True)


def halves(table: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame, int]:
    """The lines of the first half of the seeds; those of the second, none before all its runs are there; and how many are."""
    first, second = (table[table["seed"].isin(half)] for half in (FIRST_HALF, SECOND_HALF))
    return first, second if len(second) == len(first) else second.head(0), len(second)


def agreement(table: pd.DataFrame, suites: list[str], value: str = PRACTICE) -> Generalizability:
    """Variance components and coefficient of success above chance on these suites; every learner played them all."""
    found = generalizability(table[table["suite"].isin(suites)], value, *KEYS)
    assert found is not None
    return found


def described(table: pd.DataFrame) -> pd.DataFrame:
    """Of each suite its best learner, with Student's interval, whether it counts (rule 2), and the share of methods in its
    variance, beside that of training levels and of runs."""
    lines = []
    for name, part in table.groupby("suite"):
        values = part.pivot(index="seed", columns="row", values=PRACTICE)
        seeds, methods = values.shape
        best = str(values.mean().idxmax())
        found = mean_of_replicates(values[best].to_numpy())
        rest = (values - values.mean()).sub(values.mean(axis=1), axis=0) + values.to_numpy().mean()
        error = float((rest**2).to_numpy().sum()) / ((seeds - 1) * (methods - 1))
        of_methods = max(float(values.mean().var()) - error / seeds, 0.0)
        of_levels = max(float(values.mean(axis=1).var()) - error / methods, 0.0)
        lines.append({
            "suite": str(name), "axis": outline(str(name))["axis"], "best": best, "success": found.estimate,
            "low": found.low, "high": found.high, "counts": found.low > 0 and found.estimate <= TOO_EASY,
            "methods_share": of_methods / (of_methods + of_levels + error),
        })  # fmt: skip
    return pd.DataFrame(lines)


def chosen(table: pd.DataFrame, suites: pd.DataFrame) -> list[str]:
    """The core by rule 3: the suites that it begins with, and those by which it grows, in their order."""
    counts = suites[suites["counts"]].sort_values("methods_share", ascending=False)
    core = [*counts.drop_duplicates("axis")["suite"]]
    for kind in OF_THEIR_KIND:
        if not {*kind} & {*core}:
            core += [*counts[counts["suite"].isin(kind)]["suite"]][:1]
    while len(core) < MOST and len(core) < len(counts):
        larger = {
            one: agreement(table, [*core, one]).coefficient.estimate for one in counts["suite"] if one not in core
        }
        best = max(larger, key=lambda one: larger[one])
        if len(core) >= FEWEST and larger[best] <= agreement(table, core).coefficient.estimate:
            break
        core.append(best)
    return core


def page(table: pd.DataFrame, suites: pd.DataFrame, core: list[str]) -> str:
    """The page in Markdown."""
    first, second, there = halves(table)
    panel = pd.read_csv(FOLDER / "panel.csv")
    used, timed = pd.concat([first, second]), pd.read_csv(FOLDER / "by_time.csv")
    found, every = agreement(first, core), agreement(first, [*suites["suite"]])
    lines = [
        [
            "–" if pd.isna(one["place"]) else str(int(one["place"])), f"`{one['suite']}`", one["axis"], one["best"],
            interval(one | {"estimate": one["success"]}), "yes" if one["counts"] else "no",
            number(one["methods_share"]),
        ]
        for one in suites.to_dict("records")
    ]  # fmt: skip
    head = ["place", "suite", "axis", "best learner", "its success above chance", "counts", "share of methods"]
    in_core = used[used["suite"].isin(core)]
    parts = repetition_tables(in_core.assign(**{DRAWN: in_core[PRACTICE]}), agreement(used, core))
    if len(second):
        again = agreement(second, core)
        says = CONFIRMED.format(verdict=verdict(again), here=interval(vars(again.coefficient)), first=verdict(found))
    else:
        says = OPEN.format(there=there, runs=len(first), first=verdict(found))
    return TEXT.format(
        says=says, trusted=TRUSTED_COEFFICIENT, here=interval(vars(found.coefficient)), all=interval(vars(every.coefficient)),
        methods=found.methods, n=len(core), candidates=len(suites), suites=markdown(head, lines, texts=4),
        rows=placed(in_core, PRACTICE, "success above chance"), components=parts["components"], needed=parts["needed"],
        seeds="ten" if len(second) else "five", others=other_outcomes(used, second, core), weighted=weighted_by_time(timed),
        replay=reached(panel, "replay of the practice plans"), nearest=reached(panel, "plan of the nearest training level"),
    )  # fmt: skip


def placed(table: pd.DataFrame, value: str, words: str) -> str:
    """The learners by their places, with their means over suites and Student's intervals over seeds."""
    means = table.groupby(["row", "seed"])[value].mean().unstack("row")
    lines = [
        [str(row), place_text(place), interval(vars(mean_of_replicates(means[row].to_numpy())))]
        for row, place in sorted(places(means).items(), key=lambda one: (one[1], one[0]))
    ]
    return markdown(["learner", "place", words], lines)


def weighted_by_time(runs: pd.DataFrame) -> str:
    """What decision 0051 says of success weighted by time; no number is looked at before all runs of the learners are there."""
    runs = runs[runs["row"].isin(LEARNERS)].replace({"row": LEARNERS})
    suites, seeds = runs["suite"].nunique(), runs["seed"].nunique()
    if len(runs) < (whole := len(LEARNERS) * suites * seeds):
        return f"No verdict yet: {len(runs)} of {whole} runs are there.\n"
    found = agreement(runs, [*runs["suite"]], WEIGHTED)
    return WEIGHTED_TEXT.format(
        verdict=verdict(found), here=interval(vars(found.coefficient)), methods=found.methods, suites=suites,
        first=runs["seed"].min(), last=runs["seed"].max(), trusted=TRUSTED_COEFFICIENT,
        rows=placed(runs, WEIGHTED, "success weighted by time"),
        needed=repetition_tables(runs.assign(**{DRAWN: runs[WEIGHTED]}), found)["needed"],
    )  # fmt: skip


def other_outcomes(used: pd.DataFrame, second: pd.DataFrame, core: list[str]) -> str:
    """How many suites name the winner by score and by time (rule 5), of those on which every run has a number. Empty before the
    second half is there."""
    lines = []
    for name, column, part in (("score", "score", used), ("time, seeds 6 to 10", "steps", second)):
        lacking = {*part.loc[part[column].isna(), "suite"]} if len(second) else {*core}
        suites = [one for one in core if one not in lacking]
        if len(suites) > 1:
            found = agreement(part, suites, column)
            words = [str(found.suites_needed(seeds) or f"more than {MOST_SUITES}") for seeds in SEEDS]
            lines.append([name, str(len(suites)), interval(vars(found.coefficient)), *words])
    head = ["outcome", "suites", "coefficient", *(f"suites needed, {seeds} seeds" for seeds in SEEDS)]
    return (
        f"By other outcomes, on the suites on which every run has a number:\n\n{markdown(head, lines)}" if lines else ""
    )


def reached(panel: pd.DataFrame, player: str) -> str:
    """From where to where a player of the panel stands on drawn levels."""
    drawn = panel.loc[panel["player"] == player, "drawn"]
    return f"{number(drawn.min(), 3)} to {number(drawn.max(), 3)}"


def verdict(found: Generalizability) -> str:
    """What rule 4 says of a core."""
    return "ranks" if found.coefficient.low >= TRUSTED_COEFFICIENT else "does not rank"


CONFIRMED = """**On seeds 6 to 10, which chose nothing, the core {verdict} these learners:** their coefficient of
generalizability is {here}. On seeds 1 to 5, by which it was chosen, it {first} them."""
WEIGHTED_TEXT = """**Success weighted by time {verdict} these learners:** of {methods} learners, {suites} suites
and seeds {first} to {last} the coefficient of generalizability is {here}; a ranking needs a lower end of {trusted}.

{rows}
In planted tables with these components, the best method has the highest mean in 9 of 10 repetitions with so many suites:

{needed}"""
OPEN = """**On seeds 1 to 5 the chosen core {first} these learners.** Nothing is confirmed: of the {runs} runs of seeds 6 to 10,
{there} are there, and no rule looks at them before all are."""
TEXT = """# Which suites make a core that ranks

{says}
On seeds 1 to 5 the coefficient of generalizability of {methods} learners on the {n} suites of the core is {here}; a ranking
needs a lower end of {trusted}. On all {candidates} candidates it is {all}.

The rules are those of decisions [0041](../../decisions/0041-how-a-core-of-suites-is-chosen.md) and
[0050](../../decisions/0050-a-core-in-nine-hours.md), which were written before the runs on the nine suites that are new here.
Outcome is success above chance on the frozen test levels, (s - random) / (planner - random). Every learner saw states and
200,000 frames on each suite with each seed. `python docs/site/core.py` makes this page from [`scores.csv`](scores.csv), which
does not follow later rows of the benchmark; `make check-results` makes it again.

Of the players that admit a suite, the planner solves all frozen test levels of `goal-faster-v1`, `kind-swapped-v1`,
`place-other-way-v1`, `property-light-v1` and `sight-charge-v1`, and random play 0.13 to 0.15 of them. On 1,000 drawn levels of
each ([`panel.csv`](panel.csv), by `segar benchmark panel=true`), replayed plans stand at {replay} above chance, and the plan
of the nearest training level at {nearest}.

![Success above chance of each learner on each candidate, one point for each seed](core.png)

## The suites

The core begins with that suite of each axis in whose variance methods have the largest share, and with one of Billiards, of
Invisiball, and of things that must be done in order. It grows by the suites that raise the coefficient most. A suite counts
where its best learner is above chance and at most at 0.95. Square brackets hold Student's intervals of 95 % over five seeds.

{suites}
## The learners on this core

Means over its suites and {seeds} seeds. Rows that no paired test over seeds separates (Student's, Holm-corrected, 5 %)
share their places.

{rows}
## Would other seeds and suites say the same?

{components}
In planted tables with these components, the best method has the highest mean in 9 of 10 repetitions with so many suites:

{needed}
{others}
## Success weighted by time

The mean over frozen test levels of the planner's steps over the method's, at most 1, and of 0 where it fails (Yokoyama et al.
2021). It was picked after its result was known, so
[decision 0051](../../decisions/0051-success-weighted-by-time.md) named, before they were trained, the runs that decide: the
suites of version 1 for agents that see states, and seeds that had no row ([`by_time.csv`](by_time.csv)).

{weighted}"""


def figure(table: pd.DataFrame, suites: pd.DataFrame) -> Figure:
    """Success above chance, one point for each learner and seed, side by side on each suite, in the order of the table."""
    names = [*suites["suite"]]
    with style.applied():
        drawn = new_figure(11.0, 5.0)
        axes = drawn.subplots()
        colours, markers = style.colours(LEARNERS.values()), style.markers(LEARNERS.values())
        for i, row in enumerate(LEARNERS.values()):
            part = table[table["row"] == row]
            at = np.array([names.index(one) for one in part["suite"]]) + SPREAD * ((i + 0.5) / len(LEARNERS) - 0.5)
            axes.plot(at, part[PRACTICE], markers[row], color=colours[row], markersize=3.5, label=row)
        zero_line(axes)
        axes.axvline(suites["place"].notna().sum() - 0.5, color="#999999", linewidth=0.8)
        axes.set_xticks(range(len(names)), names, rotation=35, ha="right")
        axes.set_xlim(-0.5, len(names) - 0.5)
        axes.grid(axis="x", visible=False)
        axes.set_ylabel("success above chance")
        legend_below(drawn, axes, len(LEARNERS))
    return drawn


def found_now() -> tuple[pd.DataFrame, pd.DataFrame, list[str]]:
    """The scores, the suites in the order of the core and then by name, and the core."""
    table = scores()
    first, *_ = halves(table)
    suites = described(first)
    core = chosen(first, suites)
    suites["place"] = [core.index(one) + 1 if one in core else np.nan for one in suites["suite"]]
    return table, suites.sort_values(["place", "suite"], ignore_index=True), core


def main() -> None:
    table, suites, core = found_now()
    suites.to_csv(FOLDER / "suites.csv", index=False, float_format="%.6g", lineterminator="\n")
    save_figure(figure(pd.concat(halves(table)[:2]), suites), FOLDER / "core", (".png",))
    (FOLDER / "findings.md").write_text(page(table, suites, core), encoding="utf-8")


if __name__ == "__main__":
    main()
