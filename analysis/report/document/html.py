"""The report as one HTML page that needs nothing else: styles inside, figures inside, no scripts."""

import base64
import re
from pathlib import Path

from segar.analysis.plotting.figures import PAGE_WIDTH
from segar.analysis.report.document.blocks import FINDING_HEAD, Document, Picture, finding_rows, pieces
from segar.analysis.report.number_format import p_value
from segar.support import templates

POINTS = 72  # to the inch
MARKS = {"supported": "✓", "not supported": "✗", "undecided": "?", "not yet tested": "…", "cannot be tested": "–"}


def page(document: Document) -> str:
    """The document as HTML."""
    environment = templates(Path(__file__).parent, autoescape=True)
    environment.filters |= {"pieces": pieces, "embedded": embedded, "share": share, "p_value": p_value}
    environment.globals |= {"finding_rows": finding_rows, "finding_head": FINDING_HEAD, "marks": MARKS}
    return environment.get_template("page.html", globals={"document": document}).render() + "\n"


def share(picture: Picture) -> float:
    """How much of a page's width a figure has, 1 at most, so that letters are of one size in all of them."""
    (points,) = re.findall(rb'<svg [^>]*?width="([0-9.]+)pt"', picture.svg)
    return min(float(points) / POINTS / PAGE_WIDTH, 1.0)


def embedded(picture: Picture) -> str:
    """A figure as the address of an image."""
    return "data:image/svg+xml;base64," + base64.b64encode(picture.svg).decode()
