"""``python -m segar.analysis.studies.w2 --output DIR``: W2 of n training levels to 100 test levels, without training.

Nine panels, and six pairs of a panel and the next harder one, for eight n and several seeds:

``distances.csv``  W2 in three modes and KS, one row per pair, n and seed; ``w2_marginals`` is exact W2 after the factors of
                   both sets were dealt anew, so that only their marginals are left
``means.csv``      mean, deviation and standard error over seeds, and for the reference mode the mean of 2022 beside it
``explained.csv``  R^2 of log W2 on panel, on log n, on both, and on their cells: how much of W2 is the number of levels?
"""

import dataclasses
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from segar.analysis.stats.correlation import explained, indicators
from segar.analysis.tables import column, select, write_csv
from segar.experiments.commands.command_line import run_from_command_line
from segar.levels import Levels, family
from segar.metrics import ks, spread, w2

COUNTS = (1, 2, 5, 10, 25, 50, 100, 200)
IN_MODELS = (1, 10, 50, 100, 200)  # the n of the paper's figures, which the confound is about
TEST_LEVELS = 100
MODES = ("reference", "exact", "paper")
SEEDS_OF_2022 = 5
# Mean reference W2 over 5 seeds, as the code of 2022 gives it, for each n of COUNTS.
PUBLISHED = pd.read_csv(Path(__file__).with_name("w2_means_of_2022.csv"), index_col=["train", "test"])
MEANS_OF_2022: dict[tuple[str, str], tuple[float, ...]] = {pair: tuple(row) for pair, *row in PUBLISHED.itertuples()}
ROUNDING = 0.0005  # of the numbers above


def run(output: Path = Path("w2_study"), seeds: int = SEEDS_OF_2022) -> None:
    """Writes the three tables into the folder ``output``, from so many pairs of level sets per pair of panels and n."""
    table = distances(range(seeds))
    means, models = means_of(table), models_of(table)
    for name, one in {"distances": table, "means": means, "explained": models}.items():
        write_csv(output / f"{name}.csv", one)
    print(models.to_string(index=False))


def distances(
    seeds: Sequence[int], pairs: Sequence[tuple[str, str]] = tuple(MEANS_OF_2022), counts: Sequence[int] = COUNTS
) -> pd.DataFrame:
    """One row per pair of panels, seed and n. Smaller training sets of a seed are the first levels of larger ones, and
    each seed has test levels of its own, as in 2022."""
    rows: list[dict[str, Any]] = []
    for (train, test), seed in product(pairs, seeds):
        levels = family(train).sample(max(counts), seed=seed, split="train")
        others = family(test).sample(TEST_LEVELS, seed=seed, split="test")
        for n in counts:
            some = levels[:n]
            found = {f"w2_{mode}": float(w2(some, others, mode=mode)) for mode in MODES}
            rng = np.random.default_rng([seed, n])
            found["w2_marginals"] = float(w2(dealt(some, rng), dealt(others, rng), scale=spread(some, others)))
            rows.append({"train": train, "test": test, "n": n, "seed": seed, **found, "ks": float(ks(some, others))})
    return pd.DataFrame(rows)


def dealt(levels: Levels, rng: np.random.Generator) -> Levels:
    """The levels with each component of each factor dealt anew among all entities of a type: their marginals, and no more.
    Which types a level has stays, and so does the number of its entities."""
    values = levels.values.copy()
    for t in range(len(levels.layout.types)):
        values[levels.types == t] = rng.permuted(values[levels.types == t], axis=0)
    return dataclasses.replace(levels, values=values)


def means_of(table: pd.DataFrame) -> pd.DataFrame:
    """Per pair of panels, n and mode: mean, deviation and standard error over seeds; the reference mode's mean of 2022,
    and how many standard errors of the difference of both means lie between them.

    Of 2022 only means are known: its deviation is taken to be the one measured here.
    """
    rows = []
    for train, test, n in table[["train", "test", "n"]].drop_duplicates().itertuples(index=False, name=None):
        part = select(table, train=train, test=test, n=n)
        for mode in MODES:
            values = column(part, f"w2_{mode}")
            deviation = float(values.std(ddof=1)) if len(values) > 1 else float("nan")
            error = deviation / np.sqrt(len(values))
            row = {"train": train, "test": test, "n": n, "mode": mode}
            row |= {"mean": values.mean(), "sd": deviation, "se": error}
            if mode == "reference":
                published = MEANS_OF_2022[train, test][COUNTS.index(n)]
                apart = np.hypot(error, deviation / np.sqrt(SEEDS_OF_2022)) + ROUNDING
                row |= {"mean_2022": published, "standard_errors_apart": (values.mean() - published) / apart}
            rows.append(row)
    return pd.DataFrame(rows)


def models_of(table: pd.DataFrame) -> pd.DataFrame:
    """R^2 of log W2 in distribution, per mode: on panel, on log n, on both, and on the cells of panel and n."""
    inside = table.loc[(table["train"] == table["test"]) & table["n"].isin(IN_MODELS)]
    panel, log_n = indicators(list(inside["train"])), np.log(column(inside, "n"))[:, None]
    cells = indicators([f"{a} {n}" for a, n in zip(inside["train"], inside["n"], strict=True)])
    models = {"panel": panel, "log_n": log_n, "panel_and_log_n": np.column_stack([panel, log_n]), "cell": cells}
    rows = []
    for mode in MODES:
        y = np.log(column(inside, f"w2_{mode}"))
        found = {name: explained(y, predictors) for name, predictors in models.items()}
        rows.append({"mode": mode, "points": len(y), **found})
    return pd.DataFrame(rows)


if __name__ == "__main__":
    run_from_command_line(run)
