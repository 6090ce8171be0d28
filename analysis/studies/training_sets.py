"""``python -m segar.analysis.studies.training_sets --output DIR``: several measures of the training sets of an experiment.

``training_sets.csv`` has one row per family, difficulty, n, seed and design, with these distances to the panel's test
levels: ``w2_position`` (W2 of the places of ball, goal and all other things, whatever their types), ``w2_debiased`` (exact
W2 without its finite-sample floor, negative where the floor is larger), and the parts of the squared exact W2:
``part_position``, ``part_properties``, ``part_types``. Three are of what is done and of what becomes of it: ``w1_policy``,
W1 of the policy similarity under the planner; ``w2_response`` [m], W2 of the distances between the dynamics, which is of
what the same actions change; and ``w2_uncontrollable``, the root of what factors that no action changes have in the square.
"""

from collections.abc import Iterable, Sequence, Set
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial.distance import cdist

from segar.analysis.tables import write_csv
from segar.errors import LevelError
from segar.experiments.commands.command_line import run_from_command_line
from segar.experiments.levels.builders import pick_levels
from segar.experiments.settings import LevelsConfig
from segar.hardness import Plan, dynamics_distances, influence, plan, policy_similarity
from segar.language import GoalTile, GolfBall, Position
from segar.levels import DIFFICULTIES, Levels, family
from segar.metrics import decompose, w2_debiased
from segar.support import emd

FAMILIES = ("empty", "objectsx1", "tilesx1", "hazardtilesx1")
COUNTS = (1, 10, 50, 100, 200)
TEST_LEVELS, TEST_SEED = 300, 0  # of the runs at scale standard
FIRST_SEED = 1  # of the runs
FLOORS = 5  # pairs of fresh sets that a floor is measured from
SEARCH_SEED = 0  # of the planner and of random actions
UNMATCHED = "unmatched"  # the part of entities without counterpart: another type, or none


def run(
    output: Path = Path("training_sets"),
    families: tuple[str, ...] = FAMILIES,
    difficulties: tuple[str, ...] = DIFFICULTIES,
    counts: tuple[int, ...] = COUNTS,
    seeds: int = 6,
    designs: tuple[str, ...] = ("iid",),
    levels: int = TEST_LEVELS,
) -> None:
    """Writes ``training_sets.csv`` into the folder ``output``."""
    rows = [
        row
        for kind, difficulty in product(families, difficulties)
        for row in sets_of_panel(kind, difficulty, counts, range(FIRST_SEED, FIRST_SEED + seeds), designs, levels)
    ]
    write_csv(output / "training_sets.csv", pd.DataFrame(rows), 8)


def sets_of_panel(
    kind: str, difficulty: str, counts: Iterable[int], seeds: Sequence[int], designs: Sequence[str], test_levels: int
) -> list[dict[str, Any]]:
    """One row per training set of a panel; a design that is not found for a seed is left out, which a line says."""
    name = f"{kind}-{difficulty}"
    dist = family(name)
    test = dist.sample(test_levels, seed=TEST_SEED, split="test")
    best, moved = plan(test, rng=np.random.default_rng(SEARCH_SEED)), controllable(test)
    rows = []
    for n in counts:
        # The squared exact W2 that sets of these sizes have because they are finite.
        rng = np.random.default_rng([n, len(test)])
        found = w2_debiased(dist.sample(n, seed=FIRST_SEED), test, rng=rng, repeats=FLOORS)
        for seed, design in product(seeds, designs):
            place = {"family": kind, "difficulty": difficulty, "n": n, "seed": seed, "design": design}
            try:
                train = pick_levels(dist, LevelsConfig(train=name, count=n, seed=seed, design=design), test)
            except LevelError as error:  # no such set is found, and no agent is trained on it
                print(f"{name}, n {n}, seed {seed}, {design}: left out, because {error}")
                continue
            rows.append({**place, **measures(train, test, found.value**2 - found.square, best, moved)})
    return rows


def controllable(levels: Levels) -> set[tuple[type, type]]:
    """The pairs of an entity type and a factor that actions change, in a slot that the type has in any of the levels."""
    layout = levels.layout
    pairs = influence(levels, rng=np.random.default_rng(SEARCH_SEED)).of_kind("endogenous")
    slots = dict(zip(layout.names, levels.types.T, strict=True))
    return {
        (layout.types[t], layout.factor(factor)) for name, factor in pairs for t in np.unique(slots[name]) if t >= 0
    }


def measures(train: Levels, test: Levels, floor: float, best: Plan, moved: Set[tuple[type, type]]) -> dict[str, float]:
    """The measures of one training set.

    Args:
        floor: of the squared exact W2.
        best: the plans of the test levels.
        moved: as :func:`controllable` finds them there.
    """
    parts = decompose(train, test)
    square = parts.value**2
    by_factor = parts.by_factor
    position, types = by_factor.get(Position.__name__, 0.0), by_factor.get(UNMATCHED, 0.0)
    rest = square - floor
    own = plan(train, rng=np.random.default_rng(SEARCH_SEED))
    responses = dynamics_distances(train, test, rng=np.random.default_rng(SEARCH_SEED))
    others = sum(part for pair, part in parts.parts.items() if pair not in moved)
    return {
        "w2_position": position_w2(train, test),
        "w2_debiased": float(np.sign(rest) * np.sqrt(abs(rest))),
        "part_position": position,
        "part_properties": square - position - types,
        "part_types": types,
        "w1_policy": emd(policy_similarity(own, best)),
        "w2_response": float(np.sqrt(emd(responses**2))),
        "w2_uncontrollable": float(np.sqrt(max(others, 0.0))),
    }


def position_w2(train: Levels, test: Levels) -> float:
    """W2 of the places of the ball, of the goal, and of everything else, each in standard deviations of the test levels.

    A thing is compared with a thing of any other type, so that this distance sees places alone. Other things of a level
    are compared in the order of their slots.
    """
    own, others = (places(levels) for levels in (train, test))
    width = others.std(axis=0)
    scale = np.sqrt((width**2).reshape(-1, 2).mean(axis=1)).repeat(2)  # one unit for both components
    scale[scale < 1e-9] = np.inf  # what does not vary has no weight
    return float(np.sqrt(emd(cdist(own / scale, others / scale, "sqeuclidean"))))


def places(levels: Levels) -> np.ndarray:
    """x and y of the ball, the goal and all other things of each level, float64 ``[levels, 2 * things]``.

    All levels have to have equally many things.
    """
    x = levels.layout.columns[Position]
    rows = []
    for k in range(len(levels)):
        present = np.flatnonzero(np.isfinite(levels.values[k, :, x]))
        kinds = [levels.layout.types[t] for t in levels.types[k][present]]
        order = sorted(range(len(kinds)), key=lambda i: (kinds[i] is not GolfBall, kinds[i] is not GoalTile, i))
        rows.append(levels.values[k, present[order], x : x + 2].ravel())
    return np.array(rows)


if __name__ == "__main__":
    run_from_command_line(run)
