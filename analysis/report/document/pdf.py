"""The page as a PDF: printed by Chromium, where there is one."""

import os
import shutil
import subprocess
from pathlib import Path

from segar.experiments.runs.files import replacing
from segar.experiments.settings import RunFolderError

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge")
MOST_SECONDS = 300


def print_page(page: Path, pdf: Path) -> None:
    """Prints a page into a PDF file, whole or not at all; raises :class:`RunFolderError` where it cannot be done."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise RunFolderError(
            f"{pdf.name} needs a browser that prints, and there is none of {', '.join(BROWSERS)} on PATH. Install Chromium, or "
            f"open {page} in any browser and print it"
        )
    sandbox = ["--no-sandbox"] if os.geteuid() == 0 else []  # Chromium has none for root
    with replacing(pdf) as beside:
        options = ["--headless", "--disable-gpu", "--no-pdf-header-footer", f"--print-to-pdf={beside}"]
        command = [browser, *sandbox, *options, page.as_uri()]
        try:
            done = subprocess.run(command, capture_output=True, timeout=MOST_SECONDS, check=True, encoding="utf-8")
        except subprocess.CalledProcessError as error:
            raise RunFolderError(f"{browser} has not printed {page}: {error.stderr.strip()}") from error
        except subprocess.TimeoutExpired as error:
            raise RunFolderError(f"{browser} has not printed {page} in {MOST_SECONDS} s") from error
        if not beside.exists() or not beside.stat().st_size:
            raise RunFolderError(f"{browser} has not printed {page}, and says: {done.stderr.strip() or 'nothing'}")
