"""``segar sample``, ``distance``, ``hardness``, ``describe``: levels, how far sets of them are apart, how a random policy, the
scripted player and the oracle fare on them, and their priors."""

import argparse
import dataclasses
import warnings
from typing import Any

import numpy as np

from segar import metrics
from segar.cli import arguments
from segar.cli.figures import draw_marginals
from segar.errors import PriorError, UnseenDifferenceWarning
from segar.hardness import hardness as measured_hardness
from segar.hardness import influence
from segar.levels import level_schema
from segar.playground import composition, described

AMONG = 200  # levels, such as those of a training, among which another may be
MODES = ("exact", "reference", "paper")


def add_commands(commands: Any) -> None:
    """Add the commands about levels to the sub-commands of a parser."""
    sampling = arguments.command(commands, "sample", sample, "sample levels into a file")
    arguments.add_levels(sampling)
    arguments.add_output(
        sampling, "the level file to be written, .npz or .json", required=True, endings=(".npz", ".json")
    )

    schema = arguments.command(commands, "schema", show_schema, "print the JSON Schema of level files, for editors")
    schema.add_argument(
        "name", metavar="family", nargs="?", help=f"with its entities and factors: {arguments.NAME_HELP}"
    )

    comparing = arguments.command(commands, "distance", distance, "measure how far two level sets are apart")
    comparing.add_argument("a", metavar="A", help=arguments.FILE_HELP)
    comparing.add_argument("b", metavar="B", help="another one")
    comparing.add_argument("--mode", choices=MODES, default="exact", help="of the W2 distance (default: %(default)s)")
    comparing.add_argument(
        "--resamples",
        type=arguments.at_least(19),
        metavar="N",
        help="also test whether both have one distribution, by N random deals, at least 19",
    )
    comparing.add_argument("--world", help=arguments.WORLD_HELP)
    arguments.add_number(comparing, "--seed", "of the deals", least=0, default=0)

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

    describing = arguments.command(
        commands, "describe", describe, "show the distributions of all factors of a level distribution"
    )
    describing.add_argument("name", metavar="family", help=arguments.NAME_HELP)
    arguments.add_output(describing, "also draw all marginals (png, pdf or svg)", required=False)


def sample(chosen: argparse.Namespace) -> None:
    """``segar sample``."""
    levels = arguments.sampled_levels(chosen)
    levels.save(chosen.output)
    origin = levels.provenance
    answer = {"file": chosen.output, "levels": len(levels), "name": origin.name, "distribution": origin.distribution}
    answer |= {"seed": origin.seed, "split": origin.split}
    arguments.print_answer(chosen, answer, f"{chosen.output}: {repr(levels).strip('<>')}")


def show_schema(chosen: argparse.Namespace) -> None:
    """``segar schema``."""
    arguments.print_json(level_schema(None if chosen.name is None else arguments.find_distribution(chosen.name).layout))


def distance(chosen: argparse.Namespace) -> None:
    """``segar distance``."""
    a, b = (arguments.load_levels(path, chosen.world) for path in (chosen.a, chosen.b))
    warnings.simplefilter("ignore", UnseenDifferenceWarning)  # the answer says it
    by_factor = metrics.ks_by_factor(a, b)
    answer: dict[str, Any] = {"a": chosen.a, "b": chosen.b, "levels": [len(a), len(b)], "mode": chosen.mode}
    answer |= {"w2": metrics.w2(a, b, chosen.mode), "ks": metrics.ks(a, b)}
    if chosen.resamples:
        rng = np.random.default_rng(chosen.seed)
        w2 = metrics.w2_report(a, b, chosen.mode, rng=rng, resamples=chosen.resamples)
        ks = metrics.ks_report(a, b, rng=rng, resamples=chosen.resamples)
        answer |= {"w2_95": [w2.low, w2.high], "w2_floor": w2.floor, "w2_p_value": w2.p_value, "ks_p_value": ks.p_value}
    answer["unseen"] = list(metrics.unseen_differences(a, b, chosen.mode))
    answer["ks_by_factor"] = dict(sorted(by_factor.items(), key=lambda item: -item[1]))
    shown_apart = ("a", "b", "unseen", "ks_by_factor")
    measures = [(name, value) for name, value in answer.items() if name not in shown_apart]
    factors = list(answer["ks_by_factor"].items())
    tables = arguments.table(("measure", "value"), measures), arguments.table(("factor", "ks"), factors)
    unseen = "".join(f"\n\nnot seen by w2: {text}" for text in answer["unseen"])
    arguments.print_answer(chosen, answer, "\n\n".join(tables) + unseen)


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
    overall = [(name, value) for name, value in answer.items() if name not in ("per_level", "factors")]
    tables = [arguments.records(answer["per_level"]), arguments.table(("all levels", ""), overall)]
    if chosen.factors:
        tables.append(arguments.records(answer["factors"]))
    arguments.print_answer(chosen, answer, "\n\n".join(tables))


def describe(chosen: argparse.Namespace) -> None:
    """``segar describe``."""
    distribution = arguments.find_distribution(chosen.name)
    rows, slots = [one.row() for one in described(distribution)], composition(distribution)
    if chosen.output:
        draw_marginals(distribution, chosen.output, chosen.name)
    answer = {"name": chosen.name, "distribution": distribution.hash, "entities": slots, "marginals": rows}
    answer["shared"] = shared = _shared(distribution)
    entities = [(name, " | ".join(_shares(slot)), slot["there"]) for name, slot in slots.items()]
    head = ("entity", "factor", "distribution", "mean", "sd", "low", "high")
    text = arguments.table(("entity", "types", "there"), entities)
    text += "\n\n" + arguments.table(head, [list(row.values()) for row in rows])
    if shared is None:
        text += "\n\nshared levels: priors depend on other factors, or too many levels have a probability; sample, and count"
    else:
        text += f"\n\ntwo draws are the same level with probability {shared['two']:.3g} (+- {shared['two_error']:.1g})"
        text += f"; a level is one of {AMONG} others with {shared['among']:.3g} (+- {shared['among_error']:.1g})"
    if chosen.output:
        answer["figure"] = chosen.output
        text += f"\n\n{chosen.output}: all marginals that are not constant"
    arguments.print_answer(chosen, answer, text)


def _shared(distribution: Any) -> dict[str, float] | None:
    """How likely two draws are the same level, and that a level is one of 200 others; None where that is not known exactly."""
    try:
        two, among = distribution.shared_probability(), distribution.shared_probability(AMONG)
    except PriorError:
        return None
    return {"two": two.value, "two_error": two.error, "among": among.value, "among_error": among.error, "levels": AMONG}


def _shares(slot: dict[str, Any]) -> list[str]:
    """The types of an entity, with their probabilities where there are several."""
    if len(slot["types"]) == 1:
        return slot["types"]
    return [f"{name} {share:.3g}" for name, share in zip(slot["types"], slot["probabilities"], strict=True)]
