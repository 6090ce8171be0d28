"""The names that users may rely on, with their signatures: a change of `public_api.txt` is a change for users.

``python -m tests.project.test_public_api`` writes the file anew; CHANGELOG.md says what changed for users.
"""

from __future__ import annotations

import dataclasses
import inspect
import subprocess
import sys
from enum import Enum
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, get_origin

import pytest

import segar
from tests.places import ROOT

SNAPSHOT = Path(__file__).with_name("public_api.txt")
ROOMS = (
    "segar", "segar.language", "segar.rules", "segar.noise", "segar.levels", "segar.tasks", "segar.textures", "segar.metrics",
    "segar.observations", "segar.rendering", "segar.envs", "segar.hardness", "segar.policies", "segar.evaluation",
    "segar.datasets", "segar.queries", "segar.playground", "segar.errors", "experiments.settings", "experiments.algorithms",
    "experiments.curricula",
)  # fmt: skip
MOST_NAMES = 77  # at the root


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
    if list(signature.parameters) == [
        "args",
        "kwargs",
    ]:  # Python 3.13 says so of classes without a signature of their own
        return " (class)"
    return text if " at 0x" not in text else f"({', '.join(signature.parameters)})"


def promised(room: str) -> list[str]:
    module = import_module(room)
    names = getattr(module, "__all__", None) or [
        name for name, value in vars(module).items() if isinstance(value, type) and value.__module__ == room
    ]
    return sorted(names)


def snapshot() -> str:
    lines = []
    for room in ROOMS:
        lines += [room, *(f"  {described(name, getattr(import_module(room), name))}" for name in promised(room)), ""]
    return "\n".join(lines)


def test_names_and_signatures_are_those_that_were_promised():
    assert snapshot() == SNAPSHOT.read_text(), "write the file anew if the change is meant: see the top of this file"


def test_the_root_advertises_few_names():
    assert len(segar.__all__) <= MOST_NAMES and len({*segar.__all__}) == len(segar.__all__)


@pytest.mark.parametrize(
    ("name", "room"), [("Heat", "segar.language"), ("billiards", "segar.tasks"), ("VonMises", "segar.noise")]
)
def test_a_name_that_0_1_had_at_the_root_says_its_room(name, room):
    with pytest.warns(DeprecationWarning, match=rf"segar\.{name} is now {room}\.{name}"):
        assert getattr(segar, name) is getattr(import_module(room), name)


def test_a_module_of_0_1_is_found_under_its_old_name():
    code = (
        "import warnings; warnings.simplefilter('error', DeprecationWarning)\n"
        "try:\n    from segar.factors import Mass\nexcept DeprecationWarning as warning:\n    print(warning)\n"
        "warnings.simplefilter('ignore')\n"
        "from segar.factors import Mass\nfrom segar.distribution import LevelDistribution\n"
        "from segar.tasks.puttputt import puttputt\n"
        "import segar\nassert Mass is segar.Mass and LevelDistribution is segar.LevelDistribution\n"
        "assert puttputt is segar.puttputt and callable(segar.rule)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "segar.factors is now segar.language.factors" in done.stdout


def test_a_name_that_never_was_is_refused():
    with pytest.raises(AttributeError, match="module 'segar' has no attribute 'Masss'"):
        segar.Masss  # noqa: B018


if __name__ == "__main__":
    SNAPSHOT.write_text(snapshot())
