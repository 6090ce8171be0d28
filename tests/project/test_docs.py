"""The programs in docs/ run as they are printed, as files of a package outside segar, and print what the pages say.

A ``python`` block is a file of the package ``my_lab``. A ``bash`` block is run in the folder of that package, between the
programs around it. Other blocks (``sh``, ``yaml``, ``text``) are not run.
"""

import importlib
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

pytestmark = pytest.mark.docs

DOCS = ROOT / "docs"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.M | re.S)
FILE = re.compile(r"# my_lab/(\w+)\.py\n")
LINK = re.compile(r"\]\((?!https?:)([^)#\s]*)(#[^)\s]+)?\)")
NAMES = re.compile(r"^\| `([\w.]+)` \| [^|]* \| (`[^|]*`) \|$", re.M)  # a row of docs/reference/api.md
TRAINING = ("segar train", "segar study wind.yaml root")  # a bash block with one of them takes minutes

# One process runs all blocks of a page in order; a program is imported once, whichever program imports it first.
RUN = """
import contextlib, importlib, io, json, subprocess, sys
printed = {}
for name in sys.argv[2:]:
    out = io.StringIO()
    if name.endswith(".sh"):
        subprocess.run(["bash", "-eu", name], check=True, stdout=subprocess.DEVNULL)
    else:
        with contextlib.redirect_stdout(out):
            importlib.import_module("my_lab." + name)
    printed[name] = out.getvalue()
    with open(sys.argv[1], "w") as file:
        json.dump(printed, file)
"""


@dataclass(frozen=True)
class Program:
    """A python or bash block of a page.

    Attributes:
        name: of the file that its first line states; of a bash block, a number and ``.sh``.
        output: the text block that follows.
        slow: whether a training comes before it, or it trains itself.
    """

    name: str
    source: str
    output: str | None
    slow: bool


def programs_of(page: Path) -> list[Program]:
    blocks = BLOCK.findall(page.read_text())
    found: list[Program] = []
    for n, (language, body) in enumerate(blocks):
        if language not in ("python", "bash"):
            continue
        file = FILE.match(body)
        wanted = f"{page.name}: the first line of a program must be '# my_lab/<name>.py', not {body[:60]!r}"
        assert file or language == "bash", wanted
        following = blocks[n + 1] if n + 1 < len(blocks) else ("", "")
        trains = language == "bash" and any(command in body for command in TRAINING)
        slow = trains or any(program.slow for program in found)
        name = file[1] if file else f"{n}.sh"
        output = following[1] if following[0] == "text" else None
        found.append(Program(name, body, output, slow))
    return found


def name_of(page: Path) -> str:
    """The path of a page below docs/, without its ending."""
    return page.relative_to(DOCS).with_suffix("").as_posix()


PAGES = {name_of(page): programs_of(page) for page in sorted(DOCS.rglob("*.md"))}
TEXTS = [*(ROOT / f"{name}.md" for name in ("README", "CONTRIBUTING", "CHANGELOG")), *sorted(DOCS.rglob("*.md"))]
PROGRAMS = [program for programs in PAGES.values() for program in programs]


def printed_by(chosen: list[Program]) -> tuple[dict[str, str], str]:
    """What the chosen programs print, up to the first that fails, and the error output."""
    with tempfile.TemporaryDirectory() as folder:
        package = Path(folder) / "my_lab"
        package.mkdir()
        (package / "__init__.py").touch()
        for program in chosen:
            is_shell = program.name.endswith(".sh")
            (Path(folder) / program.name if is_shell else package / f"{program.name}.py").write_text(program.source)
        result = Path(folder) / "printed.json"
        environment = os.environ | {
            "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
            "PYTHONPATH": f"{ROOT}{os.pathsep}{folder}",
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        command = [sys.executable, "-c", RUN, str(result), *(program.name for program in chosen)]
        run = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
        return (json.loads(result.read_text()) if result.exists() else {}), run.stderr


# A page that trains runs twice: up to its first training, and as a whole in `make test-slow`.
@pytest.mark.parametrize(
    ("page", "with_slow"),
    [
        pytest.param(page, with_slow, id=page + " slow" * with_slow, marks=[pytest.mark.slow] * with_slow)
        for page, programs in PAGES.items()
        for with_slow in (False, True)
        if any(program.slow == with_slow for program in programs)
    ],
)
def test_the_programs_of_a_page_run_and_print_what_it_says(page, with_slow):
    chosen = [program for program in PAGES[page] if with_slow or not program.slow]
    printed, error_output = printed_by(chosen)
    assert printed == {program.name: program.output or "" for program in chosen}, error_output


def test_no_program_that_runs_names_a_place_that_the_reader_has_to_fill_in():
    assert [program for program in PROGRAMS if re.search(r"\b(FOLDER|FILE|NAME|ROW)\b", program.source)] == []


def test_every_program_has_a_name_of_its_own():
    names = [program.name for program in PROGRAMS if not program.name.endswith(".sh")]
    assert not {name for name in names if names.count(name) > 1}


def test_every_page_stands_in_the_index():
    index = (DOCS / "README.md").read_text()
    assert not [page for page in PAGES if page != "README" and f"({page}.md" not in index]


@pytest.mark.parametrize("page", TEXTS, ids=lambda page: page.stem)
def test_links_lead_to_files_and_headings(page):
    for target, heading in LINK.findall(BLOCK.sub("", page.read_text())):
        aim = (page.parent / target).resolve() if target else page
        assert aim.exists(), f"{page.name}: there is no {target}"
        if heading:
            assert heading[1:] in _anchors(aim), f"{page.name}: {target} has no heading {heading}"


def test_every_decision_has_a_number_of_its_own():
    numbers = [page.name[:4] for page in sorted((DOCS / "decisions").glob("*.md"))]
    assert numbers == [f"{n:04}" for n in range(1, len(numbers) + 1)]


@pytest.mark.parametrize(("room", "names"), NAMES.findall((DOCS / "reference" / "api.md").read_text()))
def test_a_room_has_the_names_that_the_reference_lists(room, names):
    face = importlib.import_module(room)
    assert not [name for name in re.findall(r"`(\w+)`", names) if not hasattr(face, name)]


def _anchors(page: Path) -> set[str]:
    """Names of the headings as GitHub links to them."""
    headings = re.findall(r"^#+ (.*)$", BLOCK.sub("", page.read_text()), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}
