"""From the episodes of rows to success corrected for chance, and to scores: 1 is the planner."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from segar.analysis.benchmark.causes import EFFECT, shift_effects
from segar.analysis.stats.estimate import ALIKE, mean_of_replicates
from segar.analysis.stats.ranking import ALPHA, FEWEST_SEEDS, places
from segar.analysis.tables import Floats, keep
from segar.evaluation import Baselines
from segar.experiments.benchmarking.protocol import PLAYERS, REFERENCES, SIDES
from segar.experiments.benchmarking.row import ROW, Row, read_row
from segar.experiments.benchmarking.verification import suite_of
from segar.experiments.settings import RunFolderError
from segar.suites import AXES, outline

IDLE, RANDOM, PLANNER = REFERENCES
# Success corrected for chance on drawn levels and on the frozen ones: 0 is that of random play, 1 the planner's; the steps on
# drawn levels that both solved, over the planner's; and success weighted by time (Yokoyama et al. 2021): the mean over drawn
# levels of the planner's steps over the method's, at most 1, and of 0 where it fails.
DRAWN, PRACTICE, TIME, WEIGHTED = "drawn", "practice", "time", "success_by_time"
ENDS = ("low", "high")
OVERALL = "all"  # of the axes
QUANTITIES = (DRAWN, PRACTICE, "practice_minus_drawn", TIME, WEIGHTED, "score", EFFECT)
FIGURES = {  # of a row on a suite, and what pages call them
    DRAWN: "success above chance, drawn",
    PRACTICE: "success above chance, practice",
    TIME: "time",
    WEIGHTED: "success weighted by time, drawn",
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


def rows_in(folders: Iterable[Path]) -> list[Row]:
    """The rows in some folders, in their order; raises :class:`SegarError` for a damaged one."""
    return [read_row(path.parent) for folder in folders for path in sorted(folder.glob(f"*/{ROW}"))]


def by_name(rows: Iterable[Row]) -> dict[str, Row]:
    """Rows by name; of one name, the first one."""
    return {row.method.name: row for row in reversed([*rows])}


def figures_of(rows: Sequence[Row], causes: pd.DataFrame) -> pd.DataFrame:
    """One line per row, suite and seed: ``row``, ``axis``, ``suite``, ``suite_hash``, ``seed`` and :data:`FIGURES`; of rows of
    one name, the first one.

    Returns and their regret are in units of return; the gap is the return on test levels minus that on training levels. A
    score is missing where no row of the references has played the levels, and the effect of the shift where no twins were.

    Args:
        causes: of :func:`segar.analysis.benchmark.causes.causes_of_rows`.
    """
    means = {row.folder: level_means(row) for row in rows}
    played: dict[tuple[str, ...], list[Floats]] = {}  # by the references, on each level set of a suite, by its hash
    for row in (row for row in rows if row.method.name in REFERENCES):
        for piece, (side, levels) in ((one, each) for one in row.pieces for each in one.levels.items()):
            known = played.setdefault((row.method.name, piece.suite, side, levels), [])
            known.append(means[row.folder][piece.suite, piece.seed, side])
    effects = shift_effects(causes)
    lines = []
    for name, row in sorted(by_name(rows).items()):
        drawn = {(one.suite, one.seed): one for one in row.drawn}
        for piece in row.pieces:
            line: dict[str, Any] = {"row": name, "axis": outline(piece.suite)["axis"], "suite": piece.suite}
            line |= {"suite_hash": piece.suite_hash, "seed": piece.seed}
            line[EFFECT] = effects.get((name, piece.suite, piece.seed), np.nan)
            for side in (side for side in SIDES if side in piece.levels):
                own = [float(one.mean()) for one in means[row.folder][piece.suite, piece.seed, side]]
                line |= {f"{side}_return": own[0], f"{side}_success": own[1]}
                keys = [(player, piece.suite, side, piece.levels[side]) for player in (RANDOM, IDLE, PLANNER)]
                if not all(key in played for key in keys):
                    continue
                reached = [np.mean(played[key], axis=0) for key in keys]
                returns, solved = (Baselines(*one) for one in zip(*reached, strict=True))
                line[{"train": "train_score", "test": "score"}[side]] = float(returns.normalised(own[0]))
                if side == "test":
                    line["regret"] = float(returns.regret(own[0]))
                    chance = solved.random.mean()
                    line[PRACTICE] = (own[1] - chance) / (solved.oracle.mean() - chance)
            if one := drawn.get((piece.suite, piece.seed)):
                line |= {DRAWN: one.corrected, TIME: one.steps / one.planner_steps if one.planner_steps else np.nan}
                # Rows whose levels were drawn before it was kept have none.
                line[WEIGHTED] = np.nan if one.by_time is None else one.by_time / one.count
            lines.append(line)
    table = pd.DataFrame(lines).reindex(columns=["row", "axis", "suite", "suite_hash", "seed", *FIGURES])
    return table.assign(
        gap=table["test_return"] - table["train_return"], practice_minus_drawn=table[PRACTICE] - table[DRAWN]
    )


def level_means(row: Row) -> dict[tuple[str, int, str], Floats]:
    """The mean return and success on each level, float64 ``(2, levels)``, by suite, seed and side.

    Raises:
        RunFolderError: a suite is another version here, or the row has not all of its test levels, others, or some of them
            more often.
    """
    episodes = row.results().to_pandas()
    of_sides = keep(episodes, episodes["levels"].isin(SIDES))
    played = of_sides.groupby(["suite", "seed", "levels", "level"], dropna=False)[["return", "success"]]
    means, counts = played.mean(), played.size()
    for piece in row.pieces:
        n, of = len(suite_of(row, piece).test_levels), counts.loc[piece.suite, piece.seed, "test"]
        if list(of.index) != [*range(n)] or of.nunique() > 1:
            raise RunFolderError(f"{row.folder}: {piece.suite}, seed {piece.seed}: it must have its {n} test levels")
    return {key: part.to_numpy(np.float64).T for key, part in means.groupby(level=[0, 1, 2], dropna=False)}  # type: ignore[misc]


def complete(table: pd.DataFrame, suites: Sequence[str]) -> pd.DataFrame:
    """The lines on these suites of rows that did all of them with each of their seeds."""
    kept = keep(table, table["suite"].isin(list(suites)))
    whole: list[pd.DataFrame] = []
    for _, part in kept.groupby("row", sort=False, dropna=False):
        seeds = [set(one["seed"]) for _, one in part.groupby("suite", dropna=False)]
        shared = set.intersection(*seeds)
        if len(seeds) == len(suites) and shared:
            whole.append(keep(part, part["seed"].isin(list(shared))))
    return pd.concat(whole, ignore_index=True) if whole else keep(kept, np.zeros(len(kept), np.bool_))


def suites_compared(table: pd.DataFrame, names: Sequence[str] | None = None) -> dict[str, list[str]]:
    """The suites that rows are compared on, of each axis and of all: those that ``names`` or the rows have, without suites of
    textures, which agents that see states cannot play, unless an axis is theirs alone."""
    suites = list(dict.fromkeys(table["suite"] if names is None else names))
    axes = {axis: [name for name in suites if outline(name)["axis"] == axis] for axis in AXES}
    found = {axis: members for axis, members in axes.items() if members}
    return {**found, OVERALL: [name for axis, members in found.items() if axis != "look" for name in members]}


def leaderboard(table: pd.DataFrame, suites: Mapping[str, Sequence[str]]) -> pd.DataFrame:
    """The mean over suites of each of :data:`QUANTITIES`, of each row on each axis and on all: columns ``quantity``, ``axis``,
    ``row``, ``estimate``, ``low``, ``high`` (Student's interval over seeds), ``seeds``, ``suites_low`` and ``suites_high``
    (that over suites, as a sample of possible ones). Rows that lack a suite are left out."""
    found = []
    for quantity, (axis, names) in product(QUANTITIES, suites.items()):
        known = keep(table, table[quantity].notna())
        members = [name for name in names if quantity != EFFECT or name in set(known["suite"])]
        for row, part in complete(known, members).groupby("row", dropna=False):
            over_seeds, over_suites = (
                mean_of_replicates([one.to_numpy().mean() for _, one in part.groupby(by, dropna=False)[quantity]])
                for by in ("seed", "suite")
            )
            line = {"quantity": quantity, "axis": axis, "row": row, "seeds": over_seeds.n}
            line |= {name: getattr(over_seeds, name) for name in ("estimate", *ENDS)}
            found.append(line | {f"suites_{end}": getattr(over_suites, end) for end in ENDS})
    columns = ["quantity", "axis", "row", "estimate", *ENDS, "seeds", *(f"suites_{end}" for end in ENDS)]
    return pd.DataFrame(found, columns=columns)


def places_of(table: pd.DataFrame, names: Sequence[str], value: str = DRAWN) -> dict[str, tuple[int, int]]:
    """The first and last place of each row with drawn levels, by success on them or by another of :data:`QUANTITIES`, as of
    :func:`segar.analysis.stats.ranking.places`."""
    part = complete(keep(table, table[[DRAWN, value]].notna().all(axis=1)), names)
    return places(part.pivot_table(value, "seed", "row")) if len(part) else {}


def learners_on(table: pd.DataFrame, names: Sequence[str]) -> pd.DataFrame:
    """The lines of rows that are no players, on drawn levels of all of these suites, with the seeds that all of them share.

    Rows that are above chance on no more than half of the suites are left out, since every method is told apart from them.
    Where two rows have the five seeds that are most frequent among rows with seeds enough for a place, all others are left out,
    too, or one more row could undo a ranking.
    """
    known = keep(table, table[DRAWN].notna() & ~table["row"].isin(list(PLAYERS)))
    part = complete(known, names)
    seeds = {}
    for row, own in part.groupby("row", dropna=False):
        lows = [mean_of_replicates(one[DRAWN].to_numpy()).low for _, one in own.groupby("suite", dropna=False)]
        if np.mean(np.array(lows) <= 0) < 0.5:  # an interval that is unknown speaks against nobody
            seeds[row] = set(own["seed"])
    every = sorted(seed for own in seeds.values() if len(own) >= FEWEST_SEEDS for seed in own)
    usual = {seed for seed, _ in Counter(every).most_common(FEWEST_SEEDS)}
    placed = [row for row, own in seeds.items() if own >= usual]
    rows = placed if len(placed) > 1 else list(seeds)
    shared = set.intersection(*(seeds[row] for row in rows)) if rows else set()
    return keep(part, part["row"].isin(rows) & part["seed"].isin(list(shared)))


def beats_chance(table: pd.DataFrame, name: str) -> bool:
    """Whether a learner solves more of a suite than random play does: by Student's test over its seeds, corrected for the
    number of learners, since the luckiest of many is above chance by chance; seeds that are alike and above chance do, too."""
    own = keep(table, (table["suite"] == name) & ~table["row"].isin(list(PLAYERS)))
    values = [
        part[DRAWN if len(part[DRAWN].dropna()) else PRACTICE].dropna() for _, part in own.groupby("row", dropna=False)
    ]
    found = [mean_of_replicates(one.to_numpy(), 0.0) for one in values]
    return any(one.p * len(values) < ALPHA / 2 or (one.note == ALIKE and one.estimate > 0) for one in found)
