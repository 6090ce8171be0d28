"""The programs in docs/ run as they are printed, as files of a package outside segar, and print what the pages say."""

from __future__ import annotations

import functools
import json
import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.places import ROOT

DOCS = ROOT / "docs"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.M | re.S)
FILE = re.compile(r"# my_lab/(\w+)\.py\n")
LINK = re.compile(r"\]\((?!https?:)([^)#\s]*)(#[^)\s]+)?\)")

# One process runs all programs of a page in order; a program is imported once, whoever imports it first.
RUN = """
import contextlib, importlib, io, json, sys
printed = {}
for name in sys.argv[2:]:
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        importlib.import_module("my_lab." + name)
    printed[name] = out.getvalue()
    with open(sys.argv[1], "w") as file:
        json.dump(printed, file)
"""


@dataclass(frozen=True)
class Program:
    """A python block of a page: the file that its first line names, and what the text block after it says."""

    page: str
    name: str
    source: str
    output: str | None


def programs_of(page: Path) -> list[Program]:
    blocks = BLOCK.findall(page.read_text())
    found = []
    for n, (language, body) in enumerate(blocks):
        if language != "python":
            continue
        file = FILE.match(body)
        assert file, f"{page.name}: the first line of a program must be '# my_lab/<name>.py', not {body[:60]!r}"
        following = blocks[n + 1] if n + 1 < len(blocks) else ("", "")
        found.append(Program(page.stem, file[1], body, following[1] if following[0] == "text" else None))
    return found


PAGES = {page.stem: programs_of(page) for page in sorted(DOCS.glob("*.md"))}
PROGRAMS = [program for programs in PAGES.values() for program in programs]


@functools.cache
def printed_by(page: str) -> tuple[dict[str, str], str]:
    """What the programs of a page print, up to the first that fails, and what that one complains of."""
    with tempfile.TemporaryDirectory() as folder:
        package = Path(folder) / "my_lab"
        package.mkdir()
        (package / "__init__.py").touch()
        for program in PAGES[page]:
            (package / f"{program.name}.py").write_text(program.source)
        result = Path(folder) / "printed.json"
        environment = os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{folder}", "PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, "-c", RUN, str(result), *(program.name for program in PAGES[page])]
        run = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
        return (json.loads(result.read_text()) if result.exists() else {}), run.stderr


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: f"{program.page}-{program.name}")
def test_a_program_runs_and_prints_what_the_page_says(program):
    printed, complaint = printed_by(program.page)
    assert program.name in printed, complaint
    assert printed[program.name] == (program.output or "")


def test_every_program_has_a_name_of_its_own():
    names = [program.name for program in PROGRAMS]
    assert not {name for name in names if names.count(name) > 1}


def test_every_page_stands_in_the_index():
    index = (DOCS / "README.md").read_text()
    assert not [page for page in PAGES if page != "README" and f"({page}.md" not in index]


@pytest.mark.parametrize("page", [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))], ids=lambda page: page.stem)
def test_links_lead_to_files_and_headings(page):
    for target, heading in LINK.findall(BLOCK.sub("", page.read_text())):
        aim = (page.parent / target).resolve() if target else page
        assert aim.exists(), f"{page.name}: there is no {target}"
        if heading:
            assert heading[1:] in _anchors(aim), f"{page.name}: {target} has no heading {heading}"


def _anchors(page: Path) -> set[str]:
    """Names of the headings as GitHub links to them."""
    headings = re.findall(r"^#+ (.*)$", BLOCK.sub("", page.read_text()), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}
