"""The power of the tests: one line of the sources is changed at a time, and the tests of its room should notice.

``python -m tests.mutants draw`` draws the changes with cosmic-ray's operators and a fixed seed, and writes ``drawn.csv``.
``python -m tests.mutants run`` makes each of them in turn, in place, and writes which test failed first to a table. A table
that is there is continued. ``--tree FOLDER`` does it in another checkout, where lines that are no longer there are ``gone``.
"""

import argparse
import ast
import csv
import os
import random
import re
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from tests.places import ROOT

DRAWN = Path(__file__).with_name("drawn.csv")
SEED, COUNT = 41, 150
TRIVIAL = (
    "Is",
    "IsNot",
    "RShift",
    "LShift",
    "BitAnd",
    "BitOr",
    "BitXor",
)  # with numbers these end in an error, anywhere
MARKERS = "not slow and not site"

# What is changed, and what should notice. Tests of a room are held against its sources, first those that name what changed.
TESTS = {
    "segar/engine": ("segar/engine", "segar/rules", "agreement"),
    "segar/levels": ("segar/levels", "segar/suites"),
    "segar/noise": ("segar/noise", "segar/levels"),
    "segar/metrics": ("segar/metrics",),
    "segar/envs": ("segar/envs", "segar/tasks"),
    "analysis/stats": ("analysis/stats", "analysis/report"),
    "analysis/report": ("analysis/report",),
}


@dataclass(frozen=True)
class Mutant:
    """One line of a function, and what it becomes.

    Attributes:
        function: its name with those of the classes and functions around it; empty at module level.
        nth: which of the equal lines of the function, from 0.
    """

    number: int
    room: str
    file: str
    function: str
    operator: str
    nth: int
    before: str
    after: str


def draw(tree: Path, count: int, seed: int) -> list[Mutant]:
    """``count`` changes in the checkout ``tree``, as many in each room and by each kind of operator; rooms take turns."""
    rng, rooms = random.Random(seed), list(TESTS)
    drawn: dict[str, list[Mutant]] = {}
    for n, room in enumerate(rooms):
        share = count // len(rooms) + (n < count % len(rooms))
        places: dict[str, list[tuple[Path, str, int]]] = {}
        for path in sorted((tree / room).rglob("*.py")):
            for operator, occurrence in _places(path):
                places.setdefault(operator.split("_")[0], []).append((path, operator, occurrence))
        found: dict[tuple[str, ...], Mutant] = {}
        while len(found) < share:
            path, operator, occurrence = rng.choice(places[rng.choice(sorted(places))])
            mutant = _mutant(tree, room, path, operator, occurrence)
            if mutant is not None:
                found.setdefault((mutant.file, mutant.before, mutant.after), mutant)
        drawn[room] = list(found.values())
    turns = [mutant for n in range(count) for room in rooms for mutant in drawn[room][n : n + 1]]
    return [Mutant(**asdict(mutant) | {"number": number}) for number, mutant in enumerate(turns)]


def _places(path: Path) -> Iterator[tuple[str, int]]:
    """Operators and their occurrences in a file; annotations, which nothing executes, are left out."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.plugins import get_operator, operator_names

    text = path.read_text()
    annotations = [
        ((node.lineno, node.col_offset), (node.end_lineno, node.end_col_offset))
        for holder in ast.walk(ast.parse(text))
        for node in (getattr(holder, "annotation", None), getattr(holder, "returns", None))
        if node is not None
    ]
    nodes = list(ast_nodes(get_ast(text)))
    for name in operator_names():
        operator = get_operator(name)
        if operator.arguments() or name == "core/NoOp" or name.endswith(tuple(f"_{other}" for other in TRIVIAL)):
            continue
        positions = [start for node in nodes for start, _ in operator().mutation_positions(node)]
        for occurrence, start in enumerate(positions):
            if not any(first <= start < last for first, last in annotations):
                yield name, occurrence


def _mutant(tree: Path, room: str, path: Path, operator: str, occurrence: int) -> Mutant | None:
    """The change as one line; None where it changes several, or where the file is no program afterwards."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    text = path.read_text()
    old, new = text.splitlines(), mutate_code(text, get_operator(operator)(), occurrence).splitlines()
    changed = [n for n, (a, b) in enumerate(zip(old, new, strict=False)) if a != b]
    try:
        compile("\n".join(new), str(path), "exec")
    except SyntaxError:
        return None
    if len(old) != len(new) or len(changed) != 1:
        return None
    (at,) = changed
    function, first, _ = min(
        ((name, first, last) for name, first, last in _functions(text) if first <= at < last),
        key=lambda found: found[2] - found[1],
    )
    nth = sum(line.strip() == old[at].strip() for line in old[first:at])
    file = path.relative_to(tree).as_posix()
    return Mutant(0, room, file, function, operator.removeprefix("core/"), nth, old[at].strip(), new[at].strip())


def _functions(text: str) -> list[tuple[str, int, int]]:
    """Name, first line and line after the last of every class and function, and of the module."""
    found = [("", 0, len(text.splitlines()))]

    def visit(node: ast.AST, name: str) -> None:
        for child in ast.iter_child_nodes(node):
            inner = name
            if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                inner = f"{name}.{child.name}".lstrip(".")
                first = min([child.lineno, *(one.lineno for one in child.decorator_list)])
                found.append((inner, first - 1, child.end_lineno or first))
            visit(child, inner)

    visit(ast.parse(text), "")
    return found


def place_in(tree: Path, mutant: Mutant) -> tuple[Path, int] | None:
    """The file and the line of a change in a checkout: in the file of then, else wherever the function has gone."""
    package = tree / mutant.file.split("/")[0]
    for path in dict.fromkeys([tree / mutant.file, *sorted(package.rglob("*.py"))]):
        if not path.is_file() or (not mutant.function and path != tree / mutant.file):
            continue
        text = path.read_text()
        lines = text.splitlines()
        for name, first, last in _functions(text):
            equal = [n for n in range(first, last) if lines[n].strip() == mutant.before]
            if name == mutant.function and equal:
                return path, equal[min(mutant.nth, len(equal) - 1)]
    return None


def run(tree: Path, mutants: Sequence[Mutant], out: Path, limit: float) -> None:
    """The outcome of each change, added to the table ``out`` as soon as it is known."""
    known = {int(row["number"]) for row in _rows(out)}
    failing: set[str] = set()  # tests that fail without any change, too
    for mutant in mutants:
        if mutant.number in known:
            continue
        place = place_in(tree, mutant)
        outcome, by = ("gone", "") if place is None else _outcome(tree, mutant, *place, failing, limit)
        new = not out.exists()
        with out.open("a", newline="") as stream:
            table = csv.DictWriter(stream, [*(field.name for field in fields(Mutant)), "outcome", "by"])
            if new:
                table.writeheader()
            table.writerow(asdict(mutant) | {"outcome": outcome, "by": by})
        print(f"{mutant.number}: {mutant.file}: {mutant.before} -> {mutant.after}: {outcome} {by}", flush=True)
    counts = Counter(row["outcome"] for row in _rows(out))
    found = counts["killed"] + counts["too long"]
    print(f"{found} of {found + counts['survived']} changes were noticed; {counts['gone']} lines are gone")


def _outcome(tree: Path, mutant: Mutant, path: Path, at: int, failing: set[str], limit: float) -> tuple[str, str]:
    """``killed`` and the test that fails with the change alone, ``too long``, or ``survived``."""
    while True:
        options = ["-x", *(f"--deselect={one}" for one in sorted(failing))]
        with _changed(path, at, mutant):
            status, printed = _test(tree, [*options, *_tests(tree, mutant)], limit)
        if status is None:
            return "too long", ""
        if status == 0:
            return "survived", ""
        by = next(iter(_failures(printed)), "")
        if not by:
            return "killed", f"exit status {status}"
        if _test(tree, [by], None)[0] == 0:
            return "killed", by
        failing.add(by)


@contextmanager
def _changed(path: Path, at: int, mutant: Mutant) -> Iterator[None]:
    """A file with the change, until the block ends."""
    content, times = path.read_text(), path.stat()
    lines = content.splitlines(keepends=True)
    lines[at] = lines[at].replace(mutant.before, mutant.after)
    try:
        path.write_text("".join(lines))
        yield
    finally:
        path.write_text(content)
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))  # what was compiled of it is good again


def _tests(tree: Path, mutant: Mutant) -> list[str]:
    """The test files of the room, first those with the names of the file and of the function."""
    stem, name = Path(mutant.file).stem, mutant.function.rpartition(".")[2]
    files = [path for room in TESTS[mutant.room] for path in sorted((tree / "tests" / room).rglob("test_*.py"))]

    def rank(path: Path) -> tuple[bool, bool, bool]:
        text = path.read_text()
        return stem not in path.stem, not name or name not in text, stem not in text

    return [path.relative_to(tree).as_posix() for path in sorted(files, key=rank)]


def _test(tree: Path, arguments: Sequence[str], limit: float | None) -> tuple[int | None, str]:
    """The exit status of pytest, None where it took longer than ``limit`` seconds, and what it printed."""
    python = tree / ".venv" / "bin" / "python"
    command = [str(python if python.exists() else sys.executable), "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    command += ["--hypothesis-seed=0", "-m", MARKERS, *arguments]
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, timeout=limit)
    except subprocess.TimeoutExpired:
        return None, ""
    return done.returncode, done.stdout


def _failures(printed: str) -> list[str]:
    return re.findall(r"^(?:FAILED|ERROR) (tests/\S+?\.py(?:::[^\[\n]*?(?:\[.*?\])?)?)(?: - |$)", printed, re.M)


def _rows(path: Path) -> list[dict[str, str]]:
    if not path.exists():
        return []
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("what", choices=["draw", "run"])
    parser.add_argument("--tree", type=Path, default=ROOT, help="the checkout; this one by default")
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "mutants.csv", help="the table of outcomes")
    parser.add_argument("--room", choices=TESTS, help="change this room alone; all by default")
    parser.add_argument("--limit", type=float, default=1800, help="seconds for the tests of one change")
    asked = parser.parse_args()
    if asked.what == "draw":
        with DRAWN.open("w", newline="") as stream:
            table = csv.DictWriter(stream, [field.name for field in fields(Mutant)])
            table.writeheader()
            table.writerows(asdict(mutant) for mutant in draw(asked.tree.resolve(), COUNT, SEED))
        return
    mutants = [Mutant(**row | {"number": int(row["number"]), "nth": int(row["nth"])}) for row in _rows(DRAWN)]
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # no change is left behind
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    chosen = [mutant for mutant in mutants if asked.room in (None, mutant.room)]
    run(asked.tree.resolve(), chosen, asked.out, asked.limit)


if __name__ == "__main__":
    main()
