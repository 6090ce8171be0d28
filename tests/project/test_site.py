"""The built site has every page and every public name, leads nowhere that is not there, and loads nothing from elsewhere.

``make site`` builds it and then runs these tests.
"""

import functools
import importlib.util
import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

import segar
from segar.levels import TASK_LEVELS
from segar.suites import suite, suites
from tests.places import ROOT
from tests.project.test_public_api import ROOMS, promised

pytestmark = pytest.mark.site

SITE = ROOT / "build" / "site"
DOCS = ROOT / "docs"
PAGES = [
    *(page.relative_to(DOCS).with_suffix(".html") for page in DOCS.rglob("*.md")),
    *map(Path, ("CHANGELOG.html", "CONTRIBUTING.html", "index.html")),
]
LOADED = dict.fromkeys(("script", "img", "iframe", "source", "video"), "src") | {"link": "href", "object": "data"}
NOT_LOADED = {"canonical", "author", "license"}  # relations of a link that browsers do not follow by themselves


class Page(HTMLParser):
    """What a page links to, what it loads, its anchors, and the texts of its links."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.anchors: set[str] = set()
        self.link_texts: set[str] = set()
        self._text: list[str] | None = None
        self.feed(path.read_text())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.anchors |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a":
            self._text = []
            self.links += [given["href"]] if "href" in given else []
        if LOADED.get(tag) in given and given.get("rel") not in NOT_LOADED:
            self.loaded.append(given[LOADED[tag]])

    def handle_data(self, data: str) -> None:
        if self._text is not None:
            self._text.append(data)

    def handle_endtag(self, tag: str) -> None:
        if tag == "a" and self._text is not None:
            self.link_texts.add("".join(self._text).strip())
            self._text = None


@functools.cache
def page_at(path: Path) -> Page:
    return Page(path)


def pages_of_site() -> list[Path]:
    found = sorted(SITE.rglob("*.html"))
    assert found, "there is no site; run `make site`"
    return found


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_every_page_of_the_documentation_is_a_page_of_the_site(page):
    assert (SITE / page).is_file()


def test_every_link_leads_to_a_file_and_an_anchor_that_exist():
    dead = []
    for path in pages_of_site():
        page = page_at(path)
        for link in {*page.links, *page.loaded}:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            aim = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not aim.is_file():
                dead.append(f"{path.relative_to(SITE)}: there is no {link}")
            elif parts.fragment and aim.suffix == ".html" and unquote(parts.fragment) not in page_at(aim).anchors:
                dead.append(f"{path.relative_to(SITE)}: there is no place {link}")
    assert not dead, "\n".join(dead)


def test_links_to_other_hosts_are_complete_addresses():
    others = {link for path in pages_of_site() for link in page_at(path).links if urlsplit(link).scheme or "//" in link}
    assert others
    assert not [link for link in others if not re.fullmatch(r"https://[\w.-]+\.\w+(/\S*)?", link)]


def test_pages_load_nothing_from_another_host():
    loaded = {path: [one for one in page_at(path).loaded if urlsplit(one).netloc] for path in pages_of_site()}
    for path in SITE.rglob("*.css"):
        loaded[path] = re.findall(r"(?:url\(|@import)\s*[\"']?((?:https?:)?//[^\"')]*)", path.read_text())
    assert not {path.relative_to(SITE): addresses for path, addresses in loaded.items() if addresses}


@pytest.mark.parametrize(("step", "playground"), [(2, "play"), (4, "windy"), (5, "distance"), (6, "agent")])
def test_a_step_of_the_tutorial_shows_the_page_that_its_command_makes(step, playground):
    steps = (SITE / "tutorial.html").read_text().split("<h2>")
    assert f"-o {playground}.html" in re.sub("<[^>]*>", "", steps[step])
    assert re.findall(r'<iframe class="playground" src="([^"]*)"', steps[step]) == [f"tutorial/{playground}.html"]
    assert "<canvas" in (SITE / "tutorial" / f"{playground}.html").read_text()


def test_the_front_page_is_a_match_and_each_environment_opens_with_a_moving_level_and_its_aim():
    assert '<iframe class="match" src="beat-the-agent.html"' in (SITE / "index.html").read_text()
    for name in (*segar.families(), *TASK_LEVELS):
        aim, moving = (SITE / "environments" / f"{name}.html").read_text().split("</h1>")[1].split("<picture>")[:2]
        assert re.search(r"<p>\w[^<]*\.</p>", aim) and f"{name}-moving.webp" in moving.split("</picture>")[0]


@pytest.mark.parametrize("room", ROOMS)
def test_the_api_has_an_entry_for_every_public_name(room):
    page = page_at(SITE / "api" / f"{room}.html")
    names = promised(room)
    assert names
    assert not [name for name in names if name not in page.link_texts]


@pytest.mark.parametrize("name", [*segar.families(), *TASK_LEVELS])
def test_a_named_distribution_has_a_page_with_its_factors(name):
    text = (SITE / "environments" / f"{name}.html").read_text()
    factors = {factor.__name__ for laws in segar.family(name).marginals().values() for factor in laws}
    assert factors
    assert not [factor for factor in factors if f">{factor}<" not in text]


@pytest.mark.parametrize("name", suites())
def test_a_suite_has_a_card_with_its_hashes_and_the_index_links_it(name):
    text = (SITE / "suites" / f"{name}.html").read_text()
    assert not [value for value in (suite(name).hash, *suite(name).hashes.values()) if value not in text]
    assert f"{name}.html" in page_at(SITE / "suites" / "index.html").links


def test_the_sections_of_a_docstring_become_lists_and_keep_all_words():
    place = importlib.util.spec_from_file_location("site_api", DOCS / "site" / "api.py")
    assert place and place.loader
    api = importlib.util.module_from_spec(place)
    place.loader.exec_module(api)
    docstring = """What |x| is; ``if``s too.

    Args:
        a, b: two sets,
            of levels.
        Others as elsewhere.

    Raises:
        LevelError: they are empty.
    """
    text = "\n".join(api.docstring_in_rst(docstring))
    assert r"What \|x\| is; ``if``\ s too." in text
    assert "  - ``a, b``: two sets,\n        of levels.\n  - Others as elsewhere." in text
    assert ":Raises:\n\n  - :class:`LevelError`: they are empty." in text
