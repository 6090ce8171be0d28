"""``segar suites``: the suites that methods are compared on, and the card of one of them."""

import argparse
from typing import Any

from segar.cli import arguments
from segar.errors import SegarError
from segar.suites import CORE, card, suite, suites

SHOWN = ("axis", "shift", "says", "training_levels", "hash")
APART = ("name", "says", "differs", "hashes", "w2_by_factor", "ks_by_factor", "unseen")


def add_commands(commands: Any) -> None:
    """Add ``suites`` to the sub-commands of a parser."""
    purpose = "list the suites that methods are compared on, or tell of one of them"
    listing = arguments.command(commands, "suites", tell, purpose)
    listing.add_argument("name", metavar="SUITE", nargs="?", help="a suite; without it, all are listed")
    listing.add_argument(
        "--plans", metavar="FILE", help="write the plans of its test levels, found again by the planner"
    )


def tell(chosen: argparse.Namespace) -> None:
    """``segar suites``."""
    if chosen.plans and chosen.name is None:
        raise SegarError("--plans: name the suite whose plans are wanted")
    if chosen.plans:
        suite(chosen.name).plans.save(chosen.plans)
    elif chosen.name is None:
        found = [(one, one.name in CORE) for one in map(suite, suites())]
        answer = {one.name: {**{name: getattr(one, name) for name in SHOWN}, "core": core} for one, core in found}
        rows = [
            (one.name, one.axis, one.shift, one.training_levels, len(one.test_levels), core or "")
            for one, core in found
        ]
        head = ("suite", "axis", "shift", "training levels", "test levels", "core")
        arguments.print_answer(chosen, answer, arguments.table(head, rows))
    else:
        answer = card(suite(chosen.name))
        arguments.print_answer(chosen, answer, in_text(answer))


def in_text(answer: dict[str, Any]) -> str:
    """A card for people."""
    top = [(name, value) for name, value in answer.items() if name not in APART]
    differs = list(answer["differs"].items()) or [("nothing", "training and test have one distribution")]
    text = f"{answer['name']}: {answer['says']}\n\n{arguments.columns(top)}\n\n"
    text += arguments.table(("what differs", "in words"), differs)
    text += "\n\n" + arguments.table(("factor", "share of squared w2"), list(answer["w2_by_factor"].items()))
    if answer["ks_by_factor"]:
        text += "\n\n" + arguments.table(("marginal", "ks"), list(answer["ks_by_factor"].items()))
    return text + "".join(f"\n\nnot seen by w2: {one}" for one in answer["unseen"])
