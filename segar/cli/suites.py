"""``segar suites``: the suites that methods are compared on, and what one of them is made of."""

import argparse
import warnings
from typing import Any

from segar.cli import arguments
from segar.errors import UnseenDifferenceWarning
from segar.metrics import decompose
from segar.suites import Suite, suite, suites

SHOWN = ("axis", "shift", "says", "training_levels", "hash")
SEED = 1  # of the training levels whose distance to the test is told


def add_commands(commands: Any) -> None:
    """Add ``suites`` to the sub-commands of a parser."""
    purpose = "list the suites that methods are compared on, or tell of one of them"
    listing = arguments.command(commands, "suites", tell, purpose)
    listing.add_argument("name", metavar="SUITE", nargs="?", help="a suite; without it, all are listed")


def tell(chosen: argparse.Namespace) -> None:
    """``segar suites``."""
    if chosen.name is None:
        found = [suite(name) for name in suites()]
        rows = [(one.name, one.axis, one.shift, one.training_levels, len(one.test_levels)) for one in found]
        head = ("suite", "axis", "shift", "training levels", "test levels")
        answer = {one.name: {name: getattr(one, name) for name in SHOWN} for one in found}
        arguments.print_answer(chosen, answer, arguments.table(head, rows))
    else:
        answer = described(suite(chosen.name))
        apart = answer["w2_by_factor"]
        top = [(name, value) for name, value in answer.items() if name not in ("name", "says", "w2_by_factor")]
        text = f"{answer['name']}: {answer['says']}\n\n{arguments.columns(top)}\n\n"
        text += arguments.table(("factor", "share of squared w2"), list(apart.items()))
        arguments.print_answer(chosen, answer, text)


def described(found: Suite) -> dict[str, Any]:
    """What a suite is made of, and how far levels of its training are from those of its test, in W2 and by factor."""
    train = found.sample(SEED)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnseenDifferenceWarning)  # rules differ where the suite says so
        parts = decompose(train, found.test_levels)
    shares = {name: value / parts.value**2 for name, value in parts.by_factor.items() if value > 0}
    return {
        "name": found.name,
        **{name: getattr(found, name) for name in SHOWN},
        "test_levels": len(found.test_levels),
        "task": found.task.name,
        "max_steps": found.task.max_steps,
        "hidden": ", ".join(factor.__name__ for factor in found.hidden) or "nothing",
        "solved_by_planner": float(found.plans.solved.mean()),
        "w2": parts.value,
        "w2_by_factor": dict(sorted(shares.items(), key=lambda item: -item[1])),
    }
