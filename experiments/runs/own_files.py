"""The user's own files that a run is made by: the sources that its modules reach, and the data files that these name.

Nothing is imported or recorded. A file counts where the text of a source says so, and therefore for every process alike:

- by an import, at the top of a module or within a function;
- by its name, ``HERE / "width.json"``, or a part of it, ``f"{kind}.json"``: looked for in all folders of its package, in
  those above the module up to the one that it is imported from, in the working one, and in folders there that a source names.
  Beside the folder that it is imported from, as ``data`` beside ``src``, what its texts name in full;
- because a source of its package, or of its folder where there is no package, loads modules by names that are computed, as
  :func:`importlib.import_module` does, or lists folders. Then all sources of the package count, or all its files.

Hidden files, and those in hidden folders, do not count.
"""

import ast
import fnmatch
import hashlib
import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from types import ModuleType
from weakref import WeakKeyDictionary

from segar.experiments.runs.own_modules import OURS, find_file, imported_by, is_library, source_reached
from segar.experiments.runs.run_folder import CONFIG, JOURNAL
from segar.experiments.runs.source_text import nodes_of, normalised
from segar.experiments.settings import ConfigError, imported_from

LOADING = {
    "import_module", "__import__", "exec", "exec_module", "run_module", "run_path", "spec_from_file_location",
    "iter_modules", "walk_packages", "resolve_name", "locate", "SourceFileLoader",
}  # fmt: skip
LISTING = {"fwalk", "glob", "iglob", "iterdir", "listdir", "rglob", "scandir", "walk"}
BLANK = re.compile(r"\{[^{}]*\}|%[-+ #0-9.]*[a-z]")  # what str.format and % fill in
FILE_NAME = re.compile(r"(?!.*\*\*)[^\n\0]{0,200}\.\w+")
NO_DATA = (".pyc", ".so", ".nbi", ".nbc", ".lock")  # compiled code, kernels, locks
BESIDE_RUNS = {"mlflow.db", "mlflow-artifacts"}  # results, too
SYSTEM = tuple(map(Path, ("/dev", "/etc", "/proc", "/run", "/sys", "/usr", "/var")))

_as_seen: WeakKeyDictionary[ModuleType, dict[Path, str]] = WeakKeyDictionary()  # what the modules' files held at first


def own_files(module: str, texts: Collection[str] = ()) -> dict[str, str]:
    """The own files that ``module`` is made by, to the fingerprints of what is in them.

    A file below the folder from which its module is imported, or the working one, has its path from there as its name
    (``my_lab/levels.py``, ``./levels.py``), another one its absolute path.

    Args:
        texts: further texts that may name files, such as the options of a task.

    Raises:
        ConfigError: a file has changed since this process imported the module that it makes, or found it named by one that it
            had imported. The functions of these modules are those of the file before.
    """
    reached = _files_of(module, texts)
    found = {name: file_digest(path) for name, (path, _) in sorted(reached.items())}
    naming = {source: imported_from(source) for source in {source for _, source in reached.values()}}
    # What the files that a source names held when they were first found; nothing is kept where it is not imported.
    seen_by = {source: _as_seen.setdefault(one[0], {}) if one else {} for source, one in naming.items()}
    changed = [
        name for name, now in found.items() if _at_first(reached[name][0], seen_by[reached[name][1]], now) != now
    ]
    seen = [path for of_one in seen_by.values() for path in of_one]
    if changed := [*changed, *(str(path) for path in seen if not path.exists())]:
        raise ConfigError(
            f"{changed[0]} has changed since this process imported {module}, so a run would not be one of the code that lies"
            " there now. Give the command again, so that a new process imports it"
        )
    return found


def file_digest(path: Path) -> str:
    """Sixteen hexadecimal digits of a file's content, of a source file's as far as it counts; raises :class:`OSError` if it
    cannot be read."""
    about = path.stat()
    return _digest(path, about.st_ctime_ns, about.st_size)


def digest_executed(name: str) -> str:
    """The fingerprint of the file of this name as this process executes it: of what was imported from it, else of what is in it
    now; empty where there is none."""
    path = find_file(name)
    return "" if path is None else _at_first(path.resolve(), {}, file_digest(path))


def _at_first(path: Path, seen: dict[Path, str], now: str) -> str:
    """The fingerprint of a file at its import, or else in ``seen``, to which it is added where it is not there."""
    imported = imported_from(path)
    return seen.setdefault(path, now) if imported is None else _of_source(imported[1])


def _files_of(module: str, texts: Collection[str]) -> dict[str, tuple[Path, Path]]:
    """Name of each file to the file, and to the source that names it, which is itself for a module."""
    found: dict[str, tuple[Path, Path]] = {}
    done: set[str] = set()
    sources: dict[Path, Path] = {}  # to the folders that they are imported from
    waiting = [module]
    while waiting := [name for name in waiting if name not in done]:
        name = waiting.pop()
        source = None if name.partition(".")[0] == OURS else source_reached(name, module.partition(".")[0])
        done.add(name)
        if source is not None:
            path = source.resolve()
            sources[path] = root = path.parents[name.count(".") + (path.name == "__init__.py")]
            found[_name(path, root)] = path, path
            waiting += imported_by(name, path)
            if path.name == "__init__.py":  # __all__ names modules, too, and what imports them when they are asked for
                waiting += [f"{name}.{text}" for text in _texts(nodes_of(path)) if text.isidentifier()]
            waiting += [name[: dot.start()] for dot in re.finditer(r"\.", name)]  # Python executes these packages, too
        for file, source in _named_by(sources, texts) if done.issuperset(waiting) else ():
            root = sources[source]
            if file.suffix == ".py" and file.is_relative_to(root):
                waiting.append(".".join(file.relative_to(root).with_suffix("").parts).removesuffix(".__init__"))
            found.setdefault(_name(file, root), (file, source))
    return found


def _named_by(sources: Mapping[Path, Path], texts: Iterable[str]) -> Iterator[tuple[Path, Path]]:
    """The own files that the texts of the sources name, as this module says, each with a source that names it."""
    nodes = {source: nodes_of(source) for source in sources}
    said = {source: {*texts, *_texts(of_one)} for source, of_one in nodes.items()}
    parts = {source: {part for text in of_one for part in text.split("/")} for source, of_one in said.items()}
    like = {source: _pattern_of(of_one) for source, of_one in parts.items()}
    packages = {root / source.relative_to(root).parts[0] for source, root in sources.items() if source.parent != root}

    def naming(part: str) -> Path | None:
        return next((source for source in sources if part in parts[source] or like[source].match(part)), None)

    found: list[tuple[Path, Path]] = []
    seen: set[str] = set()
    for source, root in sources.items():
        above = [folder for folder in source.parents if folder.is_relative_to(root)]
        folders = [*above, Path.cwd(), *(Path(text) for text in said[source] if text[:1] == "/" != text)]
        beyond = [root.parent / part for part in sorted(parts[source] - {"", ".", ".."})]
        for folder in [*folders, *beyond]:
            found += _below(folder, naming, packages, seen)
        of_slash = [text for text in said[source] if "/" in text and FILE_NAME.fullmatch(text)]
        places = (file for folder in [*folders, root.parent] for text in of_slash for file in _at(folder, text))
        found += [(file, source) for file in [*beyond, *places]]
        calls = {getattr(node, "attr", getattr(node, "id", "")) for node in nodes[source]}
        calls |= {node.name for node in nodes[source] if isinstance(node, ast.alias)}  # "import listdir as names"
        top, deep, kind = above[-2:][0], "**/" if above[1:] else "", "*" if calls & LISTING else "*.py"
        if calls & (LOADING | LISTING) and f"{top} {kind}" not in seen:
            seen.add(f"{top} {kind}")
            results = {file.parent for file in top.glob(deep + JOURNAL) if (file.parent / CONFIG).exists()}
            found += [(file, source) for file in top.glob(deep + kind) if results.isdisjoint(file.parents)]
    for file, source in found:
        if os.path.isfile(file) and not file.name.endswith(NO_DATA) and BESIDE_RUNS.isdisjoint(file.parts):
            path = Path(os.path.realpath(file))
            yield from [(path, source)] if _is_own(path, sources[source]) else []


def _pattern_of(parts: Iterable[str]) -> re.Pattern[str]:
    """What the names of files look like of which the texts of a source leave blanks."""
    names = [f"*{part}" if part.startswith(".") else part for part in parts if FILE_NAME.fullmatch(part)]
    return re.compile("|".join(fnmatch.translate(name) for name in names if "*" in name) or "(?!)")


def _below(
    folder: Path, naming: Callable[[str], Path | None], packages: Collection[Path], seen: set[str]
) -> Iterator[tuple[Path, Path]]:
    """Files below a folder that a source names, with the source: in folders that are named, too, or in a package."""
    for place, inner, files in os.walk(folder, followlinks=True) if os.path.isdir(folder) else ():
        is_inside = any(Path(place).is_relative_to(one) for one in packages)
        if (real := os.path.realpath(place)) in seen or {CONFIG, JOURNAL}.issubset(files):
            inner.clear()
            continue
        seen.add(real)
        inner[:] = [one for one in inner if one[0] != "." and (is_inside or naming(one))]
        yield from ((Path(place, one), source) for one in files if (source := naming(one)))


def _at(folder: Path, text: str) -> Iterable[Path]:
    """The files that a text with a slash means, seen from a folder."""
    return folder.glob(text.lstrip("/")) if "*" in text else [folder / os.path.expanduser(text)]


def _texts(nodes: Iterable[ast.AST]) -> Iterator[str]:
    """The texts of a source, with ``*`` for what is filled in."""
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str | bytes):
            yield BLANK.sub("*", os.fsdecode(node.value))
        elif isinstance(node, ast.JoinedStr):
            yield "".join(str(part.value) if isinstance(part, ast.Constant) else "*" for part in node.values)


def _is_own(path: Path, root: Path) -> bool:
    """Whether a file is the user's: none of ours, of an installed package, or of the system's."""
    name = Path(_name(path, root))
    is_hidden = any(part.startswith(".") for part in name.parts)
    return not is_hidden and not is_library(path) and not any(name.is_relative_to(one) for one in SYSTEM)


def _name(path: Path, root: Path) -> str:
    for folder in (root, Path.cwd()):
        if path.is_relative_to(folder):
            name = path.relative_to(folder).as_posix()
            return name if "/" in name else f"./{name}"
    return str(path)


@cache
def _digest(path: Path, _time: int, _size: int) -> str:
    if path.suffix == ".py":
        return _of_source(path.read_bytes())
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()[:16]


def _of_source(content: bytes) -> str:
    return hashlib.sha256(normalised(content)).hexdigest()[:16]
