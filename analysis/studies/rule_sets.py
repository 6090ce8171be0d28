"""``python -m segar.analysis.studies.rule_sets --output DIR``: how far the rule sets of training are from those of the test.

``rule_sets.csv`` has one row per training set: ``rule_sets``, the number that it has; ``dynamics_w2``, the W2 of the
distance between dynamics to the test levels' rule sets, with its standard error ``dynamics_se``; and ``dynamics_floor``, that
of two sets dealt at random from both. Of large training sets the first 300 levels count.
"""

from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from segar.analysis.tables import write_csv
from segar.experiments.commands.command_line import run_from_command_line
from segar.experiments.levels.builders import make_levels
from segar.experiments.levels.rule_sets import situations_of
from segar.experiments.settings import LevelsConfig
from segar.metrics import dynamics_w2

DESIGNS = ("rule_sets_1", "rule_sets_10", "rule_sets_100", "rule_sets_1000", "rule_sets_10000",
           "rule_sets_10_near", "rule_sets_10_far")  # fmt: skip
FAMILY, DIFFICULTY = "objectsx1", "medium"
TRAIN_LEVELS = 300  # of which rule sets are compared
TEST_LEVELS = 300  # of the runs at scale standard
FIRST_SEED = 1  # of the runs


def run(
    output: Path = Path("rule_sets"),
    count: int = 10_000,
    seeds: int = 10,
    designs: tuple[str, ...] = DESIGNS,
    levels: int = TEST_LEVELS,
) -> None:
    """Writes ``rule_sets.csv`` into the folder ``output``."""
    rows = []
    for seed, design in product(range(FIRST_SEED, FIRST_SEED + seeds), designs):
        config = LevelsConfig(
            train=f"{FAMILY}-{DIFFICULTY}", count=count, seed=seed, design=design, variation="rule_space",
            test_variation="rule_space_unseen", test_count=levels,
        )  # fmt: skip
        train, test = make_levels(config)
        found = dynamics_w2(train[:TRAIN_LEVELS], test, situations_of(test), rng=np.random.default_rng(seed))
        rows.append({
            "family": FAMILY, "difficulty": DIFFICULTY, "n": count, "seed": seed, "design": design,
            "rule_sets": found.rule_sets[0], "dynamics_w2": found.value, "dynamics_se": found.error,
            "dynamics_floor": found.floor,
        })  # fmt: skip
    write_csv(output / "rule_sets.csv", pd.DataFrame(rows), 8)


if __name__ == "__main__":
    run_from_command_line(run)
