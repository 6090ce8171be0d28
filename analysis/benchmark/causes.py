"""What the failures of rows come from: the success of each row on causal twins of the test levels beside that on the levels."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from segar.analysis.causes import profile_of_causes
from segar.analysis.tables import keep, pick, select
from segar.experiments.benchmarking.protocol import CONTROL, TWIN
from segar.experiments.benchmarking.row import Row
from segar.suites import ALL_THAT_DIFFERS, Cause

EFFECT = "shift_effect"
"""What success gains on twins in which all that differs is as in training: the column of figures of a row, suite and seed."""


def causes_in(episodes: pd.DataFrame) -> pd.DataFrame:
    """One line per suite, seed and group of factors of the twins that a row played: ``suite``, ``seed``, and the columns of
    :meth:`segar.suites.Cause.row`; no line where there are no twins.

    Args:
        episodes: of :meth:`segar.experiments.benchmarking.row.Row.results`, one on each test level and twin.
    """
    twins = keep(episodes, episodes["levels"].str.startswith((TWIN, CONTROL)))
    both = twins.merge(select(episodes, levels="test"), on=["suite", "seed", "level"])
    lines = []
    by_set = both.groupby(["suite", "seed", "levels_x"], sort=False, dropna=False)
    for (name, seed, played), part in by_set:  # type: ignore[misc]
        twin, level = part[["success_x", "success_y"]].to_numpy(np.float64).T
        differs = played.startswith(TWIN)
        group = played.removeprefix(TWIN if differs else CONTROL)
        lines.append({"suite": name, "seed": seed, **Cause.of_levels(group, differs, level, twin).row()})
    return pd.DataFrame(lines)


def causes_of_rows(rows: Sequence[Row]) -> pd.DataFrame:
    """One line per row, suite, seed and group, as of :func:`causes_in`, in the column ``row`` the name of the row."""
    found = [causes_in(row.results().to_pandas()).assign(row=row.method.name) for row in rows]
    if not (kept := [one for one in found if len(one)]):
        return pd.DataFrame(columns=["row", "suite", "seed", "group", "differs", "effect"])
    table = pd.concat(kept, ignore_index=True)
    return pick(table, ["row", *(str(name) for name in table if name != "row")])


def shift_effects(causes: pd.DataFrame) -> dict[tuple[str, str, int], float]:
    """Row, suite and seed to the effect of all that differs between training and test: of the group ``all``, or of the only one
    that differs."""
    differing = select(causes, differs=True)
    alone = ~differing.duplicated(["row", "suite", "seed"], keep=False)
    whole = keep(differing, alone | (differing["group"] == ALL_THAT_DIFFERS))
    return {(one["row"], one["suite"], one["seed"]): one["effect"] for one in whole.to_dict("records")}


def effects_on(name: str, causes: pd.DataFrame) -> pd.DataFrame:
    """The effect of each group on each row that played the twins of a suite, mean over seeds: columns ``row``, ``group``,
    ``differs``, ``estimate``, ``low``, ``high`` (over seeds; none of one seed), ``runs``."""
    by_row = select(causes, suite=name).groupby("row", sort=True, dropna=False)
    found = pd.concat([profile_of_causes(part).assign(row=row) for row, part in by_row], ignore_index=True)
    found.loc[found["runs"] == 1, ["effect_low", "effect_high"]] = np.nan  # over levels: those of others are over seeds
    return found.rename(columns={"effect": "estimate", "effect_low": "low", "effect_high": "high"})
