"""Playgrounds on the site: the frame that shows one, and the pages that the commands of the tutorial make.

``python docs/site/playgrounds.py`` runs these commands and writes their pages to ``build/site-playgrounds/tutorial``, unless
they are there and neither the tutorial's programs nor the sources have changed.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

ROOT = Path(__file__).parents[2]
BUILD = ROOT / "build"
PLAYGROUNDS = BUILD / "site-playgrounds"
TUTORIAL = ROOT / "docs" / "tutorial.md"
FOLDER = PLAYGROUNDS / "tutorial"
MADE_FROM = BUILD / "site-tutorial.sha256"  # what the pages in FOLDER were made from
SOURCES = ("segar", "experiments", "conf", "constraints.txt")  # what the pages depend on, besides the tutorial

BLOCK = re.compile(r"^```(python|bash)\n(.*?)^```$", re.M | re.S)
FILE = re.compile(r"# (my_lab/\w+\.py)\n")
PAGE = re.compile(r"^segar playground .*?-o (\S+\.html)$", re.M | re.S)
# The tutorial trains ten agents, and its page shows one of them, which is the only one that the site needs.
ALL_AGENTS, SHOWN_AGENT = "levels.count=1,3,10,30,100 seed=1,2", "levels.count=10 seed=1"


def frame(file: str, title: str) -> str:
    """A frame that shows a playground, and a link to it, in Markdown."""
    shown = f'<iframe class="playground" src="{file}" title="playground of {title}" loading="lazy"></iframe>'
    return f'\n<div class="playground">{shown}</div>\n\n[The playground as a page of its own](here:{file}).\n'


def with_frames(tutorial: str) -> str:
    """The text of the tutorial, with a frame below each block that makes a page."""

    def framed(block: re.Match[str]) -> str:
        frames = (frame(f"{FOLDER.name}/{file}", Path(file).stem) for file in PAGE.findall(block[2]))
        return block[0] + "".join(f"\n{one}" for one in frames)

    return BLOCK.sub(framed, tutorial)


def write_playgrounds() -> None:
    """Write the pages of the tutorial, unless they are there as they would be made now."""
    blocks = BLOCK.findall(TUTORIAL.read_text(encoding="utf-8"))
    files = [file for _, body in blocks for file in PAGE.findall(body)]
    made_from = digest(blocks)
    if (
        MADE_FROM.exists()
        and MADE_FROM.read_text(encoding="utf-8") == made_from
        and all((FOLDER / file).exists() for file in files)
    ):
        return
    MADE_FROM.unlink(missing_ok=True)
    shutil.rmtree(FOLDER, ignore_errors=True)
    FOLDER.mkdir(parents=True)
    print(
        f"Running the commands of docs/tutorial.md, which make {', '.join(files)}; of the ten agents, one is trained.",
        flush=True,
    )
    with tempfile.TemporaryDirectory() as lab:
        run_commands(blocks, Path(lab))
        for file in files:
            shutil.copyfile(Path(lab) / file, FOLDER / file)
    MADE_FROM.write_text(made_from, encoding="utf-8")


def digest(blocks: Sequence[tuple[str, str]]) -> str:
    """A hash of the tutorial's programs, of this file and of the sources."""
    found = hashlib.sha256(repr(blocks).encode())
    for path in (Path(__file__), *source_files()):
        found.update(f"{path.relative_to(ROOT)}\n".encode() + path.read_bytes())
    return found.hexdigest()


def source_files() -> Iterator[Path]:
    for place in SOURCES:
        inside = (ROOT / place).rglob("*") if (ROOT / place).is_dir() else [ROOT / place]
        yield from sorted(path for path in inside if path.is_file() and "__pycache__" not in path.parts)


def run_commands(blocks: Sequence[tuple[str, str]], lab: Path) -> None:
    """Write the tutorial's programs into a folder, and run its commands there.

    Raises:
        ValueError: the tutorial no longer trains the agents that this file knows.
        CalledProcessError: a command failed.
    """
    commands = [body for language, body in blocks if language == "bash"]
    if sum(body.count(ALL_AGENTS) for body in commands) != 1:
        raise ValueError(f"{TUTORIAL}: no command has '{ALL_AGENTS}' once; change ALL_AGENTS in {__file__}, too")
    for language, body in blocks:
        if language == "python" and (file := FILE.match(body)):
            (lab / file[1]).parent.mkdir(exist_ok=True)
            (lab / file[1]).write_text(body, encoding="utf-8")
    environment = os.environ | {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
    }
    for body in commands:
        command = ["bash", "-eu", "-c", body.replace(ALL_AGENTS, SHOWN_AGENT)]
        subprocess.run(command, cwd=lab, env=environment, check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    write_playgrounds()
