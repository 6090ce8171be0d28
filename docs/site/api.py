"""The site's API reference: a page for each room, with a table by autosummary and the entries of autodoc.

Rooms and names are those of the snapshot of the public API. A module among the names of a room, such as
``segar.language.factors``, has a page of its own.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from segar.language import Factor, Parameter, Relation, Rule

PUBLIC = Path(__file__).parents[2] / "tests" / "project" / "public_api.txt"
LONGEST_VALUE = 90  # characters of a constant that is shown


def api_pages() -> Iterator[tuple[str, str]]:
    """A page for each room and for each module that a room lists, and their index."""
    modules = dict.fromkeys(module for room in public_names() for module in modules_of(room))
    for room in public_names():
        yield f"api/{room}.rst", room_page(room)
    for module in modules:
        yield f"api/{module}.rst", module_page(module)
    tree = "\n".join(f"   {name}" for name in [*public_names(), *modules])
    yield "api/index.rst", page("API", f"{HOW_TO_IMPORT}\n\n.. toctree::\n   :maxdepth: 1\n\n{tree}")


HOW_TO_IMPORT = """\
Every public name, room by room. ``segar`` itself has the names that most programs need; all others are imported from the
face of their room, as in ``from segar.noise import LogUniform``."""


@cache
def public_names() -> dict[str, list[str]]:
    """Room to the names that users may rely on."""
    found: dict[str, list[str]] = {}
    for line in filter(None, PUBLIC.read_text(encoding="utf-8").splitlines()):
        if line.startswith("  "):
            found[[*found][-1]].append(re.split(r"\W", line.strip(), maxsplit=1)[0])
        else:
            found[line] = []
    return found


def modules_of(room: str) -> list[str]:
    """Modules among the names of a room that are no rooms themselves; the root lists rooms alone."""
    values = [getattr(import_module(room), name) for name in public_names()[room]]
    return [
        value.__name__ for value in values if isinstance(value, ModuleType) and value.__name__ not in public_names()
    ]


@cache
def home_of(room: str, name: str) -> str:
    """Where the entry of a name stands: in the module of a page of its own, or in the room below the root that has it."""
    value = getattr(import_module(room), name)
    for other in [*public_names(), "segar"][1:]:
        if getattr(import_module(other), name, None) is value and (name in public_names()[other]):
            return module if (module := defined_in(value)) in modules_of(other) else other
    return room


def room_page(room: str) -> str:
    """The table of a room's names, and the entries of those that have no other home."""
    face, lines, table, entries = import_module(room), [], [], []
    for name in public_names()[room]:
        value, home = getattr(face, name), home_of(room, name)
        if isinstance(value, ModuleType):
            lines.append(f"- :doc:`{name} <{value.__name__}>`")
        elif is_constant(value):
            lines.append(f"- :py:obj:`{name} <{home}.{name}>`")
        else:
            table.append(f"   ~{home}.{name}")
        if home == room and not isinstance(value, ModuleType):
            entries.append(entry(room, name))
    about = inline_rst(inspect.cleandoc(face.__doc__ or "").split("\n\n")[0])
    parts = [about, ".. autosummary::\n   :nosignatures:\n\n" + "\n".join(table) if table else "", "\n".join(lines)]
    return page(room, "\n\n".join([*parts, f".. py:module:: {room}", *entries]))


def module_page(module: str) -> str:
    """What a module says of itself, and the entries of the public names that it defines."""
    entries = [
        entry(module, name)
        for name, value in vars(import_module(module)).items()
        if not name.startswith("_") and not is_constant(value) and defined_in(value) == module
    ]
    return page(module, "\n\n".join([f".. automodule:: {module}", *entries]))


def defined_in(value: Any) -> str:
    """The module of a class or a function; that of its function for a rule or a relation."""
    return str(getattr(value.function if isinstance(value, Rule | Relation) else value, "__module__", ""))


def is_constant(value: Any) -> bool:
    is_class = isinstance(value, type) and not hasattr(value, "__origin__")
    return not (
        is_class or inspect.isroutine(value) or hasattr(value, "__wrapped__") or isinstance(value, Rule | Relation)
    )


def page(title: str, text: str) -> str:
    return f"{title}\n{'=' * len(title)}\n\n{text}\n"


def entry(room: str, name: str) -> str:
    """The directive that documents one name."""
    full, value = f"{room}.{name}", getattr(import_module(room), name)
    if isinstance(value, type) and not hasattr(value, "__origin__"):
        return f".. autoclass:: {full}\n   :members:\n   :show-inheritance:"
    if not is_constant(value):
        return f".. autofunction:: {full}"
    shown = repr(value)
    return f".. py:data:: {full}" + (f"\n   :value: {shown}" if len(shown) <= LONGEST_VALUE else "")


def facts_of(value: Any) -> str:
    """What a factor or a world parameter declares: its default and its unit; empty for other things."""
    if not isinstance(value, type) or not issubclass(value, Factor | Parameter) or value.default is None:
        return ""
    return f"Default ``{value.default!r}``" + (f", in {value.unit}." if value.unit else ".")


SECTION = re.compile(r"^(Args|Attributes|Raises|Returns|Yields):$")
ITEM = re.compile(r"^((?:\*{0,2}\w+(?:, )?)+|``[^`]+``): (.*)$")


def docstring_in_rst(docstring: str) -> Iterator[str]:
    """The lines of a docstring, its sections as lists of the kind that Sphinx reads."""
    lines = inline_rst(inspect.cleandoc(docstring)).splitlines()
    while lines:
        line = lines.pop(0)
        if not (section := SECTION.match(line)):
            yield line
            continue
        inner = []
        while lines and (not lines[0] or lines[0].startswith(" ")):
            inner.append(lines.pop(0))
        yield from ("", f":{section[1]}:", "")
        for part in inspect.cleandoc("\n" + "\n".join(inner)).splitlines():
            item = ITEM.match(part)
            if part.startswith(" ") or not part or section[1] in ("Returns", "Yields"):
                yield f"    {part}"
            elif item and section[1] == "Raises":
                yield f"  - {', '.join(f':class:`{name}`' for name in item[1].split(', '))}: {item[2]}"
            else:
                yield f"  - ``{item[1].strip('`')}``: {item[2]}" if item else f"  - {part}"
        yield ""


def inline_rst(text: str) -> str:
    """Text in which code may be followed by a letter, and in which bars are bars."""
    text = re.sub(r"(``[^`]+``)(\w?)", lambda m: m[1] + (f"\\ {m[2]}" if m[2] else ""), text)
    return "".join(
        part if part.startswith("``") else part.replace("|", r"\|") for part in re.split(r"(``[^`]+``)", text)
    )
