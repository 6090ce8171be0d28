"""``segar studio``: the page of ``segar playground`` with the library behind it, for the browser of this machine."""

import argparse
import threading
import webbrowser
from pathlib import Path
from typing import Any

from segar.cli import arguments
from segar.cli.playground import add_level_sets, named_observation, named_sets, named_task
from segar.errors import SegarError
from segar.observations import OBSERVATIONS
from segar.playground import Studio
from segar.support import need

LARGEST_PORT = 65_535


def add_commands(commands: Any) -> None:
    """Add ``studio`` to the sub-commands of a parser."""
    purpose = "design levels in a browser: edit priors, draw, measure distances and hardness, plan"
    opening = commands.add_parser("studio", help=purpose, description=f"{purpose[0].upper()}{purpose[1:]}.")
    opening.add_argument(
        "what", metavar="WHAT", nargs="?", default="objectsx3-hard",
        help=f"{arguments.NAME_HELP}; a level file; or a suite (default: %(default)s)",
    )  # fmt: skip
    add_level_sets(opening)
    opening.add_argument("--runs", metavar="FOLDER", type=Path, help="below which runs have networks that play")
    opening.add_argument(
        "--observation", nargs="+", metavar="NAME", default=["rgb"],
        help=f"what agents see: {', '.join(sorted(OBSERVATIONS))}, or 'module:attribute' (default: rgb)",
    )  # fmt: skip
    arguments.add_number(opening, "--port", "of the server; 0 takes a free one", least=0, default=0)
    opening.add_argument("--no-browser", action="store_true", help="print the address, and open nothing")
    opening.set_defaults(run=studio)


def studio(chosen: argparse.Namespace) -> None:
    """``segar studio``; it ends with Ctrl-C."""
    need("the studio", "starlette", "uvicorn")
    from segar.playground.server import StudioServer

    if chosen.port > LARGEST_PORT:
        raise SegarError(f"--port: there are ports up to {LARGEST_PORT}, and no {chosen.port}")
    if chosen.runs is not None and not chosen.runs.is_dir():
        raise SegarError(f"--runs: there is no folder {chosen.runs}")
    levels, test = named_sets(chosen)
    made = Studio(
        levels,
        test,
        task=named_task(chosen, levels),
        observations={name: named_observation(name) for name in chosen.observation},
        runs=chosen.runs,
    )
    server = StudioServer(made, chosen.port)
    print(f"segar studio: {server.address}\nThe address is a secret of yours. Ctrl-C ends the studio.", flush=True)
    if not chosen.no_browser:
        threading.Thread(target=webbrowser.open, args=(server.address,), daemon=True).start()
    try:
        server.run()
    except KeyboardInterrupt:
        print("segar studio: ended")
