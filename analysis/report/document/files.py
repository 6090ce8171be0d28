"""The report's files: the page, the PDF, its findings as Markdown, and each figure with its data."""

from collections.abc import Callable
from pathlib import Path

from analysis.plotting import style
from analysis.plotting.figures import save_figure
from analysis.report import captions
from analysis.report.document.blocks import Block, Document, Paragraph, Picture
from analysis.report.document.html import page
from analysis.report.document.markdown import markdown
from analysis.report.document.pdf import sheets
from analysis.report.figures.drawing import Drawn
from analysis.tables import write_csv
from experiments.runs.files import write_bytes, write_text

PAGE, SHEETS, FINDINGS = "report.html", "report.pdf", "findings.md"
SUFFIXES = (".svg", ".png")  # of figures


def write_document(document: Document, folder: Path) -> list[Path]:
    """Writes the page, the PDF and the findings into the folder; returns their paths."""
    write_text(folder / PAGE, page(document))
    write_bytes(folder / SHEETS, sheets(document))
    write_text(folder / FINDINGS, markdown(document.title, document.opening))
    return [folder / PAGE, folder / SHEETS, folder / FINDINGS]


def write_picture(draw: Callable[[], Drawn | str], folder: Path, name: str, command: str) -> Picture | str:
    """Draws a figure and writes its files; returns the picture, or why it cannot be drawn.

    ``command`` draws the figure again.
    """
    with style.applied():
        found = draw()
    if isinstance(found, str):
        return found
    svg, png = save_figure(found.figure, folder / "figures" / name, SUFFIXES)
    write_csv(svg.with_suffix(".csv"), found.table, 6)
    return Picture(name, found.caption or captions.FIGURES[name], svg.read_bytes(), png, command)


def as_block(figure: Picture | str) -> Block:
    """A figure, or a sentence that says why there is none."""
    return Paragraph(f"No figure: {figure}.") if isinstance(figure, str) else figure
