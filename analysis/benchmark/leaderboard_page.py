"""The leaderboard as a page, made of tables alone, so that a test can make it again."""

import html
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import pandas as pd

from segar.analysis.benchmark.causes import EFFECT, effects_on
from segar.analysis.benchmark.scores import (
    DRAWN,
    FIGURES,
    OVERALL,
    PRACTICE,
    TIME,
    beats_chance,
    learners_on,
    places_of,
)
from segar.analysis.stats.ranking import FEWEST_SEEDS, MOST_SUITES, Generalizability, coverage, generalizability
from segar.analysis.tables import mean_by, select
from segar.experiments.benchmarking.drawn import LEVELS
from segar.experiments.benchmarking.protocol import BUDGETS, REFERENCES
from segar.experiments.benchmarking.row import Row, commitment_of_row
from segar.suites import RANDOM_PLAYS

SEEDS = (3, 5, 10)  # numbers of seeds of which the page says what they can tell
TRUSTED_COEFFICIENT = 0.8  # from which on a ranking is one
TRIED = 10_000  # variants of a row of which somebody may keep the luckiest
WORDS = {
    DRAWN: "success above chance, drawn",
    PRACTICE: "success above chance, practice",
    TIME: "time",
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
    causes: pd.DataFrame,
    suites: Mapping[str, Sequence[str]],
    panel: pd.DataFrame | None = None,
) -> str:
    """The page in Markdown."""
    overall = suites[OVERALL]
    learners = learners_on(table, overall)
    repeated = generalizability(learners, DRAWN, "row", "suite", "seed")
    parts = [HEAD.format(plays=RANDOM_PLAYS, levels=LEVELS, **{one: BUDGETS[one] for one in ("laptop", "server")})]
    parts += [ranking_text(repeated), "## All suites\n", overall_table(rows, table, board, overall)]
    parts += ["## Practice test only\n", PRACTICE_ONLY, practice_table(rows, board), chance_text(table, suites)]
    if panel is not None:
        parts += ["## Panel\n", PANEL, panel_table(panel)]
    parts += [
        "![Success above chance, score, and what success gains on causal twins, by axis](profile.png)\n",
        "## By axis\n",
        AXES_NOTE,
    ]
    parts += [
        f"{WORDS_OF[one]}; in brackets, how many suites there are:\n\n{axes_table(select(board, quantity=one), suites)}"
        for one in WORDS_OF
    ]
    parts += ["## Would other seeds and suites say the same?\n", repetition_text(learners, repeated)]
    parts += ["## What failures come from\n", CAUSES, causes_text(causes, suites)]
    parts += ["## Suite by suite\n", SUITES, *suite_tables(table, suites)]
    parts += ["## Rows\n", rows_table(rows), HOW_TO]
    return "\n".join(parts)


HEAD = """# Leaderboard

What methods achieve on suites ([how to read it, and how to add a row](../../how-to/compare-on-a-suite.md)). The headline is
*success above chance* on *drawn* levels: (s - random) / (planner - random), where s is the share of levels that are solved. It
is 0 for random play and 1 for the planner, which searches in the simulator. The {levels:,} levels of each suite and seed are
drawn from the hash of the row, so nobody can have seen them before the row was what it is. The frozen levels of a suite are for
*practice*. *Practice minus drawn* is above 0 where a method has memorised them. *Time* is the number of steps on drawn levels
that both solve, over the planner's. The *score* is a diagnostic, on practice levels: 0 where the mean return is that of the
better of idle and random play ({plays} random episodes per level and seed), 1 where it is the planner's. Returns are shaped,
so that a ball that stops near the goal has a high score and no success.

Square brackets hold Student's 95 % intervals: the first ones over seeds, each of which is an agent, its training levels and its
drawn levels; those called *over suites* let suites vary, too. The budget `laptop` is {laptop:,} frames of training on each
suite with each seed, `server` {server:,}. Every row can be played again to the bit.

This page is made from the tables beside it by `segar benchmark table=true rows=docs/results/benchmark`.
"""
PRACTICE_ONLY = """Rows whose levels were not drawn: the references, by which the others are measured, recorded actions, which
cannot be played on new levels, and rows whose networks are not all here.
"""
PANEL = """`segar benchmark panel=true` plays these on drawn levels. A red row is not as it must be.
"""
AXES_NOTE = """`all` leaves out suites of textures, the axis `look`, which agents that see states cannot play.
"""
CAUSES = """A *causal twin* is a test level in which one group of factors is set as a training level has it, and nothing else
([more](../../how-to/compare-on-a-suite.md#ask-why-an-agent-fails)). The numbers are what success gains on twins: how
much of the failures comes from this group. Below 0, the test is easier in this group than training. Bold groups differ
between training and test; `all` sets all of those together, and is what the profile shows where several differ. The
other groups are controls, in which training and test are alike; what they gain is chance. Means over seeds, with
Student's 95 % intervals. Suites in which training and test have one distribution have no twins, and the references did
not play any.
"""
SUITES = """Means over seeds. *Gap*: return on test levels minus that on training levels. *Regret*: what the return on test
levels lacks of the planner's. *Score*: on test levels. *Gained on twins*: success on twins in which all that differs is as in
training, minus success on test levels. *Success, test* and all that is not drawn is on practice levels.
"""
HOW_TO = """
## Add a row

```sh
segar benchmark suite=core budget=laptop algorithm=my_lab.learner:MyConfig seeds=5 rows=docs/results/benchmark
segar benchmark suite=core policy=my_lab.method:policy row=mine seeds=5 rows=docs/results/benchmark
segar benchmark suite=core actions=FOLDER row=mine seeds=5 rows=docs/results/benchmark
segar benchmark verify=all rows=docs/results/benchmark
```

The first command trains an algorithm of your own, the second one plays a method that was trained elsewhere in a process of its
own, the third one takes files of actions, which are a practice test only. Add the folder of the row and this page in a pull
request; tests play it again.
"""


WORDS_OF = {DRAWN: "Success above chance on drawn levels", PRACTICE: "Success above chance on practice levels"}


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


def over_suites(line: Mapping[str, float]) -> str:
    """The interval over suites."""
    return "–" if pd.isna(line["suites_low"]) else f"[{number(line['suites_low'])}, {number(line['suites_high'])}]"


def ranking_text(found: Generalizability | None) -> str:
    """What the page says first where its ranking is none."""
    if found is None:
        return "**These rows do not rank methods:** two learners with drawn levels on all suites are needed.\n"
    one, few = found.coefficient, found.seeds < FEWEST_SEEDS
    if one.low >= TRUSTED_COEFFICIENT and not few:
        return ""
    seeds = f" They have {found.seeds} seeds, and a place needs {FEWEST_SEEDS}." if few else ""
    return (
        f"**These rows do not rank methods yet.** The coefficient of generalizability of {found.methods} learners is"
        f" {interval(vars(one))}; a ranking needs a lower end of {TRUSTED_COEFFICIENT}.{seeds}\n"
    )


def place_text(place: tuple[int, int] | None) -> str:
    """A place, or those that a row shares."""
    if place is None:
        return "–"
    return str(place[0]) if place[0] == place[1] else f"{place[0]}–{place[1]}"


def overall_table(rows: Mapping[str, Row], table: pd.DataFrame, board: pd.DataFrame, suites: Sequence[str]) -> str:
    """Each row with drawn levels of all suites, by place and then by name, and which rows lack a suite."""
    overall = select(board, axis=OVERALL)
    lines_of = {(one["quantity"], one["row"]): one for one in overall.to_dict("records")}  # type: ignore[var-annotated]
    found, last = places_of(table, suites), (len(rows) + 1, 0)
    lines = []
    for name in sorted(select(overall, quantity=DRAWN)["row"], key=lambda one: (found.get(one, last), one)):
        own = {quantity: lines_of.get((quantity, name)) for quantity in (DRAWN, TIME, "practice_minus_drawn", "score")}
        unknown: Mapping[str, Any] = dict.fromkeys(("estimate", "low", "suites_low"), float("nan"))
        drawn, time, apart, score = (own[one] or unknown for one in own)
        shown = [interval(drawn), over_suites(drawn), interval(time)]
        shown += [f"{number(apart['estimate'])} {over_suites(apart)}", number(score["estimate"]), str(drawn["seeds"])]
        lines.append(
            [named(rows[name]), place_text(found.get(name)), *shown, f"`{commitment_of_row(rows[name])[:16]}`"]
        )
    head = [
        "row",
        "place",
        "success above chance",
        "over suites",
        "time",
        "practice minus drawn, over suites",
        "score",
        "seeds",
    ]
    text = markdown([*head, "commitment"], lines) + GRINDING.format(
        tried=TRIED, gain=number(100 * grinding(len(suites)), 1)
    )
    lacking = [
        f"`{name}` ({len({*row.suites()} & {*suites})} of {len(suites)} suites)"
        for name, row in rows.items()
        if name not in {*select(overall, quantity=PRACTICE)["row"], *REFERENCES}
    ]
    return text + (f"\nNot compared, because suites are missing: {', '.join(lacking)}.\n" if lacking else "")


GRINDING = """
Rows that no paired test over seeds separates (Student's, Holm-corrected, 5 %) share their places; within a place the order is
that of the alphabet. Whoever hashes {tried:,} variants of a row and keeps the luckiest gains at most about {gain} points of
success on the mean of these suites, at one seed and less at more: the levels of `verify=ROW salt=WORDS` cannot be sought out
like that.
"""


def grinding(suites: int) -> float:
    """A bound of what the luckiest of :data:`TRIED` normal draws is above the mean: of success 0.5, on
    :data:`LEVELS` levels of each suite."""
    return (2 * math.log(TRIED)) ** 0.5 * (0.25 / (LEVELS * max(suites, 1))) ** 0.5


def named(row: Row) -> str:
    """The name of a row, marked where it is privileged."""
    return f"`{row.method.name}`{' (privileged)' if row.is_privileged else ''}"


def practice_table(rows: Mapping[str, Row], board: pd.DataFrame) -> str:
    """The rows without drawn levels."""
    overall = select(board, axis=OVERALL)
    found = {one["row"]: one for one in select(overall, quantity=PRACTICE).to_dict("records")}
    scores = {one["row"]: one["estimate"] for one in select(overall, quantity="score").to_dict("records")}
    lines = [
        [
            named(rows[name]),
            interval(found[name]),
            over_suites(found[name]),
            number(scores[name]),
            str(found[name]["seeds"]),
        ]
        for name in sorted(found)
        if not rows[name].drawn
    ]
    return markdown(["row", "success above chance, practice", "over suites", "score", "seeds"], lines)


def chance_text(table: pd.DataFrame, suites: Mapping[str, Sequence[str]]) -> str:
    """The suites on which nobody who learns beats chance."""
    members = [name for axis, names in suites.items() if axis != OVERALL for name in names]
    lost = [name for name in members if not beats_chance(table, name)]
    if not lost:
        return "On every suite, a learner solves more levels than random play does.\n"
    return f"No learner solves more levels than random play does on: {', '.join(lost)}. These suites count like all others.\n"


def repetition_text(learners: pd.DataFrame, found: Generalizability | None) -> str:
    """Variance components, how many seeds and suites name the winner, and how often intervals hold the truth."""
    if found is None:
        return "Two learners with drawn levels on all suites, and two seeds, are needed for this.\n"
    whole = sum(found.components.values())
    shares = [[name, number(one, 4), f"{one / whole:.0%}"] for name, one in found.components.items()]
    text = f"""Variance components of success above chance, of {found.methods} learners, {found.suites} suites and
{found.seeds} seeds. The coefficient of generalizability is the share of methods in the variance of the rows' means:
{interval(vars(found.coefficient))}.

{markdown(["component", "variance", "share"], shares)}
In planted tables with these components, the best of {found.methods} methods has the highest mean in 9 of 10 repetitions with so
many suites:

"""
    needed = [[str(seeds), str(found.suites_needed(seeds) or f"more than {MOST_SUITES}")] for seeds in SEEDS]
    text += markdown(["seeds", "suites"], needed)
    sd = found.components["run"] ** 0.5
    means = [float(one[DRAWN].to_numpy().mean()) for _, one in learners.groupby("suite", dropna=False)]
    covered = [
        [str(seeds), *(number(coverage(one, sd, seeds, LEVELS), 3) for one in ([0.1], [0.5], [0.9], means))]
        for seeds in SEEDS
    ]
    head = ["seeds", "one suite, success 0.1", "0.5", "0.9", "mean of the suites"]
    return (
        f"{text}\nHow often intervals of 95 % over seeds hold the truth, in planted tables with this variance between runs:\n\n"
        + markdown(head, covered)
    )


def panel_table(panel: pd.DataFrame) -> str:
    """What the panel found, one line per player, and on which suites it is not as it must be."""
    lines = []
    for player, part in panel.groupby("player", sort=False, dropna=False):
        wrong = ", ".join(f"**{one}**" for one in select(part, right=False)["suite"]) or "–"
        drawn = part["drawn"].to_numpy()
        low, high = number(drawn.min()), number(drawn.max())
        lines.append([str(player), part["must"].iloc[0], number(drawn.mean()), f"{low} to {high}", wrong])
    return markdown(["player", "must", "success above chance", "on suites", "red"], lines, texts=2)


def axes_table(board: pd.DataFrame, suites: Mapping[str, Sequence[str]]) -> str:
    """One quantity of each row on each axis."""
    parts = {axis: {one["row"]: one for one in select(board, axis=axis).to_dict("records")} for axis in suites}
    names = sorted({*board["row"]})
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


def suite_tables(table: pd.DataFrame, suites: Mapping[str, Sequence[str]]) -> list[str]:
    """A table for each suite."""
    names = [name for axis, members in suites.items() if axis != OVERALL for name in members]
    return [f"### {name}\n\n{rows_on(name, table)}" for name in names]


def rows_on(name: str, table: pd.DataFrame) -> str:
    """The means over seeds of each row that played a suite, best first."""
    means = mean_by(table.loc[table["suite"] == name], ["row"], FIGURES)
    means = means.assign(row=[f"`{row}`" for row in means["row"]])
    return means_table(means.sort_values([DRAWN, PRACTICE], ascending=False, kind="stable"), "row")


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
    for _, row in sorted(rows.items(), key=lambda one: (one[0] not in REFERENCES, one[0])):
        seeds = sorted({piece.seed for piece in row.pieces})
        suites = str(len(row.suites()))
        lines.append([named(row), escaped(row.method.says), suites, f"{seeds[0]} to {seeds[-1]}", f"`{row.hash}`"])
    return markdown(["row", "what it is", "suites", "seeds", "hash"], lines)
