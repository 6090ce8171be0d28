"""Browsers for the tests of pages. Where one is missing, its tests are skipped and the summary says how to get it; where
``SEGAR_BROWSERS`` is ``required``, as in ``make test-browser``, they fail."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

import segar
from segar.playground import make_playground
from tests.segar.playground.browsers import ADVICE, Browser, Chromium, program, started

OPEN: list[Browser] = []
LEVELS = segar.family("objectsx3-hard").sample(12, seed=1)


@pytest.fixture(scope="session")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page of things of all kinds, drawn at random, some of which may be absent."""
    path = tmp_path_factory.mktemp("page") / "page.html"
    make_playground(LEVELS).save(path)
    return path


@pytest.fixture(autouse=True)
def leave_no_page_at_work() -> Iterator[None]:
    """A page that nobody looks at would go on drawing beside the next tests."""
    yield
    for browser in OPEN:
        browser.visit("about:blank")


@pytest.fixture(scope="session", params=["chromium", pytest.param("firefox", marks=pytest.mark.slow)])
def browser(request: pytest.FixtureRequest) -> Browser:
    """Each browser in turn; Firefox only in slow tests, and where a test asks for it by name."""
    return request.getfixturevalue(request.param)


@pytest.fixture(scope="session")
def chromium() -> Iterator[Chromium]:
    """Chromium, in which a test can use a mouse and keys."""
    for found in _browser("chromium"):
        assert isinstance(found, Chromium)
        yield found


@pytest.fixture(scope="session")
def firefox() -> Iterator[Browser]:
    """Firefox, which plays with another compiler."""
    yield from _browser("firefox")


def _browser(name: str) -> Iterator[Browser]:
    if program(name) is None:
        said = f"{name} is not installed: {ADVICE}"
        pytest.fail(said) if os.environ.get("SEGAR_BROWSERS") == "required" else pytest.skip(said)
    with started(name) as found:
        OPEN.append(found)
        yield found
        OPEN.remove(found)
