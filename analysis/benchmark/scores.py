"""From the episodes of rows to scores: 0 is the better of idle and random play on each level, 1 the planner."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.benchmark.causes import EFFECT, shift_effects
from analysis.stats.scores import aggregates, performance_profiles, probability_of_improvement
from analysis.tables import Floats, keep, pick, select
from experiments.benchmarking.protocol import PLAYERS, REFERENCES, SIDES
from experiments.benchmarking.row import ROW, Row, read_row
from segar.evaluation import Baselines
from segar.suites import AXES, outline

IDLE, RANDOM, PLANNER = REFERENCES
SEED = 0  # of the bootstrap
ENDS = ("low", "high")
OVERALL = "all"  # of the axes
COMPARED = ("score", "test_success")
"""What rows are compared by. Return is shaped, so that a ball that stops near the goal has a high score and no success."""
THRESHOLDS = np.linspace(0, 1, 41)
FIGURES = (
    "train_return", "test_return", "gap", "regret", "train_success", "test_success", "train_score", "score", EFFECT,
)  # fmt: skip


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
        causes: of :func:`analysis.benchmark.causes.causes_of_rows`.
    """
    means = {row.folder: LevelMeans(row) for row in rows}
    players = {name: [means[row.folder] for row in rows if row.method.name == name] for name in REFERENCES}
    effects = shift_effects(causes)
    lines = []
    for name, row in sorted(by_name(rows).items()):
        own = means[row.folder]
        for piece in row.pieces:
            line: dict[str, Any] = {"row": name, "axis": outline(piece.suite)["axis"], "suite": piece.suite}
            line |= {"suite_hash": piece.suite_hash, "seed": piece.seed}
            line[EFFECT] = effects.get((name, piece.suite, piece.seed), np.nan)
            for side in (side for side in SIDES if side in piece.levels):
                returns = float(own.returns[piece.suite, piece.seed, side].mean())
                successes = float(own.successes[piece.suite, piece.seed, side].mean())
                line |= {f"{side}_return": returns, f"{side}_success": successes}
                known = references(players, piece.suite, side, piece.levels[side])
                if known is not None:
                    line[{"train": "train_score", "test": "score"}[side]] = float(known.normalised(returns))
                if known is not None and side == "test":
                    line["regret"] = float(known.regret(returns))
            lines.append(line)
    table = pd.DataFrame(lines).reindex(columns=["row", "axis", "suite", "suite_hash", "seed", *FIGURES])
    return table.assign(gap=table["test_return"] - table["train_return"])


class LevelMeans:
    """The mean return and success on each level, by suite, seed and side, and the hashes of the level sets."""

    def __init__(self, row: Row) -> None:
        episodes = row.results().to_pandas()
        means = episodes.groupby(["suite", "seed", "levels", "level"], dropna=False)[["return", "success"]].mean()
        self.returns: dict[tuple[str, int, str], Floats] = {}
        self.successes: dict[tuple[str, int, str], Floats] = {}
        for key, part in means.groupby(level=[0, 1, 2], dropna=False):
            self.returns[key], self.successes[key] = part.to_numpy(np.float64).T  # type: ignore[index]
        self.hashes = {
            (piece.suite, piece.seed, side): digits for piece in row.pieces for side, digits in piece.levels.items()
        }

    def of(self, suite: str, side: str, levels: str) -> list[Floats]:
        """Returns on the levels of this hash, of each seed that played them."""
        same = [key for key, digits in self.hashes.items() if digits == levels and (key[0], key[2]) == (suite, side)]
        return [self.returns[key] for key in same]


def references(players: Mapping[str, Sequence[LevelMeans]], suite: str, side: str, levels: str) -> Baselines | None:
    """The floors and the best known returns on the levels of this hash, each the mean over all seeds that played them; None
    where a player did not."""
    found = []
    for name in (RANDOM, IDLE, PLANNER):
        returns = [one for means in players[name] for one in means.of(suite, side, levels)]
        if not returns:
            return None
        found.append(np.mean(returns, axis=0))
    return Baselines(*found)


def complete(table: pd.DataFrame, suites: Sequence[str]) -> pd.DataFrame:
    """The lines on these suites of rows that did all of them with each of their seeds, with scores."""
    kept = keep(table, table["suite"].isin(list(suites)) & table["score"].notna())
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
    """The interquartile mean of each of :data:`COMPARED` and of the effect of the shift, of each row on each axis and on all,
    with stratified bootstrap intervals: columns ``quantity``, ``axis``, ``row``, ``estimate``, ``low``, ``high``, ``n``,
    ``seeds``; best first. Rows that lack a suite are left out; suites without twins have no effect of a shift."""
    found = []
    shifted = keep(table, table[EFFECT].notna())
    for quantity, (axis, names) in product((*COMPARED, EFFECT), suites.items()):
        known = shifted if quantity == EFFECT else table
        part = complete(known, [name for name in names if quantity != EFFECT or name in set(shifted["suite"])])
        if part.empty:
            continue
        means = aggregates(part, quantity, np.random.default_rng(SEED), by="row", task=("suite",))
        sure = means["row"].isin(list(PLAYERS))  # whose seeds play alike: what they reach on these suites is known
        means = means.assign(**{end: means[end].where(~sure | means[end].notna(), means["estimate"]) for end in ENDS})
        means = select(means, metric="iqm").sort_values("estimate", ascending=False, kind="stable")
        seeds = [len(set(select(part, row=row)["seed"])) for row in means["row"]]
        found.append(means.assign(quantity=quantity, axis=axis, seeds=seeds))
    columns = ["quantity", "axis", "row", "estimate", "low", "high", "n", "seeds"]
    return pick(pd.concat(found, ignore_index=True), columns) if found else pd.DataFrame(columns=columns)


def profiles(table: pd.DataFrame, names: Sequence[str]) -> pd.DataFrame:
    """Shares of runs that are above each threshold, by ``quantity``; see
    :func:`analysis.stats.scores.performance_profiles`."""
    part, found = complete(table, names), []
    for quantity in COMPARED:
        rng = np.random.default_rng(SEED)
        shares = performance_profiles(part, quantity, list(THRESHOLDS), rng, by="row", task=("suite",))
        found.append(shares.assign(quantity=quantity))
    return pd.concat(found, ignore_index=True)


def improvements(table: pd.DataFrame, names: Sequence[str]) -> pd.DataFrame:
    """The probability that a run of one row is above one of another, mean over suites: columns ``quantity``, ``row``, ``over``,
    ``estimate``, ``low``, ``high``."""
    part = complete(table, names)
    rows = list(dict.fromkeys(part["row"]))
    found = []
    for quantity, better, worse in ((q, a, b) for q, a, b in product(COMPARED, rows, rows) if a != b):
        pair, rng = keep(part, part["row"].isin([better, worse])), np.random.default_rng(SEED)
        one = probability_of_improvement(pair, quantity, better, worse, rng, by="row", task=("suite",))
        found.append([quantity, better, worse, one.estimate, one.low, one.high])
    return pd.DataFrame(found, columns=["quantity", "row", "over", "estimate", "low", "high"])


def seed_spreads(table: pd.DataFrame, names: Sequence[str], quantity: str) -> pd.Series:
    """The standard deviation over seeds on each suite: its root mean square over the rows that are no players."""
    part = complete(table, names)
    part = part.loc[~part["row"].isin(list(PLAYERS))]
    variance = part.groupby(["row", "suite"], dropna=False)[quantity].var().dropna()
    return np.sqrt(variance.groupby("suite", dropna=False).mean())  # type: ignore[return-value]
