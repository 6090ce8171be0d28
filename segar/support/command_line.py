"""What all commands that are not Hydra's share: argparse, with refusals of one line."""

import argparse
import io
import os
import sys
from typing import Any, NoReturn

USAGE_ERROR = 2  # exit status of what is not known or makes no sense, as argparse has it


def escape_what_cannot_be_printed() -> None:
    """Have characters that the terminal's encoding lacks printed as escapes, where Python would end the program.

    What the caller closed, as by ``>&-``, leads nowhere from now on; else the next file would be opened in its place.
    """
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        continue
    os.close(number)
    sys.stdout, sys.stderr = sys.stdout or os.fdopen(1, "w"), sys.stderr or os.fdopen(2, "w")
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


class Parser(argparse.ArgumentParser):
    """argparse's parser, of which a refusal is one line."""

    def error(self, message: str) -> NoReturn:
        """Ends the process."""
        self.exit(USAGE_ERROR, f"{self.prog}: {message}; see {self.prog} --help\n")

    def print_help(self, file: Any = None) -> None:
        """Writes the help; a reader that is gone is told to the caller, which argparse would hide."""
        (file or sys.stdout).write(self.format_help())
