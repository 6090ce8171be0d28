"""``segar results``: files of ``docs/results`` that are published and not in git: what they are, and how to get them."""

import argparse
import csv
import hashlib
import os
import shutil
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, astuple, dataclass, replace
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlsplit
from urllib.request import url2pathname

from segar.cli import arguments
from segar.errors import SegarError, did_you_mean
from segar.support import counted, need, replacing

ADDRESS = "SEGAR_RESULTS_URL"
RESULTS = Path(__file__).resolve().parents[2] / "docs" / "results"  # of a checkout
MANIFEST = "manifest.csv"
COLUMNS = ("path", "bytes", "sha256", "made_by")


@dataclass(frozen=True)
class Published:
    """A published file.

    Attributes:
        path: relative to the folder of results. bytes, sha256: of its content.
        made_by: the command that makes it again.
    """

    path: str
    bytes: int
    sha256: str
    made_by: str

    def is_in(self, folder: Path) -> bool:
        """Whether the folder has the file; raises :class:`SegarError` if it has another file of that name."""
        path = folder / self.path
        if not path.exists():
            return False
        if path.stat().st_size != self.bytes or sha256_of(path) != self.sha256:
            raise SegarError(
                f"{path} is another file than the published one, {MANIFEST} says; move it away to fetch that"
            )
        return True


def add_commands(commands: Any) -> None:
    """Add ``results`` to the sub-commands of a parser."""
    group = commands.add_parser("results", help="published files of docs/results that are not in git")
    actions = group.add_subparsers(required=True, metavar="command")
    for name, run, purpose in (
        ("list", list_files, "print each file, whether it is here, and the command that makes it again"),
        ("fetch", fetch, f"get files from the address in {ADDRESS}, http(s):// or file://, and check them"),
        (
            "record",
            record,
            f"write size and SHA-256 of the files that are here into {MANIFEST}, for who made them again",
        ),
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
        get(one, chosen.folder, os.environ.get(ADDRESS, ""))
    arguments.print_answer(
        chosen, {"fetched": [one.path for one in missing]}, f"fetched: {counted(len(missing), 'file')}"
    )


def record(chosen: argparse.Namespace) -> None:
    """``segar results record``."""
    asked = {one.path for one in chosen_files(chosen.folder, chosen.paths)}
    files = [
        replace(one, bytes=path.stat().st_size, sha256=sha256_of(path)) if one.path in asked and path.exists() else one
        for one in read_manifest(chosen.folder)
        for path in [chosen.folder / one.path]
    ]
    with (
        replacing(chosen.folder / MANIFEST, "the manifest") as beside,
        open(beside, "w", encoding="utf-8", newline="") as file,
    ):
        csv.writer(file, lineterminator="\n").writerows([COLUMNS, *(astuple(one) for one in files)])
    arguments.print_answer(chosen, {"recorded": sorted(asked)}, f"{chosen.folder / MANIFEST} is written")


def read_manifest(folder: Path) -> list[Published]:
    """The published files of a folder of results; raises :class:`SegarError` where its manifest is missing or misshapen."""
    path = folder / MANIFEST
    try:
        rows = list(csv.DictReader(path.read_text(encoding="utf-8").splitlines(), strict=True))
    except OSError as error:
        raise SegarError(
            f"there is no {path}: name a folder of results with --folder, or run this in a checkout"
        ) from error
    for number, row in enumerate(rows, 2):
        inside = (folder / str(row.get("path"))).resolve().is_relative_to(folder.resolve())
        if tuple(row) != COLUMNS or None in row.values() or not row["bytes"].isdigit() or not inside:
            raise SegarError(f"{path}, line {number}: it must have {', '.join(COLUMNS)}, and a path in the folder")
    return [Published(**{**row, "bytes": int(row["bytes"])}) for row in rows]


def chosen_files(folder: Path, paths: Sequence[str]) -> list[Published]:
    """The published files that some paths name, each a file or a folder; all of them where there are none."""
    files = read_manifest(folder)
    for path in paths:
        if not any(is_under(one.path, path) for one in files):
            known = sorted({name for one in files for name in (one.path, os.path.dirname(one.path))})
            raise SegarError(f"no published file is {path} or lies in it.{did_you_mean(path, known)}")
    return [one for one in files if not paths or any(is_under(one.path, path) for path in paths)]


def is_under(path: str, place: str) -> bool:
    """Whether a path is this file or lies in this folder."""
    return path == place.rstrip("/") or path.startswith(place.rstrip("/") + "/")


def get(one: Published, folder: Path, address: str) -> None:
    """Fetch one file; it stands in the folder when it is whole and has its hash, and else nothing does.

    Raises:
        SegarError: there is no address, nothing can be got from there, or what came is another file.
    """
    again = f"this makes the file again: {one.made_by}"
    if urlsplit(address).scheme not in ("http", "https", "file"):
        stated = f"'{address}' is none" if address else "it is not set"
        raise SegarError(
            f"{ADDRESS} must be the address of the published files, http(s)://... or file:///folder; {stated}. For {one.path},"
            f" {again}"
        )
    need("segar results fetch", "pooch")
    import pooch

    pooch.get_logger().setLevel("WARNING")
    url, target = f"{address.rstrip('/')}/{quote(one.path)}", folder / one.path
    downloader: Any = copy_from_disk if urlsplit(url).scheme == "file" else pooch.HTTPDownloader(timeout=60)
    with tempfile.TemporaryDirectory(prefix=".unfinished-", dir=folder) as beside:
        try:
            pooch.retrieve(url, f"sha256:{one.sha256}", target.name, beside, downloader=downloader)
        except OSError as error:  # those of requests are such, too
            raise SegarError(f"{url} cannot be got ({error}). For {one.path}, {again}") from error
        except ValueError as error:
            raise SegarError(
                f"{url} is not the published file: its SHA-256 is not {one.sha256}; nothing is kept"
            ) from error
        target.parent.mkdir(parents=True, exist_ok=True)
        os.replace(Path(beside) / target.name, target)
    print(f"{one.path}: {one.bytes:,} bytes", file=sys.stderr, flush=True)


def copy_from_disk(url: str, output_file: str, _: object) -> None:
    """Pooch's downloader of file:// addresses."""
    shutil.copyfile(url2pathname(urlsplit(url).path), output_file)


def sha256_of(path: Path) -> str:
    """The SHA-256 of a file, in hexadecimal digits."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
