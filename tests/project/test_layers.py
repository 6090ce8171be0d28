"""Which way imports point: down one ordered list of rooms, through the faces of rooms, and never in a circle.

The imports of a face are those of its stub, ``__init__.pyi``, beside those of its ``__init__.py``.
"""

import ast
import importlib
import re
from collections.abc import Iterator

import pytest

from tests.places import sources
from tests.project.rooms import LINKED, MODULES, ORDER, PACKAGES, Import, all_imports, room_of

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
MOST_ROOMS = {"segar": 25, "segar.experiments": 25, "segar.analysis": 25}


def own_imports() -> list[Import]:
    return [one for one in all_imports() if one.target.split(".")[0] in PACKAGES]


def objections(one: Import) -> Iterator[str]:
    """Why an import is not allowed."""
    if not one.target.startswith("segar"):
        yield f"{one.place}: {one.target} is a folder; in the package it is segar.{one.target}"
        return
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
        ("segar.experiments.train", "experiments.runs"),
        ("segar.engine.compiler.kernel", "segar.rules"),
        ("segar.levels.level_data", "segar.playground"),
        ("segar.metrics.wasserstein", "segar.engine"),
        ("segar.envs.vector", "segar.levels.level_set"),
        ("segar.experiments.settings.run", "segar.experiments.runs"),
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


@pytest.mark.parametrize(("package", "above"), [("segar", "experiments|analysis"), ("experiments", "analysis")])
def test_a_package_names_no_module_above_it_in_a_string(package, above):
    wrong = [
        f"{path}:{node.lineno}: {node.value!r}"
        for path in sources(package)
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
        and re.fullmatch(rf"(segar\.)?({above})(\.\w+)+(:\w+)?", node.value)
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
