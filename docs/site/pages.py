"""The sources of the site's pages: those of ``docs/`` with links that hold on the site, and the API reference (``api.py``).

``python docs/site/pages.py`` writes them to ``build/site-source``, and files that pages link to to ``build/site-files``.
"""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path

from api import api_pages
from playgrounds import with_frames

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
SOURCE = ROOT / "build" / "site-source"
FILES = ROOT / "build" / "site-files"
GENERATED = ("environments", "suites")  # folders of the source that others write
BESIDE = ("CHANGELOG.md", "CONTRIBUTING.md")

FENCE = re.compile(r"^```.*?^```$", re.M | re.S)
LINK = re.compile(r"(?<=\]\()(?!https?:)([^)#\s]+)((?:#[^)\s]+)?\))")
MATCH = re.compile(r"\[!\[[^\]]*\]\([^)]*\)\]\(here:(beat-the-agent\.html)\)")  # a picture of a match, which
PLAYED = r'<iframe class="match" src="\1" title="Beat the agent"></iframe>'  # the front page plays
PICTURES = (".png", ".svg", ".gif")
LEXERS = {".py": "python", ".yaml": "yaml", ".cff": "yaml", ".toml": "toml"}
SECTIONS = {"how-to": "How-to pages", "reference": "Reference", "decisions": "Decisions and results"}

FRONT = """
```{{toctree}}
:hidden:
:caption: Learn

Overview <README>
tutorial
how-to/index
environments/index
suites/index
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
            self.add_page(page.relative_to(DOCS).as_posix(), page, page.read_text(encoding="utf-8"))
        for name in BESIDE:
            self.add_page(name, ROOT / name, (ROOT / name).read_text(encoding="utf-8"))
        self.texts["tutorial.md"] = with_frames(self.texts["tutorial.md"])
        results = "Results <results/README>"
        self.add_page("index.md", ROOT / "README.md", (ROOT / "README.md").read_text(encoding="utf-8"))
        self.texts["index.md"] = MATCH.sub(PLAYED, self.texts["index.md"])
        self.texts["index.md"] += FRONT.format(results=results)
        self.texts["results/README.md"] += self.reports()
        pages = (page for name in ("findings", "leaderboard") for page in sorted(DOCS.glob(f"results/*/{name}.md")))
        self.texts["results/README.md"] += toctree([page.relative_to(DOCS / "results").as_posix() for page in pages])

    def reports(self) -> str:
        """Links to the reports that were made or fetched, which are pages of their own."""
        links = []
        for report in sorted(DOCS.glob("results/*/report.html")):
            self.files[report.relative_to(DOCS).as_posix()] = report
            links.append(f"- [{report.parent.name}](here:{report.relative_to(DOCS / 'results').as_posix()})\n")
        return "\n## The reports as pages\n\n" + "".join(links) if links else ""

    def add_sections(self) -> None:
        """An index of each folder: its section of docs/README.md."""
        text = (DOCS / "README.md").read_text(encoding="utf-8")
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
    settings = "---\norphan: true\nnosearch: true\n---\n\n"
    head = f"{settings}# `{place}`\n\n"
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.suffix in LEXERS)
        yield source_page(path), head + "".join(f"- [`{file.name}`]({file.name}.md)\n" for file in files)
        for file in files:
            yield from shown_source(file)
    elif path.suffix == ".ipynb":
        yield source_page(path), settings + notebook_text(path)
    else:
        yield (
            source_page(path),
            f"{head}````{{code-block}} {LEXERS.get(path.suffix, 'text')}\n{path.read_text(encoding='utf-8')}````\n",
        )


def notebook_text(path: Path) -> str:
    """The cells of a notebook, its programs in blocks."""
    cells = [
        (cell["cell_type"], "".join(cell["source"])) for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]
    ]
    return "\n\n".join(f"```python\n{text}\n```" if kind == "code" else text for kind, text in cells) + "\n"


if __name__ == "__main__":
    write_pages()
