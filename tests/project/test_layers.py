"""Which way imports point: down one ordered list of rooms, through the faces of rooms, and never in a circle.

The imports of a face are those of its stub, ``__init__.pyi``, beside those of its ``__init__.py``.
"""

import ast
import importlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

from tests.places import ROOT, sources

# From the bottom to the top: a room imports only from rooms that stand before it. The commands of experiments are files.
ORDER = [
    "segar.errors",
    "segar.support",
    "segar.language",
    "segar.noise",
    "segar.rules",
    "segar.levels",
    "segar.engine",
    "segar.reference",
    "segar.tasks",
    "segar.textures",
    "segar.metrics",
    "segar.observations",
    "segar.rendering",
    "segar.envs",
    "segar.hardness",
    "segar.policies",
    "segar.evaluation",
    "segar.datasets",
    "segar.lab",
    "segar.suites",
    "segar.playground",
    "segar.cli",
    "segar",
    "segar.__main__",
    "segar.experiments.settings",
    "segar.experiments.commands",
    "segar.experiments.levels",
    "segar.experiments.runs",
    "segar.experiments.networks",
    "segar.experiments.collection",
    "segar.experiments.algorithms",
    "segar.experiments.curricula",
    "segar.experiments.tracking",
    "segar.experiments.evaluation",
    "segar.experiments.training",
    "segar.experiments.reproduction",
    "segar.experiments.benchmarking",
    "segar.experiments.train",
    "segar.experiments.evaluate",
    "segar.experiments.results",
    "segar.experiments.dashboard",
    "segar.experiments.upload",
    "segar.experiments.search",
    "segar.experiments.reproduce",
    "segar.experiments.sweep",
    "segar.experiments.study",
    "segar.experiments.benchmark",
    "segar.experiments",
    "segar.analysis.tables",
    "segar.analysis.stats",
    "segar.analysis.plotting",
    "segar.analysis.distances",
    "segar.analysis.level_sets",
    "segar.analysis.runs",
    "segar.analysis.gap_plot",
    "segar.analysis.causes",
    "segar.analysis.probes",
    "segar.analysis.studies",
    "segar.analysis.experiment_runs",
    "segar.analysis.collected_rows",
    "segar.analysis.collect",
    "segar.analysis.renderings",
    "segar.analysis.report",
    "segar.analysis.benchmark",
    "segar.analysis",
]

# What the order alone would allow: (who, whom).
STRANGERS = [
    ("segar.engine", "segar.rules"),  # the engine knows no built-in physics
    ("segar.engine", "segar.noise"),
    ("segar.reference", "segar.rules"),
    ("segar.metrics", "segar.engine"),  # measures and textures never see the engine
    ("segar.textures", "segar.engine"),
]
# Modules that need a large or optional package: their rooms' faces do not load them, so they are imported by themselves.
OPTIONAL = {
    "segar.engine.cuda.driver",
    "segar.envs.device_episodes",
    "segar.envs.sb3_env",
    "segar.envs.torchrl_env",
    "segar.lab.mcp_server",
    "segar.playground.server",
    "segar.rendering.marks",
    "segar.rendering.painter",
    "segar.rendering.window",
}
MOST_ROOMS = {"segar": 25, "segar.experiments": 25}
PACKAGES = ("segar", "experiments", "analysis")  # folders; the latter two are links in the first
LINKED = ("segar.experiments", "segar.analysis")


@dataclass(frozen=True)
class Import:
    """One name that a file imports, at its top or inside a function."""

    importer: str  # module
    target: str  # module
    name: str  # what is taken from it; empty where the module itself is imported
    place: str  # file and line


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    parts = parts if parts[0] == "segar" else ("segar", *parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for package in PACKAGES for path in sources(package)}


def room_of(module: str) -> str:
    parts = module.split(".")
    return next(room for k in (3, 2, 1) if (room := ".".join(parts[:k])) in ORDER)


def imports_of(module: str, source: str) -> Iterator[Import]:
    for node in ast.walk(ast.parse(source)):
        place = f"{module.replace('.', '/')}:{getattr(node, 'lineno', 0)}"
        if isinstance(node, ast.Import):
            yield from (Import(module, alias.name, "", place) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            source = f"{module}.{node.module or ''}".rstrip(".") if node.level else str(node.module)
            for alias in node.names:
                inner = f"{source}.{alias.name}"
                yield (
                    Import(module, inner, "", place) if inner in MODULES else Import(module, source, alias.name, place)
                )


@cache
def own_imports() -> list[Import]:
    return [
        found
        for module, path in MODULES.items()
        for file in (path, path.with_suffix(".pyi"))
        if file.exists()
        for found in imports_of(module, file.read_text())
        if found.target.split(".")[0] in PACKAGES
    ]


def objections(one: Import) -> Iterator[str]:
    """Why an import is not allowed."""
    here, there = room_of(one.importer), room_of(one.target)
    if here == there:
        return
    if ORDER.index(there) > ORDER.index(here):
        yield f"{one.place}: {one.importer} imports {one.target}, and {there} stands above {here}"
    if (here, there) in STRANGERS:
        yield f"{one.place}: {here} must not know {there}"
    if one.name.startswith("_") and one.name != "__version__":
        yield f"{one.place}: {one.name} is private to {there}"
    is_shown = one.target == there or (not one.name and one.target.rpartition(".")[0] == there)
    behind_face = there.startswith("segar.") and not there.startswith(("segar.errors", *LINKED)) and not is_shown
    if behind_face and one.target not in OPTIONAL and here != "segar":
        yield f"{one.place}: import from the face {there}, not from {one.target}"


def test_every_import_points_down_and_goes_through_a_face():
    wrong = [objection for one in own_imports() for objection in objections(one)]
    assert not wrong, "\n" + "\n".join(wrong)


@pytest.mark.parametrize(
    ("importer", "target"),
    [
        ("segar.engine.simulator", "segar.tasks"),
        ("segar.engine.compiler.kernel", "segar.rules"),
        ("segar.reference.interpreter", "segar.tasks"),
        ("segar.language.values", "segar.noise"),
        ("segar.levels.level_data", "segar.metrics"),
        ("segar.levels.level_data", "segar.playground"),
        ("segar.metrics.wasserstein", "segar.engine"),
        ("segar.textures.inputs", "segar.engine"),
        ("segar.rendering.camera", "segar.envs"),
        ("segar.envs.vector", "segar.levels.level_set"),
        ("segar.cli.play", "segar.experiments.runs"),
        ("segar.hardness.planner", "segar.evaluation"),
        ("segar.experiments.settings.run", "segar.experiments.runs"),
        ("segar.experiments.evaluation.episodes", "segar.experiments.training"),
        ("segar.experiments.training.run", "segar.analysis.tables"),
        ("segar.analysis.stats.mixed", "segar.analysis.report"),
    ],
)
def test_a_turned_arrow_is_found(importer, target):
    assert list(objections(Import(importer, target, "anything", "here:1")))


def test_files_import_each_other_in_no_circle():
    arrows: dict[str, set[str]] = {module: set() for module in MODULES}
    for one in own_imports():
        if one.target in MODULES:
            arrows[one.importer].add(one.target)
    while leaves := {module for module, targets in arrows.items() if not targets & arrows.keys() - {module}}:
        arrows = {module: targets for module, targets in arrows.items() if module not in leaves}
    assert not arrows, "\n" + "\n".join(
        f"{module}: {sorted(targets & arrows.keys())}" for module, targets in arrows.items()
    )


def test_experiments_name_no_module_of_analysis_in_a_string():
    wrong = [
        f"{module}:{node.lineno}: {node.value!r}"
        for module, path in MODULES.items()
        if not module.startswith("segar.analysis")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
        and re.fullmatch(r"(segar\.)?analysis(\.\w+)+(:\w+)?", node.value)
    ]  # fmt: skip
    assert not wrong, "\n" + "\n".join(wrong)


@pytest.mark.parametrize("package", MOST_ROOMS)
def test_there_are_few_rooms(package):
    rooms = {module.removeprefix(f"{package}.").split(".")[0] for module in MODULES if module.startswith(f"{package}.")}
    assert len(rooms) <= MOST_ROOMS[package], sorted(rooms)
    assert {f"{package}.{room}" for room in rooms} <= {*ORDER}, "every room has its place in the order"


@pytest.mark.parametrize("package", sorted(m for m, path in MODULES.items() if path.name == "__init__.py"))
def test_no_module_is_hidden_by_a_function_of_its_name(package):
    inside = [
        m for m in MODULES if m.rpartition(".")[0] == package and m not in OPTIONAL and not m.endswith("__main__")
    ]
    for module in inside:
        loaded = importlib.import_module(module)
        assert getattr(importlib.import_module(package), module.rpartition(".")[2]) is loaded, f"{module} is hidden"
