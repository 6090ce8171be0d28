"""Browsers that tests drive: Chromium by Playwright, Firefox by its own protocol (Marionette)."""

import json
import shutil
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from segar.playground import Playground
from tests.waiting import PATIENCE, until

PROGRAMS = {"chromium": ("chromium", "chromium-browser", "google-chrome"), "firefox": ("firefox-esr", "firefox")}
ADVICE = "apt-get install chromium firefox-esr on Debian, then `make test-browser`"
QUIET = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


def program(name: str) -> str | None:
    """Where a browser is; None where it is not installed."""
    return next(filter(None, map(shutil.which, PROGRAMS[name])), None)


class Browser:
    """A browser with one page."""

    def visit(self, address: str) -> None:
        """Go to an address."""
        raise NotImplementedError

    def run(self, body: str, argument: Any = None) -> Any:
        """What the body of a function of ``argument`` returns; plain data."""
        raise NotImplementedError

    def until(self, holds: str, argument: Any = None) -> None:
        """Wait until an expression of ``argument`` holds; Playwright's own waiting evaluates text, which pages forbid."""
        until(lambda: self.run(f"return {holds}", argument))

    def open(self, path: Path) -> None:
        """Open a page of SEGAR, and wait until it can be played or has said what is wrong."""
        self.visit(path.resolve().as_uri())
        self.until("!!window.playground || !document.getElementById('trouble').hidden")

    def show(self, folder: Path, made: Playground) -> None:
        """Save a page in a folder, and open it."""
        made.save(folder / "page.html")
        self.open(folder / "page.html")


class Chromium(Browser):
    """Chromium; ``messages`` are those of the console, and errors of the page."""

    def __init__(self, playwright: Any) -> None:
        self.browser = playwright.chromium.launch(
            executable_path=program("chromium"), args=QUIET, timeout=1000 * PATIENCE
        )
        self.page = self.browser.new_page(viewport={"width": 1240, "height": 900})
        self.page.context.set_default_timeout(1000 * PATIENCE)
        self.messages: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda message: self.messages.append(message.text))
        self.page.on("pageerror", lambda error: self.messages.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))

    def visit(self, address: str) -> None:
        self.messages.clear()
        self.requests.clear()
        self.page.goto(address)

    def run(self, body: str, argument: Any = None) -> Any:
        return self.page.evaluate(f"(argument) => {{ {body} }}", argument)

    def assert_quiet(self) -> None:
        """The page has said nothing to the console, and asked for nothing but itself."""
        assert self.messages == []
        assert [one for one in self.requests if not one.startswith(("file:", "blob:", "data:"))] == []

    def assert_accessible(self) -> None:
        """Axe finds nothing wrong with what the page shows now."""
        from axe_playwright_python.sync_playwright import Axe

        found = Axe().run(self.page)
        assert found.violations_count == 0, found.generate_report()


class Firefox(Browser):
    """Firefox without a window."""

    def __init__(self, marionette: Any) -> None:
        self.marionette = marionette

    def visit(self, address: str) -> None:
        self.marionette.navigate(address)

    def run(self, body: str, argument: Any = None) -> Any:
        # The page's own scope holds the objects of its program.
        script = f"const argument = JSON.parse(arguments[0]); {body}"
        return self.marionette.execute_script(script, [json.dumps(argument)], sandbox=None)


@contextmanager
def started(name: str) -> Iterator[Browser]:
    """A browser, until the block ends."""
    if name == "chromium":
        from playwright.sync_api import sync_playwright

        with sync_playwright() as playwright:
            chromium = Chromium(playwright)
            yield chromium
            chromium.browser.close()
    else:
        with tempfile.TemporaryDirectory() as folder:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of its own dependencies
                from marionette_driver.marionette import Marionette

                # Marionette removes the file that it is given for a log before it opens it: never give it a device.
                marionette = Marionette(
                    bin=program("firefox"), headless=True, port=0, gecko_log=folder, startup_timeout=PATIENCE
                )
                marionette.start_session()
            marionette.timeout.script = PATIENCE
            try:
                yield Firefox(marionette)
            finally:
                marionette.quit(in_app=False)
