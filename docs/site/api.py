"""The site's API reference: a page for each room, with every public name and its docstring.

Rooms and names are those of the snapshot of the public API.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import re
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from sphinx.pycode import ModuleAnalyzer

from segar.language import Factor, Parameter, Relation, Rule

PUBLIC = Path(__file__).parents[2] / "tests" / "project" / "public_api.txt"
LONGEST_VALUE = 90  # characters of a constant that is shown


def api_pages() -> Iterator[tuple[str, str]]:
    """A page for each room, and their index."""
    rooms = public_names()
    homes = home_rooms(rooms)
    yield "api/index.rst", api_index(rooms)
    for room, names in rooms.items():
        yield f"api/{room}.rst", room_page(room, names, homes)


@cache
def public_names() -> dict[str, list[str]]:
    """Room to the names that users may rely on."""
    found: dict[str, list[str]] = {}
    for line in filter(None, PUBLIC.read_text().splitlines()):
        if line.startswith("  "):
            found[[*found][-1]].append(re.split(r"\W", line.strip(), maxsplit=1)[0])
        else:
            found[line] = []
    return found


def home_rooms(rooms: dict[str, list[str]]) -> dict[str, str]:
    """Full name to the room that documents the thing: of several rooms that have it, the one that it is written in."""
    found: dict[str, str] = {}
    for room, names in rooms.items():
        for name in names:
            value = getattr(importlib.import_module(room), name)
            others = [other for other in rooms if other not in (room, "segar") and name in rooms[other]]
            same = [other for other in others if getattr(importlib.import_module(other), name) is value]
            own = [other for other in same if str(getattr(value, "__module__", "")).startswith(f"{other}.")]
            found[f"{room}.{name}"] = own[0] if own else same[0] if room == "segar" and same else room
    return found


def api_index(rooms: dict[str, list[str]]) -> str:
    lines = [
        *heading("API", "="),
        "Every public name, room by room. ``segar`` itself has the names that most programs need; all others are imported",
        "from the face of their room, as in ``from segar.noise import LogUniform``.",
        "",
        *table([(f":doc:`{room} <{room}>`", first_sentence(importlib.import_module(room).__doc__)) for room in rooms]),
        ".. toctree::",
        "   :hidden:",
        "",
        *(f"   {room}" for room in rooms),
    ]
    return "\n".join(lines) + "\n"


def room_page(room: str, names: list[str], homes: dict[str, str]) -> str:
    """The index of a room's names and, in the order of its files, their entries."""
    face = importlib.import_module(room)
    lines = [
        *heading(room, "="),
        first_paragraph(face.__doc__),
        "",
        f".. currentmodule:: {room}",
        f".. py:module:: {room}",
        "",
    ]
    rows = []
    for name in sorted(names, key=str.lower):
        home, value = homes[f"{room}.{name}"], getattr(face, name)
        entry_name = value.__name__ if isinstance(value, ModuleType) else f"{home}.{name}"
        link = (
            f":doc:`{name} <{value.__name__}>`" if entry_name in public_names() else f":py:obj:`{name} <{entry_name}>`"
        )
        rows.append((link, summary_of(room, name, value)))
    lines += table(rows)
    modules = public_names()
    own = [
        n for n in names if homes[f"{room}.{n}"] == room and getattr(getattr(face, n), "__name__", None) not in modules
    ]
    origins = {name: origin_of(room, name, getattr(face, name)) for name in own}
    for origin in dict.fromkeys([*imported_from(room).values(), *origins.values()]):
        here = [name for name in own if origins[name] == origin]
        if here:
            title = origin.rpartition(".")[2].replace("_", " ").capitalize() if origin != room else "Defined here"
            lines += [*heading(title, "-"), first_sentence(importlib.import_module(origin).__doc__), ""]
            lines += [line for name in here for line in entry(room, name, getattr(face, name), origin)]
    return "\n".join(lines) + "\n"


def entry(room: str, name: str, value: Any, origin: str) -> list[str]:
    """The directive that documents one name."""
    full = f"{room}.{name}"
    if isinstance(value, ModuleType):
        return [f".. automodule:: {value.__name__}", "   :members:", ""]
    if isinstance(value, type) and not hasattr(value, "__origin__"):
        return [f".. autoclass:: {full}", "   :members:", "   :show-inheritance:", ""]
    if inspect.isroutine(value) or hasattr(value, "__wrapped__") or isinstance(value, Rule | Relation):
        return [f".. autofunction:: {full}", ""]
    source, documentation = constant(origin, name)
    lines = [f".. py:data:: {full}"]
    if source and len(source) <= LONGEST_VALUE:
        lines.append(f"   :value: {source}")
    return [*lines, "", *(f"   {line}" for line in documentation), ""]


def summary_of(room: str, name: str, value: Any) -> str:
    if isinstance(value, Rule | Relation):
        return first_sentence(value.function.__doc__)
    if isinstance(value, type) and not value.__doc__:
        return facts_of(value) or f"A kind of :py:obj:`{value.__base__.__name__}`."  # type: ignore  # only object has no base
    if isinstance(value, type | ModuleType) or inspect.isroutine(value) or hasattr(value, "__wrapped__"):
        return first_sentence(value.__doc__)
    source, documentation = constant(origin_of(room, name, value), name)
    value_text = f"``{source}``" if source and len(source) <= LONGEST_VALUE else f"A {type(value).__name__}."
    return first_sentence("\n".join(documentation)) or value_text


def origin_of(room: str, name: str, value: Any) -> str:
    """The module that a face has a name from."""
    module = str(getattr(value, "__module__", ""))
    return imported_from(room).get(name) or (module if module.startswith(f"{room}.") else room)


def facts_of(value: Any) -> str:
    """What a factor or a world parameter declares: its default and its unit; empty for other things."""
    if not isinstance(value, type) or not issubclass(value, Factor | Parameter) or value.default is None:
        return ""
    return f"Default ``{value.default!r}``" + (f", in {value.unit}." if value.unit else ".")


@cache
def imported_from(room: str) -> dict[str, str]:
    """Name to the module that the face of a room imports it from."""
    file = importlib.import_module(room).__file__
    assert file is not None
    body = ast.parse(Path(file).read_text()).body
    imports = [node for node in body if isinstance(node, ast.ImportFrom) and node.module]
    return {name.asname or name.name: str(node.module) for node in imports for name in node.names}


def constant(origin: str, name: str) -> tuple[str, list[str]]:
    """The expression that a module gives a name, and the lines of its documentation."""
    analyzer = ModuleAnalyzer.for_module(origin)
    if name not in {target for target, _ in assignments(origin)} and name in (further := imported_from(origin)):
        return constant(further[name], name)
    source = next((text for target, text in assignments(origin) if target == name), "")
    return source, analyzer.find_attr_docs().get(("", name), [])


@cache
def assignments(module: str) -> tuple[tuple[str, str], ...]:
    file = importlib.import_module(module).__file__
    assert file is not None
    found = []
    for node in ast.parse(Path(file).read_text()).body:
        targets = (
            node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        )
        found += [(t.id, ast.unparse(node.value)) for t in targets if isinstance(t, ast.Name) and node.value]  # type: ignore
    return tuple(found)


def heading(title: str, line: str) -> list[str]:
    return [title, line * len(title), ""]


def table(rows: Iterable[tuple[str, str]]) -> list[str]:
    lines = [".. list-table::", "   :widths: 30 70", "   :class: names", ""]
    for left, right in rows:
        lines += [f"   * - {left}", f"     - {right}"]
    return [*lines, ""]


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
                yield f"  - :class:`{item[1]}`: {item[2]}"
            else:
                yield f"  - ``{item[1].strip('`')}``: {item[2]}" if item else f"  - {part}"
        yield ""


def inline_rst(text: str) -> str:
    """Text in which code may be followed by a letter, and in which bars are bars."""
    text = re.sub(r"(``[^`]+``)(\w?)", lambda m: m[1] + (f"\\ {m[2]}" if m[2] else ""), text)
    return "".join(
        part if part.startswith("``") else part.replace("|", r"\|") for part in re.split(r"(``[^`]+``)", text)
    )


def first_paragraph(docstring: str | None) -> str:
    return inline_rst(" ".join(inspect.cleandoc(docstring or "").split("\n\n")[0].split()))


def first_sentence(docstring: str | None) -> str:
    return re.split(r"(?<=\.)\s+(?=[A-Z`])", first_paragraph(docstring), maxsplit=1)[0]
