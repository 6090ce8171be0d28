"""``segar sample``, ``segar distance``, ``segar describe``: levels, how far sets of them are apart, and their laws."""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from segar import metrics
from segar.cli.arguments import (
    FILE_HELP,
    NAME_HELP,
    WORLD_HELP,
    at_least,
    command,
    find_distribution,
    load_levels,
    print_json,
    table,
)
from segar.cli.priors_text import composition, described

MODES = ("exact", "reference", "paper")


def add_commands(commands: Any) -> None:
    """Add ``sample``, ``distance`` and ``describe`` to the sub-commands of a parser."""
    sampling = command(commands, "sample", sample, "sample levels into a file")
    sampling.add_argument("name", metavar="family", help=NAME_HELP)
    sampling.add_argument("-n", "--number", type=at_least(1), default=100, help="of levels (default: %(default)s)")
    sampling.add_argument("--seed", type=at_least(0), default=0, help="of the sample (default: %(default)s)")
    sampling.add_argument("--split", default="train", help="such as train or test (default: %(default)s)")
    sampling.add_argument("-o", "--output", required=True, metavar="FILE", help="the level file (npz) to be written")

    comparing = command(commands, "distance", distance, "measure how far two level sets are apart")
    comparing.add_argument("a", metavar="A", help=FILE_HELP)
    comparing.add_argument("b", metavar="B", help="another one")
    comparing.add_argument("--mode", choices=MODES, default="exact", help="of the W2 distance (default: %(default)s)")
    comparing.add_argument(
        "--resamples", type=at_least(19), metavar="N", help="also test for one law by N random deals, at least 19"
    )
    comparing.add_argument("--world", help=WORLD_HELP)
    comparing.add_argument("--seed", type=at_least(0), default=0, help="of the deals (default: %(default)s)")

    describing = command(commands, "describe", describe, "show the laws of all factors of a level distribution")
    describing.add_argument("name", metavar="family", help=NAME_HELP)
    describing.add_argument("-o", "--output", metavar="FILE", help="also draw all marginals (png, pdf or svg)")


def sample(chosen: argparse.Namespace) -> None:
    """``segar sample``."""
    levels = find_distribution(chosen.name).sample(chosen.number, chosen.seed, chosen.split)
    levels.save(chosen.output)
    origin = levels.provenance
    answer = {"file": chosen.output, "levels": len(levels), "name": origin.name, "distribution": origin.distribution}
    answer |= {"seed": origin.seed, "split": origin.split}
    print_json(answer) if chosen.json else print(f"{chosen.output}: {repr(levels).strip('<>')}")


def distance(chosen: argparse.Namespace) -> None:
    """``segar distance``."""
    a, b = (load_levels(path, chosen.world) for path in (chosen.a, chosen.b))
    by_factor = metrics.ks_by_factor(a, b)
    answer: dict[str, Any] = {"a": chosen.a, "b": chosen.b, "levels": [len(a), len(b)], "mode": chosen.mode}
    answer |= {"w2": metrics.w2(a, b, chosen.mode), "ks": metrics.ks(a, b)}
    if chosen.resamples:
        rng = np.random.default_rng(chosen.seed)
        w2 = metrics.w2_report(a, b, chosen.mode, rng=rng, resamples=chosen.resamples)
        ks = metrics.ks_report(a, b, rng=rng, resamples=chosen.resamples)
        answer |= {"w2_95": [w2.low, w2.high], "w2_floor": w2.floor, "w2_p_value": w2.p_value, "ks_p_value": ks.p_value}
    answer["ks_by_factor"] = dict(sorted(by_factor.items(), key=lambda item: -item[1]))
    if chosen.json:
        print_json(answer)
        return
    print(table(("measure", "value"), [(k, v) for k, v in answer.items() if k not in ("a", "b", "ks_by_factor")]))
    print("\n" + table(("factor", "ks"), list(answer["ks_by_factor"].items())))


def describe(chosen: argparse.Namespace) -> None:
    """``segar describe``."""
    distribution = find_distribution(chosen.name)
    rows, slots = [law.row() for law in described(distribution)], composition(distribution)
    if chosen.output:
        from segar.cli.figures import draw_marginals

        draw_marginals(distribution, chosen.output, chosen.name)
    if chosen.json:
        answer = {"name": chosen.name, "distribution": distribution.hash, "entities": slots, "marginals": rows}
        print_json(answer | ({"figure": chosen.output} if chosen.output else {}))
        return
    entities = [(name, " | ".join(_shares(slot)), slot["there"]) for name, slot in slots.items()]
    print(table(("entity", "types", "there"), entities))
    print("\n" + table(("entity", "factor", "law", "mean", "sd", "low", "high"), [list(row.values()) for row in rows]))
    if chosen.output:
        print(f"\n{chosen.output}: all marginals that are not constant")


def _shares(slot: dict[str, Any]) -> list[str]:
    """The types of an entity, with their probabilities where there are several."""
    if len(slot["types"]) == 1:
        return slot["types"]
    return [f"{name} {share:.3g}" for name, share in zip(slot["types"], slot["probabilities"], strict=True)]
