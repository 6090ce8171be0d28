"""The leaderboard as a page, made of tables alone, so that a test can make it again."""

import html
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from segar.analysis.benchmark.causes import effects_on
from segar.analysis.benchmark.scores import (
    DRAWN,
    FIGURES,
    OVERALL,
    PRACTICE,
    TIME,
    WEIGHTED,
    beats_chance,
    learners_on,
    places_of,
)
from segar.analysis.stats.ranking import FEWEST_SEEDS, MOST_SUITES, Generalizability, coverage, generalizability
from segar.analysis.tables import keep, mean_by, select
from segar.experiments.benchmarking.drawn import LEVELS
from segar.experiments.benchmarking.protocol import BUDGETS, PRIVILEGED, REFERENCES
from segar.experiments.benchmarking.row import Row, commitment_of_row
from segar.experiments.runs.own_modules import names_in
from segar.suites import RANDOM_PLAYS
from segar.support import templates

SEEDS = (3, 5, 10)  # numbers of seeds of which the page says what they can tell
TRUSTED_COEFFICIENT = 0.8  # from which on a ranking is one
TRIED = 10_000  # variants of a row of which somebody may keep the luckiest


def page_text(
    rows: Mapping[str, Row],
    table: pd.DataFrame,
    board: pd.DataFrame,
    causes: pd.DataFrame,
    suites: Mapping[str, Sequence[str]],
    panel: pd.DataFrame | None = None,
) -> str:
    """The page in Markdown."""
    unaided = without_privileged(rows, table)
    learners = learners_on(unaided, suites[OVERALL])
    repeated = generalizability(learners, DRAWN, "row", "suite", "seed")
    timed = learners_on(keep(unaided, unaided[WEIGHTED].notna()), suites[OVERALL])
    members = [name for axis, names in suites.items() if axis != OVERALL for name in names]
    environment = templates(Path(__file__).parent, keep_trailing_newline=True)
    environment.filters["interval"] = lambda one: interval(vars(one))
    limits = {"trusted": TRUSTED_COEFFICIENT, "fewest_seeds": FEWEST_SEEDS}
    return environment.get_template("leaderboard.md.jinja").render(
        **limits,
        plays=RANDOM_PLAYS,
        levels=LEVELS,
        budgets=BUDGETS,
        repeated=repeated,
        weighted=generalizability(timed, WEIGHTED, "row", "suite", "seed"),
        overall=overall_table(rows, table, board, suites[OVERALL]),
        practice=practice_table(rows, board),
        chance=chance_text(unaided, members),
        panel=None if panel is None else panel_table(panel),
        axes={words: axes_table(select(board, quantity=one), suites) for one, words in WORDS_OF.items()},
        causes=causes_text(causes, members),
        on_suites={name: rows_on(name, table) for name in members},
        rows=rows_table(rows),
        **({} if repeated is None else repetition_tables(learners, repeated)),
    )


WORDS_OF = {DRAWN: "Success above chance on drawn levels", PRACTICE: "Success above chance on practice levels"}


def markdown(head: Sequence[str], lines: Iterable[Sequence[str]], texts: int = 1) -> str:
    """A table in Markdown, whose first columns are text and the others numbers."""
    rule = ["---"] * texts + ["--:"] * (len(head) - texts)
    return "\n".join(f"| {' | '.join(line)} |" for line in [head, rule, *lines]) + "\n"


def escaped(text: str) -> str:
    """A text from the file of a row as Markdown shows it, on one line, whatever characters it has."""
    return re.sub(r"[\\`|*\[\]]", r"\\\g<0>", " ".join(html.escape(text, quote=False).split()))


def number(value: float, digits: int = 2) -> str:
    """A number as the page has it; a dash where there is none. No zero has a sign, and sums in another order the same text."""
    if pd.isna(value):
        return "–"
    return f"{round(round(float(value), 9), digits) + 0.0:.{digits}f}"


def interval(line: Mapping[str, float]) -> str:
    """An estimate with its interval; without one where seeds do not differ."""
    if line["low"] == line["high"] or pd.isna(line["low"]):
        return number(line["estimate"])
    return f"{number(line['estimate'])} [{number(line['low'])}, {number(line['high'])}]"


def over_suites(line: Mapping[str, float]) -> str:
    """The interval over suites."""
    return "–" if pd.isna(line["suites_low"]) else f"[{number(line['suites_low'])}, {number(line['suites_high'])}]"


def place_text(place: tuple[int, int] | None) -> str:
    """A place, or those that a row shares."""
    if place is None:
        return "–"
    return str(place[0]) if place[0] == place[1] else f"{place[0]}–{place[1]}"


def overall_table(rows: Mapping[str, Row], table: pd.DataFrame, board: pd.DataFrame, suites: Sequence[str]) -> str:
    """Each row with drawn levels of all suites, by place and then by name, and which rows have no seed with all suites."""
    overall = select(board, axis=OVERALL)
    lines_of = {(one["quantity"], one["row"]): one for one in overall.to_dict("records")}  # type: ignore[var-annotated]
    unaided = without_privileged(rows, table)
    found, by_time, last = places_of(unaided, suites), places_of(unaided, suites, WEIGHTED), (len(rows) + 1, 0)
    lines = []
    for name in sorted(select(overall, quantity=DRAWN)["row"], key=lambda one: (found.get(one, last), one)):
        unknown: Mapping[str, Any] = dict.fromkeys(("estimate", "low", "high", "suites_low"), math.nan)
        quantities = (DRAWN, TIME, WEIGHTED, "practice_minus_drawn", "score")
        drawn, time, weighted, apart, score = (lines_of.get((one, name), unknown) for one in quantities)
        shown = [interval(drawn), over_suites(drawn), interval(time), interval(weighted), place_text(by_time.get(name))]
        shown += [f"{number(apart['estimate'])} {over_suites(apart)}", number(score["estimate"]), str(drawn["seeds"])]
        lines.append(
            [named(rows[name]), place_text(found.get(name)), *shown, f"`{commitment_of_row(rows[name])[:16]}`"]
        )
    head = ["row", "place", "success above chance", "over suites", "time", "success weighted by time", "place by it"]
    head += ["practice minus drawn, over suites", "score", "seeds", "commitment"]
    # A bound of what the luckiest of these normal draws is above the mean: of success 0.5, on the levels of each suite.
    gain = (2 * math.log(TRIED)) ** 0.5 * (0.25 / (LEVELS * max(len(suites), 1))) ** 0.5
    text = markdown(head, lines) + GRINDING.format(tried=TRIED, gain=number(100 * gain, 1))
    lacking = [
        f"`{name}` ({len({*row.suites()} & {*suites})} of {len(suites)} suites)"
        for name, row in rows.items()
        if name not in {*keep(overall, overall["quantity"].isin([DRAWN, PRACTICE]))["row"], *REFERENCES}
    ]
    return text + (f"\nNot compared, because no seed has all suites: {', '.join(lacking)}.\n" if lacking else "")


GRINDING = """
Rows that no paired test over seeds separates (Student's, Holm-corrected, 5 %) share their places; within a place the order is
that of the alphabet. Whoever hashes {tried:,} variants of a row and keeps the luckiest gains at most about {gain} points of
success on the mean of these suites, at one seed and less at more: the levels of `verify=ROW salt=WORDS` cannot be sought out
like that.
"""


def named(row: Row) -> str:
    """The name of a row, marked where the method knows more than a policy may, where code of the author's, which may see all of
    the state, makes the observations, and where one file stands for several seeds, so that these are no several agents."""
    files = [(one.suite, one.file) for one in row.drawn if one.file]
    marks = {
        " (privileged)": is_privileged(row),
        " (own observation)": any(names_in(row.method.settings.get("observation"))),
        " (one policy for several seeds)": len({*files}) < len(files),
    }
    return f"`{row.method.name}`{''.join(mark for mark, holds in marks.items() if holds)}"


def is_privileged(row: Row) -> bool:
    """Whether a method knows more than a policy may, by its own account."""
    return row.method.name in PRIVILEGED or bool(row.method.settings.get("privileged"))


def without_privileged(rows: Mapping[str, Row], table: pd.DataFrame) -> pd.DataFrame:
    """The lines of rows that are not privileged, which alone have places and tell whether methods can be ranked."""
    return keep(table, ~table["row"].isin([name for name, row in rows.items() if is_privileged(row)]))


def practice_table(rows: Mapping[str, Row], board: pd.DataFrame) -> str:
    """The rows without drawn levels."""
    overall = select(board, axis=OVERALL)
    found = {one["row"]: one for one in select(overall, quantity=PRACTICE).to_dict("records")}
    scores = {one["row"]: one["estimate"] for one in select(overall, quantity="score").to_dict("records")}
    lines = [
        [named(rows[name]), interval(one), over_suites(one), number(scores.get(name, math.nan)), str(one["seeds"])]
        for name, one in sorted(found.items())
        if not rows[name].drawn
    ]
    return markdown(["row", "success above chance, practice", "over suites", "score", "seeds"], lines)


def chance_text(table: pd.DataFrame, members: Sequence[str]) -> str:
    """The suites on which nobody who learns beats chance."""
    if not (lost := [name for name in members if not beats_chance(table, name)]):
        return "On every suite, a learner solves more levels than random play does.\n"
    return f"No learner surely solves more than random play does on: {', '.join(lost)}. These suites count like all others.\n"


def repetition_tables(learners: pd.DataFrame, found: Generalizability) -> dict[str, str]:
    """Variance components, how many seeds and suites name the winner, and how often intervals hold the truth."""
    whole = sum(found.components.values())
    shares = [[name, number(one, 4), f"{one / (whole or 1.0):.0%}"] for name, one in found.components.items()]
    needed = [[str(seeds), str(found.suites_needed(seeds) or f"more than {MOST_SUITES}")] for seeds in SEEDS]
    sd = found.components["run"] ** 0.5
    means = [float(one[DRAWN].to_numpy().mean()) for _, one in learners.groupby("suite", dropna=False)]
    covered = [
        [str(seeds), *(number(coverage(one, sd, seeds, LEVELS), 3) for one in ([0.1], [0.5], [0.9], means))]
        for seeds in SEEDS
    ]
    head = ["seeds", "one suite, success 0.1", "0.5", "0.9", "mean of the suites"]
    return {
        "components": markdown(["component", "variance", "share"], shares),
        "needed": markdown(["seeds", "suites"], needed),
        "covered": markdown(head, covered),
    }


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


def causes_text(causes: pd.DataFrame, members: Sequence[str]) -> str:
    """What success gains on the twins of each group of each suite, a column per row that played them."""
    found = {name: effects_on(name, causes) for name in members if name in set(causes["suite"])}
    if not found:
        return "No row here played twins yet.\n"
    rows = sorted({row for effects in found.values() for row in effects["row"]})
    lines = []
    for name, effects in found.items():
        for (group, differs), part in effects.groupby(["group", "differs"], sort=False, dropna=False):  # type: ignore[misc]
            of = {one["row"]: one for one in part.to_dict("records")}
            cells = [interval(of[row]) if row in of else "–" for row in rows]
            lines.append([name, f"**{group}**" if differs else group, *cells])
    return markdown(["suite", "group", *(f"`{row}`" for row in rows)], lines, texts=2)


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
    return markdown([of, *FIGURES.values()], lines)


def rows_table(rows: Mapping[str, Row]) -> str:
    """What each row is of, and its hash."""
    lines = []
    for _, row in sorted(rows.items(), key=lambda one: (one[0] not in REFERENCES, one[0])):
        seeds = np.unique([piece.seed for piece in row.pieces])
        spans = np.split(seeds, np.flatnonzero(np.diff(seeds) > 1) + 1)
        each = ", ".join(f"{one[0]} to {one[-1]}" if len(one) > 1 else str(one[0]) for one in spans)
        lines.append([named(row), escaped(row.method.says), str(len(row.suites())), each, f"`{row.hash}`"])
    return markdown(["row", "what it is", "suites", "seeds", "hash"], lines)
