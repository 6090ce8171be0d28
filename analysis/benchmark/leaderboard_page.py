"""The leaderboard as a page, made of tables alone, so that a test can make it again."""

import html
import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pandas as pd

from analysis.benchmark.causes import EFFECT, effects_on
from analysis.benchmark.scores import COMPARED, FIGURES, OVERALL, seed_spreads
from analysis.stats.scores import detectable_difference
from analysis.tables import column, keep, mean_by, select
from experiments.benchmarking.protocol import BUDGETS, REFERENCES
from experiments.benchmarking.row import Row
from segar.suites import RANDOM_PLAYS

SEEDS = (3, 5, 10)  # numbers of seeds of which the page says what they can see
WORDS = {
    "train_return": "return, training",
    "test_return": "return, test",
    "gap": "gap",
    "regret": "regret",
    "train_success": "success, training",
    "test_success": "success, test",
    "train_score": "score, training",
    "score": "score",
    EFFECT: "gained on twins",
}


def page_text(
    rows: Mapping[str, Row],
    table: pd.DataFrame,
    board: pd.DataFrame,
    improved: pd.DataFrame,
    causes: pd.DataFrame,
    suites: Mapping[str, Sequence[str]],
) -> str:
    """The page in Markdown."""
    overall = suites[OVERALL]
    parts = [HEAD.format(suites=len(overall), plays=RANDOM_PLAYS, laptop=BUDGETS["laptop"], server=BUDGETS["server"])]
    parts += ["## All suites\n", overall_table(rows, table, board, overall)]
    parts += [
        "![Score, success, and what success gains on causal twins, by axis](profile.png)\n",
        "## By axis\n",
        AXES_NOTE,
    ]
    parts += [
        f"{WORDS_OF[one]}; in brackets, how many suites there are:\n\n{axes_table(select(board, quantity=one), suites)}"
        for one in COMPARED
    ]
    parts += ["## What failures come from\n", CAUSES, causes_text(causes, suites)]
    parts += ["## Which differences can be seen\n", power_text(table, suites)]
    parts += ["## Probability of improvement\n", IMPROVEMENT]
    parts += [
        f"{WORDS_OF[one]}:\n\n{improvement_table(select(improved, quantity=one), select(board, quantity=one))}"
        for one in COMPARED
    ]
    parts += ["![Performance profiles](performance.png)\n", "## Suite by suite\n", SUITES, *suite_tables(table, suites)]
    parts += ["## Rows\n", rows_table(rows), HOW_TO]
    return "\n".join(parts)


HEAD = """# Leaderboard

What methods achieve on suites ([how to read it, and how to add a row](../../how-to/compare-on-a-suite.md)). A *score* is a
ratio of means over the levels: 0 where the mean return is that of the better of idle and random play on each level ({plays}
random episodes per level and seed), 1 where it is that of the planner, which searches in the simulator. Returns are shaped,
so that a ball that stops near the goal has a high score; *success*, the share of levels that are solved, stands beside it.
All numbers are of one episode on each of the frozen test levels, without noise in the actions.
Square brackets hold 95 % intervals of the stratified bootstrap over seeds; suites are fixed. The mean is the interquartile
mean (IQM) over suites and seeds. The budget `laptop` is {laptop:,} frames of training on each suite with each seed, `server`
{server:,}. Every row can be played again to the bit.

This page is made from the tables beside it by `python -m experiments.benchmark table=true rows=docs/results/benchmark`.
"""
AXES_NOTE = """`all` leaves out suites of textures, the axis `look`, which agents that see states cannot play.
"""
IMPROVEMENT = """The probability that a run of the row is above a run of the column, mean over the suites; ties count half.
"""
CAUSES = """A *causal twin* is a test level in which one group of factors is set as a training level has it, and nothing else
([more](../../how-to/compare-on-a-suite.md#ask-why-an-agent-fails)). The numbers are what success gains on twins: how
much of the failures comes from this group. Below 0, the test is easier in this group than training. Bold groups differ
between training and test; `all` sets all of those together, and is what the profile shows where several differ. The
other groups are controls, in which training and test are alike; what they gain is chance. Means over seeds, with
Student's 95 % intervals. Suites in which training and test have one distribution have no twins, and the references did
not play any.
"""
POWER = """Two rows must differ by so much for Student's test to find it with a probability of 0.8 at the level of 5 %, by how
the seeds of the trained rows here differ. Smaller differences between two rows say nothing.

"""
SUITES = """Means over seeds. *Gap*: return on test levels minus that on training levels. *Regret*: what the return on test
levels lacks of the planner's. *Score*: on test levels. *Gained on twins*: success on twins in which all that differs is as in
training, minus success on test levels.
"""
HOW_TO = """
## Add a row

```sh
python -m experiments.benchmark suite=core budget=laptop algorithm=my_lab.learner:MyConfig seeds=5 rows=docs/results/benchmark
python -m experiments.benchmark suite=core policy=my_lab.method:policy row=mine seeds=5 rows=docs/results/benchmark
python -m experiments.benchmark suite=core actions=FOLDER row=mine seeds=5 rows=docs/results/benchmark
python -m experiments.benchmark verify=all rows=docs/results/benchmark
```

The first command trains an algorithm of your own, the second one plays a method that was trained elsewhere and records its
actions, the third one takes files of actions. Add the folder of the row and this page in a pull request; tests play it again.
"""


WORDS_OF = {"score": "Score on test levels", "test_success": "Success on test levels"}


def markdown(head: Sequence[str], lines: Iterable[Sequence[str]], texts: int = 1) -> str:
    """A table in Markdown, whose first columns are text and the others numbers."""
    rule = ["---"] * texts + ["--:"] * (len(head) - texts)
    return "\n".join(f"| {' | '.join(line)} |" for line in [head, rule, *lines]) + "\n"


def escaped(text: str) -> str:
    """A text from the file of a row as Markdown shows it, on one line, whatever characters it has."""
    return re.sub(r"[\\`|*\[\]]", r"\\\g<0>", " ".join(html.escape(text, quote=False).split()))


def number(value: float, digits: int = 2) -> str:
    """A number as the page has it; a dash where there is none. No zero has a sign."""
    if pd.isna(value):
        return "–"
    return f"{round(float(value), digits) + 0.0:.{digits}f}"


def interval(line: Mapping[str, float]) -> str:
    """An estimate with its interval; without one where seeds do not differ."""
    if line["low"] == line["high"] or pd.isna(line["low"]):
        return number(line["estimate"])
    return f"{number(line['estimate'])} [{number(line['low'])}, {number(line['high'])}]"


def overall_table(rows: Mapping[str, Row], table: pd.DataFrame, board: pd.DataFrame, suites: Sequence[str]) -> str:
    """Each row on all suites, best first, and which rows lack a suite."""
    lines = []
    found = select(board, axis=OVERALL, quantity="score")
    successes = {one["row"]: one for one in select(board, axis=OVERALL, quantity="test_success").to_dict("records")}
    for line in found.to_dict("records"):
        own = keep(table, (table["row"] == line["row"]) & table["suite"].isin(list(suites)))
        means = [number(float(np.nanmean(column(own, name)))) for name in ("train_score", "train_success")]
        success = interval(successes[line["row"]])
        lines.append([f"`{line['row']}`", interval(line), success, *means, str(line["seeds"])])
    text = markdown(["row", "score (IQM)", "success (IQM)", "score, training", "success, training", "seeds"], lines)
    lacking = [
        f"`{name}` ({len({*row.suites()} & {*suites})} of {len(suites)} suites)"
        for name, row in rows.items()
        if name not in {*found["row"], *REFERENCES}
    ]
    return text + (f"\nNot compared, because suites are missing: {', '.join(lacking)}.\n" if lacking else "")


def axes_table(board: pd.DataFrame, suites: Mapping[str, Sequence[str]]) -> str:
    """One quantity of each row on each axis."""
    parts = {axis: {one["row"]: one for one in select(board, axis=axis).to_dict("records")} for axis in suites}
    names = list(dict.fromkeys([*parts[OVERALL], *board["row"]]))
    lines = [
        [f"`{name}`", *(interval(part[name]) if name in part else "–" for part in parts.values())] for name in names
    ]
    return markdown(["row", *(f"{axis} ({len(members)})" for axis, members in suites.items())], lines)


def causes_text(causes: pd.DataFrame, suites: Mapping[str, Sequence[str]]) -> str:
    """What success gains on the twins of each group of each suite, a column per row that played them."""
    members = [name for axis, names in suites.items() if axis != OVERALL for name in names]
    found = {name: effects_on(name, causes) for name in members if name in set(causes["suite"])}
    if not found:
        return "No row here played twins yet.\n"
    rows = sorted({row for effects in found.values() for row in effects["row"]})
    lines = []
    for name, effects in found.items():
        for (group, differs), part in effects.groupby(["group", "differs"], sort=False, dropna=False):  # type: ignore[misc]
            of = {one["row"]: one for one in part.to_dict("records")}
            cells = [interval(_as_estimate(of[row])) if row in of else "–" for row in rows]
            lines.append([name, f"**{group}**" if differs else group, *cells])
    return markdown(["suite", "group", *(f"`{row}`" for row in rows)], lines, texts=2)


def _as_estimate(line: Mapping[str, float]) -> dict[str, float]:
    return {name: line[f"effect{end}"] for name, end in (("estimate", ""), ("low", "_low"), ("high", "_high"))}


def power_text(table: pd.DataFrame, suites: Mapping[str, Sequence[str]]) -> str:
    """The smallest differences that numbers of seeds can see, by the spread of the seeds of these rows."""
    lines = []
    for quantity in COMPARED:
        spreads = seed_spreads(table, suites[OVERALL], quantity)
        if spreads.empty:
            return "There is no trained row with two seeds yet.\n"
        mean_of_squares, largest = float((spreads**2).mean()), float(spreads.max())
        deviations = (mean_of_squares**0.5, largest, (mean_of_squares / len(spreads)) ** 0.5)
        for seeds in SEEDS:
            found = [number(detectable_difference(one, seeds)) for one in deviations]
            lines.append([WORDS_OF[quantity], str(seeds), *found, number(deviations[0])])
    head = [
        "",
        "seeds of each row",
        "one suite",
        "the suite that varies most",
        "mean of all suites",
        "standard deviation, one suite",
    ]
    return POWER + markdown(head, lines)


def improvement_table(improved: pd.DataFrame, board: pd.DataFrame) -> str:
    """Each row against each other one."""
    names = list(select(board, axis=OVERALL)["row"])
    pairs = {(one["row"], one["over"]): one for one in improved.to_dict("records")}
    lines = [
        [f"`{name}`", *(interval(pairs[name, other]) if other != name else "" for other in names)] for name in names
    ]
    return markdown(["", *(f"`{name}`" for name in names)], lines)


def suite_tables(table: pd.DataFrame, suites: Mapping[str, Sequence[str]]) -> list[str]:
    """A table for each suite."""
    names = [name for axis, members in suites.items() if axis != OVERALL for name in members]
    return [f"### {name}\n\n{rows_on(name, table)}" for name in names]


def rows_on(name: str, table: pd.DataFrame) -> str:
    """The means over seeds of each row that played a suite, best first."""
    means = mean_by(table.loc[table["suite"] == name], ["row"], FIGURES)
    means = means.assign(row=[f"`{row}`" for row in means["row"]])
    return means_table(means.sort_values("score", ascending=False, kind="stable"), "row")


def suite_table(table: pd.DataFrame) -> str:
    """The means of one row on each suite that it played."""
    return means_table(mean_by(table, ["suite"], FIGURES), "suite")


def means_table(means: pd.DataFrame, of: str) -> str:
    """A line for each value of the column ``of``, with all figures."""
    lines = [[str(one[of]), *(number(one[name]) for name in FIGURES)] for one in means.to_dict("records")]
    return markdown([of, *(WORDS[one] for one in FIGURES)], lines)


def rows_table(rows: Mapping[str, Row]) -> str:
    """What each row is of, and its hash."""
    lines = []
    for name, row in sorted(rows.items(), key=lambda one: (one[0] not in REFERENCES, one[0])):
        seeds = sorted({piece.seed for piece in row.pieces})
        suites = str(len(row.suites()))
        lines.append([f"`{name}`", escaped(row.method.says), suites, f"{seeds[0]} to {seeds[-1]}", f"`{row.hash}`"])
    return markdown(["row", "what it is", "suites", "seeds", "hash"], lines)
