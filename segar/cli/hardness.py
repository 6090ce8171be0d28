"""``segar hardness``: how a random policy, the scripted player and the oracle fare on the levels of a file."""

import argparse
import dataclasses
from typing import Any

import numpy as np

from segar.cli.arguments import (
    FILE_HELP,
    TASK_HELP,
    WORLD_HELP,
    at_least,
    command,
    load_levels,
    print_json,
    table,
    task_named,
)
from segar.errors import LevelError
from segar.hardness import hardness as measured_hardness
from segar.hardness import influence


def add_commands(commands: Any) -> None:
    """Add ``hardness`` to the sub-commands of a parser."""
    hard = command(commands, "hardness", hardness, "say how hard levels are, without training")
    hard.add_argument("levels", metavar="LEVELS", help=FILE_HELP)
    hard.add_argument("--task", help=TASK_HELP)
    hard.add_argument("--world", help=WORLD_HELP)
    hard.add_argument("--seed", type=at_least(0), default=0, help="of random policy and search (default: %(default)s)")
    hard.add_argument("--plays", type=at_least(1), default=100, help="random episodes per level (default: %(default)s)")
    hard.add_argument(
        "--samples", type=at_least(8), default=128, help="candidates per round of the search (default: %(default)s)"
    )
    hard.add_argument("--iterations", type=at_least(1), default=10, help="rounds of the search (default: %(default)s)")
    hard.add_argument("--threads", type=at_least(1), default=1, help="of the simulator (default: %(default)s)")
    hard.add_argument(
        "--factors", action="store_true", help="also say which factors the agent can change, and how much"
    )
    hard.add_argument(
        "-o", "--output", metavar="FILE", help="also write the oracle's plan (npz), for segar.hardness.replay"
    )


def hardness(chosen: argparse.Namespace) -> None:
    """``segar hardness``."""
    levels = load_levels(chosen.levels, chosen.world)
    if levels.world is None and levels.provenance.rules:
        rules = ", ".join(levels.provenance.rules)
        raise LevelError(f"{chosen.levels}: these levels have rules of their own ({rules}); give them by --world")
    task, rng = task_named(chosen.task, levels), np.random.default_rng(chosen.seed)
    found = measured_hardness(
        levels,
        task,
        rng=rng,
        plays=chosen.plays,
        samples=chosen.samples,
        iterations=chosen.iterations,
        num_threads=chosen.threads,
    )
    answer: dict[str, Any] = {"file": chosen.levels, **found.summary(), "per_level": found.rows()}
    if chosen.factors:
        split = influence(levels, task, rng=rng)
        answer["factors"] = [dataclasses.asdict(entry) for entry in split.factors]
    if chosen.output:
        found.oracle.save(chosen.output)
        answer["plan"] = chosen.output
    if chosen.json:
        print_json(answer)
        return
    rows = answer.pop("per_level")
    factors = answer.pop("factors", [])
    print(table(list(rows[0]), [list(row.values()) for row in rows]))
    print("\n" + table(("all levels", ""), list(answer.items())))
    if factors:
        print("\n" + table(list(factors[0]), [list(entry.values()) for entry in factors]))
