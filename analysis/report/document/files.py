"""The report's files: the page, its findings as Markdown, and each figure with its data."""

from collections.abc import Callable
from pathlib import Path

from segar.analysis.plotting import style
from segar.analysis.plotting.figures import save_figure
from segar.analysis.report import captions
from segar.analysis.report.document.blocks import Block, Document, Paragraph, Picture
from segar.analysis.report.document.html import page
from segar.analysis.report.document.markdown import markdown
from segar.analysis.report.document.pdf import print_page
from segar.analysis.report.figures.drawing import Drawn, NoFigure
from segar.analysis.tables import write_csv
from segar.experiments.runs.files import write_text

PAGE, PRINT, FINDINGS = "report.html", "report.pdf", "findings.md"
SUFFIXES = (".svg", ".png")  # of figures


def write_document(document: Document, folder: Path, pdf: bool = False) -> list[Path]:
    """Writes the page, its findings and, if asked, its print into the folder; returns their paths. Raises
    :class:`RunFolderError` where there is nothing that prints."""
    write_text(folder / PAGE, page(document))
    write_text(folder / FINDINGS, markdown(document.title, document.answer, document.blocks))
    if pdf:
        print_page(folder / PAGE, folder / PRINT)
    return [folder / PAGE, folder / FINDINGS, *([folder / PRINT] if pdf else [])]


def write_picture(draw: Callable[[], Drawn], folder: Path, name: str, command: str) -> Picture | str:
    """Draws a figure and writes its files; returns the picture, or why it cannot be drawn.

    ``command`` draws the figure again.
    """
    try:
        with style.applied():
            found = draw()
    except NoFigure as why:
        return str(why)
    svg, _ = save_figure(found.figure, folder / "figures" / name, SUFFIXES)
    write_csv(svg.with_suffix(".csv"), found.table, 6)
    return Picture(name, found.caption or captions.FIGURES[name], svg.read_bytes(), command)


def as_block(figure: Picture | str) -> Block:
    """A figure, or a sentence that says why there is none."""
    return Paragraph(f"No figure: {figure}.") if isinstance(figure, str) else figure
