"""``python -m segar.analysis.studies.hardness --output DIR``: the hardness of levels with conditions on the reward.

Nothing is trained.

``hardness.csv`` has for each number of conditions the success of a random policy, of the scripted player and of the
planner, with Wilson intervals, and the steps that the planner needs.
"""

from pathlib import Path
from typing import Any

import pandas as pd

from segar.analysis.studies.baselines import hardness_of
from segar.analysis.tables import write_csv
from segar.experiments.commands.command_line import run_from_command_line
from segar.experiments.levels.variations import vary
from segar.levels import family
from segar.tasks import CONDITIONS, conditional_puttputt

PANEL = "empty-hard"
MOST_WITHOUT_ALL = 2  # so few levels are for trying things out: then one number of conditions is enough


def run(output: Path = Path("hardness"), levels: int = 100) -> None:
    """Writes ``hardness.csv`` into the folder ``output``, from so many test levels."""
    numbers = [1] if levels <= MOST_WITHOUT_ALL else range(CONDITIONS + 1)
    rows = [{"conditions": k, **hardness_with(k, levels)} for k in numbers]
    write_csv(output / "hardness.csv", pd.DataFrame(rows))


def hardness_with(conditions: int, count: int) -> dict[str, Any]:
    """Success of chance, script and planner on ``count`` test levels, and the planner's steps."""
    levels = vary(family(PANEL), "conditions", "variation").sample(count, seed=0, split="test")
    found = hardness_of(levels, conditional_puttputt(conditions)).summary()
    row: dict[str, Any] = {"panel": PANEL, "levels": count, "oracle_steps": found["oracle_steps"]}
    for player in ("random", "scripted", "oracle"):
        low, high = found[f"{player}_success_95"]
        row |= {f"{player}_success": found[f"{player}_success"], f"{player}_low": low, f"{player}_high": high}
    return row


if __name__ == "__main__":
    run_from_command_line(run)
