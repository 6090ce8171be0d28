"""From the episodes of rows to scores: 0 is the better of idle and random play on each level, 1 the planner."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.stats.scores import aggregates, performance_profiles, probability_of_improvement
from analysis.tables import Floats
from experiments.benchmarking.protocol import SIDES
from experiments.benchmarking.row import ROW, Row, read_row
from segar.errors import SegarError
from segar.evaluation import Baselines
from segar.suites import AXES, outline

IDLE, RANDOM, PLANNER = REFERENCES = ("idle", "random", "planner")
SEED = 0  # of the bootstrap
OVERALL = "all"  # of the axes
THRESHOLDS = np.linspace(0, 1, 41)
FIGURES = (
    "train_return", "test_return", "gap", "regret", "train_success", "test_success", "train_score", "score",
)  # fmt: skip


def rows_in(folders: Iterable[Path]) -> dict[str, Row]:
    """The rows in some folders by name; of one name, that of the first folder. Raises :class:`SegarError` for a damaged row."""
    found: dict[str, Row] = {}
    for folder in folders:
        for path in sorted(folder.glob(f"*/{ROW}")):
            row = read_row(path.parent)
            found.setdefault(row.method.name, row)
    return found


def figures_of(rows: Mapping[str, Row]) -> pd.DataFrame:
    """One line per row, suite and seed: ``row``, ``axis``, ``suite``, ``suite_hash``, ``seed`` and :data:`FIGURES`.

    Returns and their regret are in units of return; the gap is the return on test levels minus that on training levels. A
    score is missing where a row of the references lacks the levels.

    Raises:
        SegarError: a row of the references is missing.
    """
    for name in REFERENCES:
        if name not in rows:
            raise SegarError(f"scores need the row '{name}': python -m experiments.benchmark algorithm={name}")
    means = {name: LevelMeans(rows[name]) for name in REFERENCES}
    lines = []
    for name, row in rows.items():
        own = means.get(name) or LevelMeans(row)
        for piece in row.pieces:
            line: dict[str, Any] = {"row": name, "axis": outline(piece.suite)["axis"], "suite": piece.suite}
            line |= {"suite_hash": piece.suite_hash, "seed": piece.seed}
            for side in (side for side in SIDES if side in piece.levels):
                key = (piece.suite, piece.seed, side)
                returns = float(own.returns[key].mean())
                line |= {f"{side}_return": returns, f"{side}_success": float(own.successes[key].mean())}
                known = references(means, key, piece.levels[side])
                if known is not None:
                    score = {"train": "train_score", "test": "score"}[side]
                    line[score] = float(known.normalised(returns))
                if known is not None and side == "test":
                    line["regret"] = float(known.regret(returns))
            lines.append(line)
    table = pd.DataFrame(lines).reindex(columns=["row", "axis", "suite", "suite_hash", "seed", *FIGURES])
    return table.assign(gap=table["test_return"] - table["train_return"])


class LevelMeans:
    """The mean return and success on each level, by suite, seed and side, and the hashes of the level sets."""

    def __init__(self, row: Row) -> None:
        episodes = row.episodes().to_pandas()
        means = episodes.groupby(["suite", "seed", "levels", "level"])[["return", "success"]].mean()
        self.returns: dict[tuple[str, int, str], Floats] = {}
        self.successes: dict[tuple[str, int, str], Floats] = {}
        for key, part in means.groupby(level=[0, 1, 2]):
            self.returns[key] = part["return"].to_numpy(np.float64)  # type: ignore[index]
            self.successes[key] = part["success"].to_numpy(np.float64)  # type: ignore[index]
        self.hashes = {
            (piece.suite, piece.seed, side): digits for piece in row.pieces for side, digits in piece.levels.items()
        }

    def of(self, key: tuple[str, int, str], levels: str) -> Floats | None:
        """Mean returns on the levels of this hash: the mean over all seeds that played them; None where none did."""
        same = [one for one, digits in self.hashes.items() if digits == levels and (one[0], one[2]) == (key[0], key[2])]
        return np.mean([self.returns[one] for one in same], axis=0) if same else None


def references(means: Mapping[str, LevelMeans], key: tuple[str, int, str], levels: str) -> Baselines | None:
    """The floors and the best known returns on the levels of this hash; None where a row of the references lacks them."""
    found = [means[name].of(key, levels) for name in (RANDOM, IDLE, PLANNER)]
    return None if any(one is None for one in found) else Baselines(*found)  # type: ignore[arg-type]


def complete(table: pd.DataFrame, suites: Sequence[str]) -> pd.DataFrame:
    """The lines on these suites of rows that did all of them with each of their seeds, with scores."""
    kept = table.loc[table["suite"].isin(list(suites)) & table["score"].notna()]
    whole = []
    for _, part in kept.groupby("row", sort=False):
        seeds = [set(one["seed"]) for _, one in part.groupby("suite")]
        shared = set.intersection(*seeds)
        if len(seeds) == len(suites) and shared:
            whole.append(part.loc[part["seed"].isin(list(shared))])
    return pd.concat(whole, ignore_index=True) if whole else kept.iloc[:0]


def suites_compared(table: pd.DataFrame, names: Sequence[str] | None = None) -> dict[str, list[str]]:
    """The suites that rows are compared on, of each axis and of all: those that ``names`` or the rows have, without suites of
    textures, which agents that see states cannot play, unless an axis is theirs alone."""
    suites = list(dict.fromkeys(table["suite"] if names is None else names))
    axes = {axis: [name for name in suites if outline(name)["axis"] == axis] for axis in AXES}
    found = {axis: members for axis, members in axes.items() if members}
    return {**found, OVERALL: [name for axis, members in found.items() if axis != "look" for name in members]}


def leaderboard(table: pd.DataFrame, suites: Mapping[str, Sequence[str]]) -> pd.DataFrame:
    """The interquartile mean of the score of each row on each axis and on all, with stratified bootstrap intervals: columns
    ``axis``, ``row``, ``estimate``, ``low``, ``high``, ``n``, ``seeds``; best first. Rows that lack a suite are left out."""
    found = []
    for axis, names in suites.items():
        part = complete(table, names)
        if part.empty:
            continue
        rng = np.random.default_rng(SEED)
        means = aggregates(part, "score", rng, by="row", task=("suite",))
        means = means.loc[means["metric"] == "iqm", ["row", "estimate", "low", "high", "n"]]
        seeds = part.groupby("row")["seed"].nunique()
        found.append(means.assign(axis=axis, seeds=means["row"].map(seeds)).sort_values("estimate", ascending=False))
    columns = ["axis", "row", "estimate", "low", "high", "n", "seeds"]
    return pd.concat(found, ignore_index=True)[columns] if found else pd.DataFrame(columns=columns)


def profiles(table: pd.DataFrame, names: Sequence[str]) -> pd.DataFrame:
    """Shares of runs that score above each threshold; see :func:`analysis.stats.scores.performance_profiles`."""
    part, rng = complete(table, names), np.random.default_rng(SEED)
    return performance_profiles(part, "score", list(THRESHOLDS), rng, by="row", task=("suite",))


def improvements(table: pd.DataFrame, names: Sequence[str]) -> pd.DataFrame:
    """The probability that a run of one row scores above one of another, mean over suites: columns ``row``, ``over``,
    ``estimate``, ``low``, ``high``."""
    part = complete(table, names)
    rows = list(dict.fromkeys(part["row"]))
    found = []
    for better in rows:
        for worse in (one for one in rows if one != better):
            pair = part.loc[part["row"].isin([better, worse])]
            rng = np.random.default_rng(SEED)
            one = probability_of_improvement(pair, "score", better, worse, rng, by="row", task=("suite",))
            found.append({"row": better, "over": worse, "estimate": one.estimate, "low": one.low, "high": one.high})
    return pd.DataFrame(found, columns=["row", "over", "estimate", "low", "high"])


def seed_spreads(table: pd.DataFrame, names: Sequence[str]) -> pd.Series:
    """The standard deviation of the score over seeds on each suite, of rows that are trained: its root mean square over them."""
    part = complete(table, names)
    spread = part.groupby(["row", "suite"])["score"].std().unstack("suite")
    trained = spread.loc[(spread > 0).any(axis=1)]
    return np.sqrt((trained**2).mean())  # type: ignore[return-value]
