"""The sources of the site's pages: those of ``docs/`` with links that hold on the site, and the API reference.

``python docs/site/pages.py`` writes them to ``build/site-source``, and files that pages link to to ``build/site-files``.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import os
import re
import shutil
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from sphinx.pycode import ModuleAnalyzer

from segar.language import Factor, Parameter, Relation, Rule

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
SOURCE = ROOT / "build" / "site-source"
FILES = ROOT / "build" / "site-files"
GENERATED = ("environments",)  # folders of the source that others write
BESIDE = ("CHANGELOG.md", "CONTRIBUTING.md")
PUBLIC = ROOT / "tests" / "project" / "public_api.txt"

FENCE = re.compile(r"^```.*?^```$", re.M | re.S)
LINK = re.compile(r"(?<=\]\()(?!https?:)([^)#\s]+)((?:#[^)\s]+)?\))")
PICTURES = (".png", ".svg", ".gif")
LEXERS = {".py": "python", ".yaml": "yaml", ".cff": "yaml", ".toml": "toml"}
LONGEST_VALUE = 90  # characters of a constant that is shown
SECTIONS = {"how-to": "How-to pages", "reference": "Reference", "decisions": "Decisions and results"}

FRONT = """
```{{toctree}}
:hidden:
:caption: Learn

Overview <README>
tutorial
how-to/index
environments/index
glossary
```

```{{toctree}}
:hidden:
:caption: Look up

reference/index
api/index
{results}
decisions/index
```

```{{toctree}}
:hidden:
:caption: The project

CHANGELOG
CONTRIBUTING
```
"""


def write_pages() -> None:
    """Write all sources but the generated environments; what is as it was keeps its time, so that Sphinx reads it not again."""
    pages = Pages()
    pages.add_documentation()
    pages.add_sections()
    for path, text in api_pages():
        pages.add(path, text)
    pages.finish()


class Pages:
    """Pages to be written, with the files of the repository that they link to."""

    def __init__(self) -> None:
        self.texts: dict[str, str] = {}
        self.pictures: dict[str, Path] = {}
        self.files: dict[str, Path] = {}
        self.shown: list[Path] = []

    def add(self, path: str, text: str) -> None:
        self.texts[path] = text

    def add_documentation(self) -> None:
        """The pages of ``docs/``, README.md as the front page, and what stands beside it."""
        for page in sorted(DOCS.rglob("*.md")):
            self.add_page(page.relative_to(DOCS).as_posix(), page, page.read_text())
        for name in BESIDE:
            self.add_page(name, ROOT / name, (ROOT / name).read_text())
        results = "Results <results/README>"
        self.add_page("index.md", ROOT / "README.md", (ROOT / "README.md").read_text())
        self.texts["index.md"] += FRONT.format(results=results)
        self.texts["results/README.md"] += self.reports()
        findings = sorted(page.relative_to(DOCS / "results").as_posix() for page in DOCS.glob("results/*/findings.md"))
        self.texts["results/README.md"] += toctree(findings)

    def reports(self) -> str:
        """Links to the reports, which are pages of their own."""
        links = []
        for report in sorted(DOCS.glob("results/*/report.html")):
            self.files[report.relative_to(DOCS).as_posix()] = report
            links.append(f"- [{report.parent.name}](here:{report.relative_to(DOCS / 'results').as_posix()})\n")
        return "\n## The reports as pages\n\n" + "".join(links)

    def add_sections(self) -> None:
        """An index of each folder: its section of docs/README.md."""
        text = (DOCS / "README.md").read_text()
        for folder, title in SECTIONS.items():
            (section,) = re.findall(rf"^## {title}\n(.*?)(?=^## )", text, re.M | re.S)
            listed = [name for name in re.findall(rf"\({folder}/([\w-]+)\.md\)", section)]
            heading = "Decisions" if folder == "decisions" else title
            page = f"# {heading}\n{section}{toctree(dict.fromkeys(listed))}"
            self.add_page(f"{folder}/index.md", DOCS / "README.md", page)
        self.texts["reference/index.md"] = self.texts["reference/index.md"].replace(
            "# Reference\n",
            "# Reference\n\nEvery public name with its docstring stands in the [API](../api/index.rst).\n",
            1,
        )

    def add_page(self, path: str, page: Path, text: str) -> None:
        """A page of the repository, with links that hold at the path on the site."""
        folder = os.path.dirname(path)

        def changed(link: re.Match[str]) -> str:
            aim = (page.parent / link[1]).resolve()
            return (self.place(aim, folder) if aim.exists() else link[1]) + link[2]

        parts = re.split(f"({FENCE.pattern})", text, flags=re.M | re.S)
        self.add(path, "".join(part if part.startswith("```") else LINK.sub(changed, part) for part in parts))

    def place(self, aim: Path, folder: str) -> str:
        """Where a file or folder of the repository is on the site, seen from a folder of the site."""
        if aim == ROOT / "README.md":
            return os.path.relpath("index.md", folder or ".")
        if aim.parent == ROOT and aim.name in BESIDE:
            return os.path.relpath(aim.name, folder or ".")
        if not aim.is_relative_to(DOCS):
            self.shown.append(aim)
            return os.path.relpath(source_page(aim), folder or ".")
        place = aim.relative_to(DOCS).as_posix()
        if aim.suffix in PICTURES:
            self.pictures[place] = aim
        elif aim.suffix != ".md":
            self.files[place] = aim
            return f"here:{os.path.relpath(place, folder or '.')}"
        return os.path.relpath(place, folder or ".")

    def finish(self) -> None:
        """Write what is new, and take away what is no more."""
        for aim in dict.fromkeys(self.shown):
            self.texts |= dict(shown_source(aim))
        kept = {*self.texts, *self.pictures}
        for old in SOURCE.rglob("*"):
            place = old.relative_to(SOURCE).as_posix()
            if old.is_file() and place not in kept and not place.startswith(GENERATED):
                old.unlink()
        for path, text in self.texts.items():
            write_new(SOURCE / path, text.encode())
        for path, picture in self.pictures.items():
            write_new(SOURCE / path, picture.read_bytes())
        shutil.rmtree(FILES, ignore_errors=True)
        FILES.mkdir(parents=True)
        for path, file in self.files.items():
            write_new(FILES / path, file.read_bytes())


def write_new(path: Path, content: bytes) -> None:
    """Write a file that is not as it shall be."""
    if not path.exists() or path.read_bytes() != content:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


def toctree(pages: Iterable[str]) -> str:
    """A directive that puts pages into the sidebar."""
    return "\n```{toctree}\n:hidden:\n\n" + "".join(f"{page.removesuffix('.md')}\n" for page in pages) + "```\n"


def source_page(path: Path) -> str:
    """The page that shows a file or a folder of the repository."""
    place = path.relative_to(ROOT).as_posix()
    return f"source/{place}/index.md" if path.is_dir() else f"source/{place}.md"


def shown_source(path: Path) -> Iterator[tuple[str, str]]:
    """The page of a file; of a folder, a page that lists its files, and their pages."""
    place = path.relative_to(ROOT).as_posix()
    head = f"---\norphan: true\nnosearch: true\n---\n\n# `{place}`\n\n"
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.suffix in LEXERS)
        yield source_page(path), head + "".join(f"- [`{file.name}`]({file.name}.md)\n" for file in files)
        for file in files:
            yield from shown_source(file)
    else:
        yield source_page(path), f"{head}````{{code-block}} {LEXERS.get(path.suffix, 'text')}\n{path.read_text()}````\n"


# The API reference. Rooms and names are those of the snapshot of the public API.


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
        return facts_of(value) or f"A kind of :py:obj:`{value.__base__.__name__}`."
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


if __name__ == "__main__":
    write_pages()
