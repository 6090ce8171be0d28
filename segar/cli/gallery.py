"""``segar gallery``: contact sheets of tasks, difficulties and renderers."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from segar.cli.arguments import at_least, command, print_json
from segar.errors import SegarError
from segar.rendering.gallery import contact_sheet, features_sheet, save_png, tasks_sheet

FIGURES = {"gallery.png": contact_sheet, "tasks.png": tasks_sheet, "features.png": features_sheet}


def add_commands(commands: Any) -> None:
    """Add ``gallery`` to the sub-commands of a parser."""
    made = command(commands, "gallery", gallery, "draw a contact sheet of all tasks, difficulties and renderers")
    made.add_argument(
        "-o",
        "--output",
        required=True,
        metavar="PLACE",
        help=f"a .png for the contact sheet; or a folder for all figures: {', '.join(FIGURES)}",
    )
    made.add_argument("--seed", type=at_least(0), default=0, help="of the levels (default: %(default)s)")
    made.add_argument("--colours", type=at_least(2), help="at most so many, up to 256, for smaller files")


def gallery(chosen: argparse.Namespace) -> None:
    """``segar gallery``."""
    output = Path(chosen.output)
    figures = {output: contact_sheet} if output.suffix else {output / name: draw for name, draw in FIGURES.items()}
    if not output.suffix:
        make_folder(output)
    answer = {}
    for path, draw in figures.items():
        picture = draw(seed=chosen.seed)
        save_png(picture, path, chosen.colours)
        answer[str(path)] = list(picture.shape[1::-1])
    if chosen.json:
        print_json(answer)
    else:
        print("\n".join(f"{path}: {width} x {height} pixels" for path, (width, height) in answer.items()))


def make_folder(folder: Path) -> None:
    """Make a folder if it is not there; raises :class:`SegarError`."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as said:
        raise SegarError(f"the folder {folder} cannot be made: {said.strerror or said}") from said
