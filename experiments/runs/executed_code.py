"""The code that a run executes, as one fingerprint for each part: what a checkpoint may be resumed under.

A part is the kernel, the learner, the curriculum, the environment, the sampler of levels, or a module of the user's own. The
fingerprint of a kernel is that of its text, so it changes with the rules and with nothing else. The fingerprint of Python code
does not change with comments, docstrings, layout, or the texts of error messages. The command line, the pictures for people,
the tracking and the report are no part of it: a run does not execute them.

Beside the parts stand the user's own files, whose names have a slash: the source files that the modules reach
(``my_lab/helpers.py``) or have loaded so far by whatever means, and the data files that these have read so far
(``my_lab/scale.json``). What a run has recorded of files is compared with what is in them now. So it does not matter which of
them the process that compares has read.
"""

import ast
import hashlib
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cache
from importlib.util import resolve_name
from pathlib import Path
from typing import Any

import segar
from experiments.levels.builders import LevelFile, distribution_of, environment_options, observation_seen, task_name
from experiments.runs.own_modules import find_file, modules_named, source_of
from experiments.runs.run_folder import VERSIONS, read_versions
from experiments.runs.versions import levels_hash
from experiments.settings import RunConfig, UniformConfig, as_data
from experiments.settings.files_read import (
    OURS,
    data_read,
    data_to_read,
    file_digest,
    is_installed,
    is_source,
    source_name,
)
from experiments.settings.source_text import normalised
from segar.engine import generate
from segar.envs import world_of
from segar.levels import Levels

# Where the learner's own code ends: what these rooms do decides no weight.
LEARNING = ("experiments.algorithms", "experiments.collection", "experiments.curricula", "experiments.networks")
CHOICE = "experiments.curricula.training_levels"  # what lets a curriculum choose
# Rooms of the library that are executed beside the kernel. The rules, the task and the engine are in the kernel's text.
ENVIRONMENT = ("envs", "observations", "support")
SAMPLER = ("levels", "noise", "language")
# All others are modules of the user's own.
PARTS = ("kernel", "levels", "learner", "curriculum", "environment", "sampler", "textures")
PROBED = 8  # levels of each distribution that are looked at


def executed_code(config: RunConfig) -> dict[str, str]:
    """Name of each part, and of each file of the user's own, to sixteen hexadecimal digits, for the run with these settings.

    The parts are ``kernel``, ``levels`` (some that the distributions give), ``learner``, ``curriculum`` where levels are
    endless or chosen, ``environment``, ``sampler``, ``textures`` where the observation has them, and the name of every module
    of the user's own that a setting or the levels' task names (``my_lab.levels``), with what it reaches
    (:func:`modules_reached`).
    """
    learner = config.algorithm.learner.partition(":")[0]
    choosers = {one.partition(":")[0] for one in _choosers(config)}
    named = {*modules_named([as_data(config), task_name(config)])} - {learner, *choosers}
    parts = {**_played(config), "learner": fingerprint(learner)}
    if choosers:
        parts["curriculum"] = _digest(fingerprint(module).encode() for module in sorted({CHOICE, *choosers}))
    return _with_files(parts, named, {learner, *choosers})


def _choosers(config: RunConfig) -> list[str]:
    """What chooses levels, as ``module:Class``; nothing where environments draw from a fixed set."""
    if config.curriculum is not None:
        return [config.curriculum.chooser]
    return [UniformConfig.chooser] if config.levels.is_endless else []


def played_code(config: RunConfig) -> dict[str, str]:
    """The part of :func:`executed_code` that an agent meets: its levels, its task and its observation, without the learner."""
    named = {*modules_named([as_data(part) for part in (config.levels, config.task, config.observation)])}
    return _with_files(_played(config), named | {*modules_named(task_name(config))})


def code_of(settings: Any) -> dict[str, str]:
    """The part of :func:`executed_code` that the modules named in settings (plain data) are."""
    return _with_files({}, modules_named(settings))


def with_data(code: Mapping[str, str]) -> dict[str, str]:
    """``code`` with the files that its own modules have read and loaded by now; what it says of a file already stays."""
    found = (find_file(name) for name in _sources(code))
    return {**data_read([path for path in found if path is not None]), **code}


def without_modules(code: Mapping[str, str]) -> dict[str, str]:
    """``code`` without the parts for modules, whose content the source files have, too."""
    packages = {re.split(r"[/.]", name.removeprefix("./"))[0] for name in _sources(code)}
    return {name: one for name, one in code.items() if "/" in name or name.partition(".")[0] not in packages}


def files_of_code(code: Mapping[str, str] | str) -> dict[str, str]:
    """The user's files in ``code``; none in that of 0.1."""
    return {} if isinstance(code, str) else {name: content for name, content in code.items() if "/" in name}


def probed_levels(config: RunConfig, split: str) -> Levels:
    """The first levels of the training or the test distribution."""
    found = distribution_of(config.levels, split)
    count = min(PROBED, len(found)) if isinstance(found, LevelFile) else PROBED
    return found.sample(count, seed=0, split=split)


def combined(parts: Mapping[str, str] | str) -> str:
    """Sixteen hexadecimal digits for all parts together; those that 0.1 recorded as they are."""
    if isinstance(parts, str):
        return parts
    return _digest(f"{name}={value}".encode() for name, value in sorted(without_modules(parts).items()))


def changed_parts(folder: Path, code: Mapping[str, str] | None) -> list[str]:
    """Names of the parts of ``code``, today's, that were others when the run in ``folder`` began; none where none began."""
    if code is None or not (folder / VERSIONS).exists():
        return []
    return differing_parts(read_versions(folder).get("code", ""), code)


def differing_parts(before: Mapping[str, str] | str, now: Mapping[str, str]) -> list[str]:
    """Names of the parts that differ, and of the files recorded ``before`` in which something else is now; of code that 0.1
    recorded, which knew no parts, ``all``.

    Where source files say what changed, the modules that reach them are left out.
    """
    if isinstance(before, str):
        return ["all"]
    files = sorted(name for name in before if "/" in name and before[name] != _content_now(name))
    parts = sorted(name for name in {*before, *now} if "/" not in name and before.get(name) != now.get(name))
    if _sources(files):
        parts = [name for name in parts if name in PARTS]
    return [*parts, *files]


def fingerprint(module: str) -> str:
    """Sixteen hexadecimal digits over ``module`` and all modules that it reaches."""
    return _digest(normalised(path) for _, path in sorted(modules_reached(module).items()))


def modules_reached(module: str) -> dict[str, Path]:
    """Name and file of ``module`` and of what it imports of its own package, of ``experiments``, and of code that is not
    installed, such as modules that lie beside it; nothing is imported here.

    Of ``experiments``, only what learns counts; of ``segar``, nothing: it has parts of its own.
    """
    found: dict[str, Path] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        path = source_of(name) if name not in found and _may_count(name) else None
        if path is None or (
            name.partition(".")[0] not in (module.partition(".")[0], "experiments") and is_installed(path)
        ):
            continue
        found[name] = path
        waiting += _imports(name, path)
    return found


def _may_count(module: str) -> bool:
    package = module.partition(".")[0]
    if package == "experiments":
        return module.startswith(LEARNING)
    return package != "segar" and package not in sys.stdlib_module_names


def _imports(module: str, path: Path) -> Iterator[str]:
    """Absolute names of what a module imports, at its top or within; of ``from a import b`` both ``a`` and ``a.b``."""
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = ".".join(package.split(".")[: len(package.split(".")) + 1 - node.level]) if node.level else ""
            source = ".".join(part for part in (above, node.module) if part)
            yield from (source, *(f"{source}.{alias.name}" for alias in node.names))
        elif isinstance(node, ast.Call) and (called := _name_imported(node)):
            with suppress(ImportError):  # from beyond the top of the package, which the call says to its caller
                yield resolve_name(called, package)


def _name_imported(call: ast.Call) -> str:
    """The module that ``importlib.import_module("name")`` or ``__import__("name")`` imports; empty for any other call."""
    name = getattr(call.func, "attr", getattr(call.func, "id", ""))
    first = call.args[0] if call.args else None
    if name not in ("import_module", "__import__") or not isinstance(first, ast.Constant):
        return ""
    return first.value if isinstance(first.value, str) else ""


def _played(config: RunConfig) -> dict[str, str]:
    """The parts for levels, task and observation."""
    task = environment_options(config)["task"]
    train, test = (probed_levels(config, split) for split in ("train", "test"))
    parts = {
        "kernel": _digest([generate(train.layout, world_of(train), task.functions()).text.encode()]),
        "levels": _digest([levels_hash(train).encode(), levels_hash(test).encode()]),
    }
    parts["environment"], parts["sampler"] = _library(ENVIRONMENT), _library(SAMPLER)
    if "textures" in observation_seen(config).name:
        parts["textures"] = _library(("textures",))
    return parts


def _with_files(parts: Mapping[str, str], named: Iterable[str], others: Iterable[str] = ()) -> dict[str, str]:
    """``parts`` with one for each module in ``named`` that has a file, the source files that these and ``others`` reach, and
    the files that they read and loaded."""
    modules = sorted(name for name in named if source_of(name) is not None)
    reached = {name: path for module in (*modules, *others) for name, path in modules_reached(module).items()}
    own = {name: path for name, path in reached.items() if name.partition(".")[0] not in OURS}
    packages = {name[: dot.start()] for name in own for dot in re.finditer(r"\.", name)}  # Python executes these, too
    own |= {name: path for name in packages if (path := source_of(name)) is not None}
    sources = {source_name(name, path): file_digest(path) for name, path in own.items()}
    return {**parts, **{module: fingerprint(module) for module in modules}, **sources, **data_to_read(own.values())}


def _sources(names: Iterable[str]) -> set[str]:
    """Those of the names that are of source files."""
    return {name for name in names if "/" in name and is_source(name)}


def _content_now(name: str) -> str:
    """The fingerprint of what is in a file now; empty where there is none."""
    path = find_file(name)
    return "" if path is None else file_digest(path)


@cache
def _library(rooms: tuple[str, ...]) -> str:
    """The fingerprint of rooms of ``segar``, with the data that they ship."""
    folder = Path(segar.__file__).resolve().parent
    files = [path for room in rooms for path in sorted((folder / room).rglob("*")) if path.suffix in (".py", ".npz")]
    return _digest(normalised(path) if path.suffix == ".py" else path.read_bytes() for path in files)


def _digest(contents: Iterable[bytes]) -> str:
    digest = hashlib.sha256()
    for content in contents:
        digest.update(hashlib.sha256(content).digest())
    return digest.hexdigest()[:16]
