"""The report as one HTML page that needs nothing else: styles inside, figures inside, no scripts."""

import base64
from pathlib import Path

from segar.analysis.report.document.blocks import FINDING_HEAD, Document, Picture, finding_rows, pieces
from segar.support import templates

MARKS = {"supported": "✓", "not supported": "✗", "undecided": "?", "not yet tested": "…", "cannot be tested": "–"}


def page(document: Document) -> str:
    """The document as HTML."""
    environment = templates(Path(__file__).parent, autoescape=True)
    environment.filters |= {"pieces": pieces, "embedded": embedded, "kind": lambda block: type(block).__name__}
    environment.globals |= {"finding_rows": finding_rows, "finding_head": FINDING_HEAD, "marks": MARKS}
    return environment.get_template("page.html", globals={"document": document}).render() + "\n"


def embedded(picture: Picture) -> str:
    """A figure as the address of an image."""
    return "data:image/svg+xml;base64," + base64.b64encode(picture.svg).decode()
