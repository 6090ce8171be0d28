"""The command ``segar``: levels, their distances and hardness, kernels, pictures, a game, pages, recordings, labs,
suites, published results, citations."""

import argparse
import os
import signal
import sys
from collections.abc import Sequence

from segar.cli import (
    cite,
    gallery,
    hardness,
    kernels,
    lab,
    levels,
    play,
    playground,
    record,
    results,
    studio,
    suites,
)
from segar.cli.arguments import load_levels, table
from segar.errors import SegarError
from segar.support import USAGE_ERROR, Parser, __version__, escape_what_cannot_be_printed

FAILURE = 1  # exit status where the machine refuses
INTERRUPTED = 128 + signal.SIGINT  # exit status after Ctrl-C, as shells have it


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command with these arguments (default: the process's) and return its exit status."""
    escape_what_cannot_be_printed()
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())  # one's own modules are found as with `python -m`
    chosen = make_parser().parse_args(arguments)
    try:
        chosen.run(chosen)
        sys.stdout.flush()
    except SegarError as error:
        print(f"segar: {error}", file=sys.stderr)
        return USAGE_ERROR
    except KeyboardInterrupt:
        print("segar: stopped; what was finished before is kept", file=sys.stderr)
        return INTERRUPTED
    except MemoryError as error:
        print(f"segar: there is not enough memory ({error}); ask for smaller numbers", file=sys.stderr)
        return FAILURE
    except BrokenPipeError:  # `segar kernel show ... | head` has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        print(f"segar: {place}{error.strerror or error}; make room or give access, then try again", file=sys.stderr)
        return FAILURE
    return 0


def make_parser() -> argparse.ArgumentParser:
    """The parser of all commands; what it parsed has ``run``, to be called with it."""
    parser = Parser("segar", description=__doc__)
    parser.add_argument("--version", action="version", version=f"segar {__version__}")
    commands = parser.add_subparsers(required=True, metavar="command")
    for module in (
        levels,
        hardness,
        kernels,
        gallery,
        play,
        playground,
        studio,
        record,
        lab,
        suites,
        results,
        cite,
    ):
        module.add_commands(commands)
    return parser
