"""The report as one HTML page that needs nothing else: styles inside, figures inside, no scripts."""

import base64
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from analysis.report.claims.claim import CORRECTED, PAPER
from analysis.report.document.blocks import FINDING_HEAD, Document, Picture, finding_rows, pieces

MARKS = {"reproduced": "✓", "not reproduced": "✗", "undecided": "?", "not testable": "–"}


def page(document: Document) -> str:
    """The document as HTML."""
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"pieces": pieces, "embedded": embedded, "kind": lambda block: type(block).__name__}
    environment.globals |= {"finding_rows": finding_rows, "finding_head": FINDING_HEAD, "marks": MARKS}
    environment.globals |= {"paper": PAPER, "corrected": CORRECTED}
    return environment.get_template("page.html").render(document=document) + "\n"


def embedded(picture: Picture) -> str:
    """A figure as the address of an image."""
    return "data:image/svg+xml;base64," + base64.b64encode(picture.svg).decode()
