"""What the arguments of commands stand for, and the two forms of an answer: a table for people, one object for programs."""

import argparse
import difflib
import json
import os
import shutil
import sys
import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from segar.errors import LevelError, SegarError
from segar.language import Task
from segar.levels import TASK_LEVELS, LevelDistribution, Levels, families, family
from segar.rules import RuleSpace, World
from segar.suites import suites
from segar.support import aligned, named_or_made
from segar.tasks import make_task, task_of

NAME_HELP = (
    "a level family, or 'module:attribute' or 'file.py:attribute' of a LevelDistribution or a function that makes one"
)
TASK_HELP = "puttputt, billiards, invisiball, or 'module:attribute'; by default what the levels name"
WORLD_HELP = (
    "rules of your own, which level files do not hold: 'module:attribute' of a World, a LevelDistribution, a RuleSpace, a list"
    " of rules, or a function that makes one. Importing the module also defines the entities in it"
)
FILE_HELP = "a level file, as `segar sample` and Levels.save write it"


def find_distribution(name: str) -> LevelDistribution:
    """A named family, or one of the user's own; raises :class:`SegarError`."""
    if ":" not in name:
        if name not in (*families(), *TASK_LEVELS):
            _require_no_suite(name)
        return family(name)
    found = named_or_made(name)
    if not isinstance(found, LevelDistribution):
        raise SegarError(f"'{name}' is not a LevelDistribution but {found!r}")
    return found


def _require_no_suite(name: str) -> None:
    """Raise :class:`SegarError` for what is, or nearly is, the name of a suite."""
    near = difflib.get_close_matches(name, (*suites(), *families(), *TASK_LEVELS), n=1)
    if near and near[0] in suites():
        raise SegarError(
            f"'{name}' is no level family. The suite {near[0]} has levels of its own: `segar suites {near[0]}` tells of them,"
            f" `segar playground {near[0]}` shows them,"
            f" and segar.suites.suite('{near[0]}') has test_levels and sample(seed), which .save() writes"
        )


def task_named(name: str | None, levels: Levels) -> Task:
    """The task of that name with its default options, or the one that the levels are for."""
    return task_of(levels) if name is None else make_task(name)


def find_world(name: str) -> World:
    """The world that ``module:attribute`` names; raises :class:`SegarError`."""
    found = named_or_made(name)
    if isinstance(found, LevelDistribution):
        found = found.world or World()
    if isinstance(found, (list, tuple, RuleSpace)):
        found = World(rules=found)
    if not isinstance(found, World):
        raise SegarError(f"'{name}' is no World, LevelDistribution, RuleSpace or list of rules, but {found!r}")
    return found


def load_levels(path: str, world: str | None) -> Levels:
    """The levels in a file, in the world of that name, or in the one of the default rules.

    Raises:
        LevelError: it is no level file; where a distribution is named instead, the message says how to sample it.
    """
    if (":" in path or path in (*families(), *TASK_LEVELS)) and not os.path.exists(path):
        raise LevelError(
            f"there is no level file {path}. If it names a distribution, sample it first: segar sample {path} -o levels.npz"
        )
    return Levels.load(path, None if world is None else find_world(world))


def load_playable(path: str, world: str | None) -> Levels:
    """:func:`load_levels` with the rules that they are played by; raises :class:`LevelError` where these are not given."""
    levels = load_levels(path, world)
    if levels.world is None and levels.provenance.rules:
        rules = ", ".join(levels.provenance.rules)
        raise LevelError(
            f"{path}: these levels have rules of their own ({rules}), which a level file does not hold; give them by --world"
            " module:attribute, of a World, a LevelDistribution or a list of rules"
        )
    return levels


def command(
    commands: Any, name: str, run: Callable[[argparse.Namespace], None], purpose: str, *, answers: bool = True
) -> argparse.ArgumentParser:
    """A new sub-command; where it ``answers``, it can do so in JSON."""
    made = commands.add_parser(name, help=purpose, description=f"{purpose[0].upper()}{purpose[1:]}.")
    if answers:
        made.add_argument("--json", action="store_true", help="print one JSON object, and nothing else, on stdout")
    made.set_defaults(run=run)
    return made


def add_levels(parser: argparse.ArgumentParser, seed_of: str = "the levels") -> None:
    """Add the arguments that say which levels are sampled."""
    parser.add_argument("name", metavar="family", help=NAME_HELP)
    parser.add_argument("-n", "--number", type=at_least(1), default=100, help="of levels (default: %(default)s)")
    add_number(parser, "--seed", f"of {seed_of}", least=0, default=0)
    parser.add_argument("--split", default="train", help="such as train or test (default: %(default)s)")


def sampled_levels(chosen: argparse.Namespace) -> Levels:
    """The levels that the arguments of :func:`add_levels` name."""
    return find_distribution(chosen.name).sample(chosen.number, chosen.seed, chosen.split)


def add_output(parser: argparse.ArgumentParser, purpose: str, *, required: bool, endings: Sequence[str] = ()) -> None:
    """Add the option that names what is written; ``endings`` are those that its name may have, besides none."""

    def place(text: str) -> str:
        if not text:
            raise argparse.ArgumentTypeError("is empty; name a file")
        if endings and os.path.splitext(text)[1].lower() not in ("", *endings):
            raise argparse.ArgumentTypeError(f"must end in {' or '.join(endings)}, not '{text}'")
        return text

    parser.add_argument("-o", "--output", type=place, required=required, metavar="FILE", help=purpose)


def add_number(parser: argparse.ArgumentParser, name: str, purpose: str, *, least: int, default: int) -> None:
    """Add an option that is a whole number from ``least`` up."""
    parser.add_argument(name, type=at_least(least), default=default, help=f"{purpose} (default: %(default)s)")


def at_least(least: int) -> Callable[[str], int]:
    """The type of an argument that is a whole number from ``least`` up."""

    def whole_number(text: str) -> int:
        try:
            number = int(text)
        except ValueError:
            number = least - 1
        if number < least:
            raise argparse.ArgumentTypeError(f"must be a whole number from {least} up, not '{text}'")
        return number

    return whole_number


def print_answer(chosen: argparse.Namespace, answer: Mapping[str, Any], text: str) -> None:
    """Print the answer as one JSON object where the user asked for that, else the text, whose lines end at blanks."""
    print_json(answer) if chosen.json else print(_fitted(text))


def print_json(answer: Mapping[str, Any]) -> None:
    """Print one JSON object; numbers that JSON does not know become null."""
    finite = json.loads(json.dumps(answer), parse_constant=lambda name: None)  # which names NaN or an infinity
    print(json.dumps(finite, indent=1))


def table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """Rows in columns below a head, numbers in short, None as a dash."""
    return columns([head, *rows])


def records(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows that name their values, one or more, as :func:`table` has them."""
    return table([*rows[0]], [[*row.values()] for row in rows])


def columns(rows: Sequence[Sequence[Any]]) -> str:
    """Rows in columns, numbers in short, None as a dash."""
    return _fitted(aligned([[_cell(value) for value in row] for row in rows]))


def _fitted(text: str) -> str:
    """The text, with lines broken at blanks where the terminal is too narrow; what is no terminal, such as a file, is not."""
    width = shutil.get_terminal_size((sys.maxsize, 0)).columns
    wrap = textwrap.TextWrapper(width, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False)
    return "\n".join(wrap.fill(line) if len(line) > width else line for line in text.split("\n"))


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (list, tuple)):
        return ", ".join(map(_cell, value))
    return f"{value:.4g}" if isinstance(value, float) else str(value)
