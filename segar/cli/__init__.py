"""The command ``segar``: levels, their distances and hardness, kernels, pictures, a game, pages, recordings, labs,
suites, published results, citations; and what packages register as entry points ``segar.commands``, such as ``segar train``."""

import argparse
import os
import signal
import sys
from collections.abc import Collection, Sequence
from importlib.metadata import EntryPoint, entry_points

from segar.cli import cite, gallery, kernels, lab, levels, play, playground, record, results, suites
from segar.cli.arguments import load_playable, table
from segar.errors import SegarError
from segar.support import USAGE_ERROR, Parser, __version__, escape_what_cannot_be_printed, need

COMPLETION = ("-sc", "--shell-completion")  # by which Hydra is asked what could stand in a command line
REGISTERED = "segar.commands"
FURTHER = {"search": ("optuna",), "dashboard": ("flask",)}  # packages of commands, beside those that all of ours need
FAILURE = 1  # exit status where the machine refuses
INTERRUPTED = 128 + signal.SIGINT  # exit status after Ctrl-C, as shells have it


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command with these arguments (default: the process's) and return its exit status."""
    escape_what_cannot_be_printed()
    given = [*(sys.argv[1:] if arguments is None else arguments)]
    name = completed_command() if given[:1] and given[0] in COMPLETION else "".join(given[:1])
    registered = entry_points(group=REGISTERED)
    try:
        if (folder := os.getcwd()) not in sys.path:
            sys.path.append(folder)  # one's own modules are found; none, such as a segar.py, hides an installed one
        if name in registered.names:
            run_registered(registered[name], given[1:] if name in given else given)
        else:
            chosen = make_parser(registered.names).parse_args(arguments)
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
        place = f"{error.filename or 'the working folder or a disk'}: "
        print(f"segar: {place}{error.strerror or error}; make room or give access, then try again", file=sys.stderr)
        return FAILURE
    return 0


def completed_command() -> str:
    """The command whose line a shell completes; it is taken out of the line, which is then as Hydra expects it."""
    program, name, *rest = [*os.environ.get("COMP_LINE", "").split(" ", 2), "", ""]
    os.environ["COMP_LINE"] = f"{program} {rest[0]}"
    return name


def run_registered(command: EntryPoint, arguments: list[str]) -> None:
    """Call the function of a command with these arguments in ``sys.argv``; raises :class:`SegarError` if packages lack."""
    if command.module.startswith("segar."):
        need(f"segar {command.name}", "hydra", "pandas", *FURTHER.get(command.name, ()))
    sys.argv[1:] = arguments
    command.load()()


def make_parser(registered: Collection[str] = ()) -> argparse.ArgumentParser:
    """The parser of all commands but those that are registered; what it parsed has ``run``, to be called with it."""
    more = f"Further commands, each with a --help of its own: {', '.join(sorted(registered))}"
    parser = Parser("segar", description=__doc__, epilog=more if registered else None)
    parser.add_argument("--version", action="version", version=f"segar {__version__}")
    commands = parser.add_subparsers(required=True, metavar="command")
    for module in (levels, kernels, gallery, play, playground, record, lab, suites, results, cite):
        module.add_commands(commands)
    return parser
