"""The names that users may rely on, with their signatures: a change of `public_api.txt` is a change for users.

``python -m tests.project.test_public_api`` writes the file anew; CHANGELOG.md says what changed for users.
"""

import dataclasses
import inspect
import itertools
import re
from enum import Enum
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, get_origin

import pytest

import segar
from tests.places import ROOT, sources

SNAPSHOT = Path(__file__).with_name("public_api.txt")
ROOMS = (
    "segar", "segar.language", "segar.rules", "segar.noise", "segar.levels", "segar.tasks", "segar.textures", "segar.metrics",
    "segar.observations", "segar.rendering", "segar.envs", "segar.hardness", "segar.policies", "segar.evaluation",
    "segar.datasets", "segar.lab", "segar.suites", "segar.playground", "segar.engine", "segar.errors",
    "segar.experiments.settings", "segar.experiments.algorithms", "segar.experiments.curricula",
)  # fmt: skip
MOST_NAMES_AT_THE_ROOT, MOST_NAMES = 77, 200


def described(name: str, value: Any) -> str:
    """A name with its signature, as one line."""
    if isinstance(value, ModuleType):
        return f"{name} (module)"
    if get_origin(value) is not None:
        return f"{name} (type)"
    if isinstance(value, type) and issubclass(value, Exception | Enum):
        return f"{name} (class)"
    if isinstance(value, type) and dataclasses.is_dataclass(value):
        return f"{name}({', '.join(f.name for f in dataclasses.fields(value) if f.init)})"
    if callable(value):
        return f"{name}{without_types(value)}"
    return f"{name} ({type(value).__name__})"


def without_types(value: Any) -> str:
    try:
        signature = inspect.signature(value)
    except (TypeError, ValueError):
        return " (class)"
    parameters = [p.replace(annotation=p.empty) for p in signature.parameters.values()]
    text = str(signature.replace(parameters=parameters, return_annotation=signature.empty))
    if [*signature.parameters] == ["args", "kwargs"]:  # Python 3.13 says so of classes without a signature of their own
        return " (class)"
    return text if " at 0x" not in text else f"({', '.join(signature.parameters)})"


def promised(room: str) -> list[str]:
    module = import_module(room)
    names = getattr(module, "__all__", None) or [
        name for name, value in vars(module).items() if isinstance(value, type) and value.__module__ == room
    ]
    return sorted(names)


def module_name(folder: Path) -> str:
    return ".".join(folder.relative_to(ROOT).parts)


def snapshot() -> str:
    lines = []
    for room in ROOMS:
        lines += [room, *(f"  {described(name, getattr(import_module(room), name))}" for name in promised(room)), ""]
    return "\n".join(lines)


def test_names_and_signatures_are_those_that_were_promised():
    assert snapshot() == SNAPSHOT.read_text(), "write the file anew if the change is meant: see the top of this file"


STUBS = sources("segar", "__init__.pyi")
CODE = re.compile(r"^```\w+\n(.*?)^```|`([^`\n]+)`", re.M | re.S)  # blocks and words in running text


def public_names() -> set[str]:
    faces = [import_module(module_name(stub.parent)) for stub in STUBS]
    return {name for face in faces for name in getattr(face, "__all__", ())}


def test_few_names_are_public():
    assert len(segar.__all__) <= MOST_NAMES_AT_THE_ROOT and len({*segar.__all__}) == len(segar.__all__)
    assert len(public_names()) <= MOST_NAMES


def test_every_public_name_has_an_example_or_a_page_that_uses_it():
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "docs" / "how-to").glob("*.md")]
    pages += (ROOT / "docs" / "reference").glob("*.md")
    code = [part for page in pages for part in itertools.chain(*CODE.findall(page.read_text()))]
    code += [path.read_text() for path in (ROOT / "examples").glob("*.py")]
    code += [line for path in sources("segar") for line in re.findall(r">>> .*", path.read_text())]
    assert not public_names() - {*re.findall(r"\w+", "\n".join(code))}


@pytest.mark.parametrize("stub", STUBS, ids=lambda stub: stub.parent.name)
def test_every_name_of_a_face_can_be_loaded_and_is_shown_by_dir(stub):
    face = import_module(module_name(stub.parent))
    assert {*getattr(face, "__all__", ())} <= {*dir(face)}
    assert not [name for name in dir(face) if not hasattr(face, name)]


def test_a_name_that_never_was_is_refused():
    with pytest.raises(AttributeError, match="Masss"):
        segar.Masss  # noqa: B018


if __name__ == "__main__":
    SNAPSHOT.write_text(snapshot())
