"""``segar results``: files of ``docs/results`` that are published and not in git: what they are, and how to get them."""

import argparse
import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from segar.cli import arguments
from segar.errors import SegarError, did_you_mean
from segar.support import ADDRESS, MANIFEST, RESULTS, Published, counted, fetch_published, read_manifest, write_manifest


def add_commands(commands: Any) -> None:
    """Add ``results`` to the sub-commands of a parser."""
    group = commands.add_parser("results", help="published files of docs/results that are not in git")
    actions = group.add_subparsers(required=True, metavar="command")
    for name, run, purpose in (
        ("list", list_files, "print each file, whether it is here, and the command that makes it again"),
        ("fetch", fetch, f"get files from the address in {ADDRESS}, http(s):// or file://, and check them"),
        ("record", record, f"note size and SHA-256 of the files that are here in {MANIFEST}, for who made them again"),
    ):
        one = arguments.command(actions, name, run, purpose)
        one.add_argument(
            "paths", metavar="PATH", nargs="*", help="files or folders in it, such as benchmark/random; all by default"
        )
        one.add_argument(
            "--folder", type=Path, default=RESULTS, help="that has manifest.csv; docs/results of this checkout"
        )


def list_files(chosen: argparse.Namespace) -> None:
    """``segar results list``."""
    files = chosen_files(chosen.folder, chosen.paths)
    rows = [{**asdict(one), "here": (chosen.folder / one.path).exists()} for one in files]
    lines = [[one["path"], f"{one['bytes']:,}", one["here"], one["made_by"]] for one in rows]
    arguments.print_answer(chosen, {"files": rows}, arguments.table(["path", "bytes", "here", "made again by"], lines))


def fetch(chosen: argparse.Namespace) -> None:
    """``segar results fetch``."""
    missing = [one for one in chosen_files(chosen.folder, chosen.paths) if not one.is_in(chosen.folder)]
    for one in missing:
        fetch_published(one, chosen.folder)
    arguments.print_answer(
        chosen, {"fetched": [one.path for one in missing]}, f"fetched: {counted(len(missing), 'file')}"
    )


def record(chosen: argparse.Namespace) -> None:
    """``segar results record``."""
    asked = {one.path for one in chosen_files(chosen.folder, chosen.paths) if (chosen.folder / one.path).exists()}
    files = read_manifest(chosen.folder)
    write_manifest(chosen.folder, [one.as_in(chosen.folder) if one.path in asked else one for one in files])
    arguments.print_answer(chosen, {"recorded": sorted(asked)}, f"{chosen.folder / MANIFEST} is written")


def chosen_files(folder: Path, paths: Sequence[str]) -> list[Published]:
    """The published files that some paths name, each a file or a folder; all of them where there are none."""
    files = read_manifest(folder)
    for path in paths:
        if not any(Path(one.path).is_relative_to(path) for one in files):
            known = sorted({name for one in files for name in (one.path, os.path.dirname(one.path))})
            raise SegarError(f"no published file is {path} or lies in it.{did_you_mean(path, known)}")
    return [one for one in files if not paths or any(Path(one.path).is_relative_to(path) for path in paths)]
