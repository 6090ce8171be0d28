"""A browser for the tests of pages. A browser that is missing is a failure that says how to get it, unless
``SEGAR_BROWSERS`` names those to be tried, such as ``chromium``; ``none`` is said in the tests' summary."""

import os
from collections.abc import Iterator

import pytest

from tests.segar.playground.browsers import ADVICE, PROGRAMS, Browser, program, started

WANTED = os.environ.get("SEGAR_BROWSERS", ",".join(PROGRAMS)).split(",")


@pytest.fixture(scope="session", params=tuple(PROGRAMS))
def browser(request: pytest.FixtureRequest) -> Iterator[Browser]:
    name = request.param
    if program(name) is None or name not in WANTED:
        pytest.skip(f"{name} is not tested here: {ADVICE}")
    with started(name) as found:
        yield found
