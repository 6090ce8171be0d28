"""Files of ``docs/results`` that are published and not in git: the manifest that names them, and how they are fetched."""

import csv
import os
import sys
from collections.abc import Iterable
from dataclasses import astuple, dataclass, replace
from http.client import HTTPException
from pathlib import Path
from urllib.parse import quote
from urllib.request import urlopen

from segar.errors import SegarError
from segar.support.files import replacing
from segar.support.json_forms import data_in, from_csv
from segar.support.reading import sha256_of

ADDRESS = "SEGAR_RESULTS_URL"
WORKSPACE = Path(__file__).resolve().parents[2]
"""The checkout; of an installed package, the folder in which the command was called."""
if not (WORKSPACE / "pyproject.toml").is_file():
    WORKSPACE = Path.cwd()
RESULTS = WORKSPACE / "docs" / "results"
ROWS = RESULTS / "benchmark"  # of the leaderboard
MANIFEST = "manifest.csv"
COLUMNS = ("path", "bytes", "sha256", "made_by")
PATIENCE = 60.0  # [s] without a byte of a server


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
        if path.stat().st_size != self.bytes or sha256_of(path, "published file", SegarError) != self.sha256:
            raise SegarError(
                f"{path} is another file than the published one, {MANIFEST} says; move it away to fetch that"
            )
        return True

    def as_in(self, folder: Path) -> "Published":
        """The file with the size and the hash that it has in the folder."""
        path = folder / self.path
        return replace(self, bytes=path.stat().st_size, sha256=sha256_of(path, "file", SegarError))


def read_manifest(folder: Path) -> list[Published]:
    """The published files of a folder of results; raises :class:`SegarError` where its manifest is missing or misshapen."""
    path = folder / MANIFEST
    if not path.exists():
        raise SegarError(f"there is no {path}: name a folder of results (--folder), or run this in a checkout")
    rows = data_in(path, "a manifest", SegarError, lambda text: from_csv(text, COLUMNS))
    for number, row in enumerate(rows, 2):
        fits = "".join(row.values()).isprintable() and row["bytes"].isdecimal() and len(row["bytes"]) < 16
        if not fits or not (folder / row["path"]).resolve().is_relative_to(folder.resolve()):
            raise SegarError(f"{path}, line {number}: it must have {', '.join(COLUMNS)}, and a path in the folder")
    return [Published(**{**row, "bytes": int(row["bytes"])}) for row in rows]


def write_manifest(folder: Path, files: Iterable[Published]) -> None:
    """Write the manifest of a folder of results; raises :class:`SegarError`."""
    with replacing(folder / MANIFEST, "the manifest") as beside, beside.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([COLUMNS, *map(astuple, files)])


def fetch_published(one: Published, folder: Path) -> None:
    """Fetch one file from the address in ``SEGAR_RESULTS_URL``. It stands in the folder when it is whole and has its hash, and
    else nothing does.

    Raises:
        SegarError: there is no address, nothing can be got from there, or what came is another file.
    """
    again, address = f"this makes the file again: {one.made_by}", os.environ.get(ADDRESS, "")
    if not address.startswith(("http://", "https://", "file://")):
        stated = f"{address!r} is none" if address else "it is not set"
        raise SegarError(
            f"{ADDRESS} must be the address of the published files, http(s)://... or file:///folder; {stated}. For {one.path},"
            f" {again}"
        )
    url = f"{address.rstrip('/')}/{quote(one.path)}"
    with replacing(folder / one.path, "the published file", folder=True) as beside:
        try:
            with urlopen(url, timeout=PATIENCE) as came, beside.open("wb") as file:
                while file.tell() <= one.bytes and (part := came.read(2**20)):  # a server may send without end
                    file.write(part)
        except (OSError, HTTPException, ValueError) as error:
            raise SegarError(f"{url} cannot be got ({error}). For {one.path}, {again}") from error
        if beside.stat().st_size != one.bytes or sha256_of(beside, "published file", SegarError) != one.sha256:
            raise SegarError(
                f"{url} is not the published file of {one.bytes:,} bytes and SHA-256 {one.sha256}; nothing is kept"
            )
    print(f"{one.path}: {one.bytes:,} bytes", file=sys.stderr, flush=True)
