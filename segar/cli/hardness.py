"""``segar hardness``: how a random policy, the scripted player and the oracle fare on the levels of a file."""

import argparse
import dataclasses
from typing import Any

import numpy as np

from segar.cli import arguments
from segar.hardness import hardness as measured_hardness
from segar.hardness import influence


def add_commands(commands: Any) -> None:
    """Add ``hardness`` to the sub-commands of a parser."""
    hard = arguments.command(commands, "hardness", hardness, "say how hard levels are, without training")
    hard.add_argument("levels", metavar="LEVELS", help=arguments.FILE_HELP)
    hard.add_argument("--task", help=arguments.TASK_HELP)
    hard.add_argument("--world", help=arguments.WORLD_HELP)
    arguments.add_number(hard, "--seed", "of random policy and search", least=0, default=0)
    arguments.add_number(hard, "--plays", "random episodes per level", least=1, default=100)
    arguments.add_number(hard, "--samples", "candidates per round of the search", least=8, default=128)
    arguments.add_number(hard, "--iterations", "rounds of the search", least=1, default=10)
    arguments.add_number(hard, "--threads", "of the simulator", least=1, default=1)
    hard.add_argument(
        "--factors", action="store_true", help="also say which factors the agent can change, and how much"
    )
    arguments.add_output(
        hard, "also write the oracle's plan (npz), for segar.hardness.replay", required=False, endings=(".npz",)
    )


def hardness(chosen: argparse.Namespace) -> None:
    """``segar hardness``."""
    levels = arguments.load_playable(chosen.levels, chosen.world)
    task, rng = arguments.task_named(chosen.task, levels), np.random.default_rng(chosen.seed)
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
        arguments.print_json(answer)
        return
    rows = answer.pop("per_level")
    factors = answer.pop("factors", [])
    print(arguments.table(list(rows[0]), [list(row.values()) for row in rows]))
    print("\n" + arguments.table(("all levels", ""), list(answer.items())))
    if factors:
        print("\n" + arguments.table(list(factors[0]), [list(entry.values()) for entry in factors]))
