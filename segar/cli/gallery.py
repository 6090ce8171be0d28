"""``segar gallery``: a contact sheet of tasks, difficulties and renderers, or what the signs of pictures mean."""

import argparse
from typing import Any

from segar.cli.arguments import at_least, command, print_answer
from segar.cli.contact_sheet import contact_sheet, save_png
from segar.cli.legend import legend


def add_commands(commands: Any) -> None:
    """Add ``gallery`` to the sub-commands of a parser."""
    made = command(commands, "gallery", gallery, "draw a contact sheet of all tasks, difficulties and renderers")
    made.add_argument("-o", "--output", required=True, metavar="FILE", help="the picture (png) to be written")
    made.add_argument("--seed", type=at_least(0), default=0, help="of the levels (default: %(default)s)")
    made.add_argument("--signs", action="store_true", help="draw one level with all signs that pictures have instead")
    made.add_argument("--colours", type=at_least(2), help="at most so many, up to 256, for a smaller file")


def gallery(chosen: argparse.Namespace) -> None:
    """``segar gallery``."""
    picture = legend() if chosen.signs else contact_sheet(chosen.seed)
    save_png(picture, chosen.output, chosen.colours)
    height, width, _ = picture.shape
    answer = {"file": chosen.output, "width": width, "height": height}
    print_answer(chosen, answer, f"{chosen.output}: {width} x {height} pixels")
