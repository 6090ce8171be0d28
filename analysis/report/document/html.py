"""The report as one HTML page that needs nothing else: styles inside, figures inside, no scripts."""

import base64
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from segar.analysis.report.document.blocks import FINDING_HEAD, Document, Picture, finding_rows, pieces

MARKS = {"supported": "✓", "not supported": "✗", "undecided": "?", "not yet tested": "…", "cannot be tested": "–"}


def templates(folder: Path, **options: Any) -> Environment:
    """The templates in a folder, in which a name that nobody gives is an error; ``options`` are those of jinja2."""
    loader = FileSystemLoader(folder)
    return Environment(loader=loader, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, **options)


def page(document: Document) -> str:
    """The document as HTML."""
    environment = templates(Path(__file__).parent, autoescape=True)
    environment.filters |= {"pieces": pieces, "embedded": embedded, "kind": lambda block: type(block).__name__}
    environment.globals |= {"finding_rows": finding_rows, "finding_head": FINDING_HEAD, "marks": MARKS}
    return environment.get_template("page.html", globals={"document": document}).render() + "\n"


def embedded(picture: Picture) -> str:
    """A figure as the address of an image."""
    return "data:image/svg+xml;base64," + base64.b64encode(picture.svg).decode()
