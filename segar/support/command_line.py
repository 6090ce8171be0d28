"""What all commands that are not Hydra's share: argparse, with refusals of one line."""

import argparse
import sys
from typing import Any, NoReturn

USAGE_ERROR = 2  # exit status of what is not known or makes no sense, as argparse has it


class Parser(argparse.ArgumentParser):
    """argparse's parser, of which a refusal is one line."""

    def error(self, message: str) -> NoReturn:
        """Ends the process."""
        self.exit(USAGE_ERROR, f"{self.prog}: {message}; see {self.prog} --help\n")

    def print_help(self, file: Any = None) -> None:
        """Writes the help; a reader that is gone is told to the caller, which argparse would hide."""
        (file or sys.stdout).write(self.format_help())
