"""What the site's pages say and no page can measure in its time: how hard environments are, and the cards of suites.

``python docs/site/measure.py`` writes ``docs/results/hardness.csv`` and ``docs/results/cards.json``. It compiles a kernel for
each world and plans on every test level of every suite, half an hour on two cores. `make check-results` measures a part again.
"""

from __future__ import annotations

import json
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import segar
from segar.hardness import hardness
from segar.levels import TASK_LEVELS
from segar.suites import card, suite, suites
from segar.tasks import task_of

RESULTS = Path(__file__).parents[2] / "docs" / "results"
HARDNESS, CARDS = RESULTS / "hardness.csv", RESULTS / "cards.json"
LEVELS, PLAYS = 20, 50  # test levels of seed 0, and random episodes on each
PLAYERS = ("random", "scripted", "oracle")


def hardness_of(name: str) -> list[dict[str, Any]]:
    """Rows of the table: what each player solves of the test levels, with Wilson's interval of 95 %, and its mean steps."""
    levels = segar.family(name).sample(LEVELS, seed=0, split="test")
    found = hardness(levels, task_of(levels), rng=np.random.default_rng(0), plays=PLAYS).summary()
    rows = []
    for player in PLAYERS:
        if f"{player}_success" in found:
            low, high = found[f"{player}_success_95"]
            row = {"environment": name, "player": player, "levels": LEVELS, "success": found[f"{player}_success"]}
            rows.append(row | {"low": low, "high": high, "steps": found.get(f"{player}_steps")})
    return rows


def card_of(name: str) -> dict[str, Any]:
    """The card of a suite, as ``segar suites NAME --json`` prints it."""
    return card(suite(name))


def write_tables() -> None:
    with ProcessPoolExecutor() as pool:
        cards = dict(zip(suites(), pool.map(card_of, suites()), strict=True))
        CARDS.write_text(json.dumps(cards, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        rows = [row for rows in pool.map(hardness_of, [*segar.families(), *TASK_LEVELS]) for row in rows]
        pd.DataFrame(rows).to_csv(HARDNESS, index=False, float_format="%.6g", lineterminator="\n")


if __name__ == "__main__":
    write_tables()
