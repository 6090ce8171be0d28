"""The report as a PDF, by fpdf2, in the fonts that matplotlib brings along: no system library, no browser."""

import datetime
from collections.abc import Sequence
from pathlib import Path

import matplotlib
from fpdf import FPDF
from fpdf.enums import XPos, YPos
from fpdf.fonts import FontFace

from analysis.report.document import blocks
from analysis.report.document.blocks import FINDING_HEAD, Document, finding_rows, pieces
from analysis.report.document.html import MARKS

FONT, MONO = "DejaVu Sans", "DejaVu Sans Mono"
FACES = {(FONT, ""): "DejaVuSans.ttf", (FONT, "B"): "DejaVuSans-Bold.ttf", (MONO, ""): "DejaVuSansMono.ttf"}
BODY, SMALL, CELLS = 9.0, 7.5, 6.5  # [pt]
MARGIN = 16.0  # [mm]
LEADING = 1.4  # of the font size
INK, SOFT, RULE, TINT = (27, 31, 36), (89, 99, 110), (200, 206, 212), (245, 247, 249)
COLOURS = {"reproduced": (0, 114, 178), "not reproduced": (179, 71, 0), "undecided": (138, 97, 0), "not testable": SOFT}
# The same report gives the same bytes, whenever it is made.
MADE = datetime.datetime(2022, 1, 1, tzinfo=datetime.UTC)
POINT = 25.4 / 72  # [mm]


class Sheet(FPDF):
    """A4 with page numbers, in our fonts."""

    def __init__(self, title: str):
        super().__init__(format="A4")
        fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
        for (family, face), file in FACES.items():
            self.add_font(family, face, fonts / file)  # type: ignore[arg-type]
        self.set_margins(MARGIN, MARGIN)
        self.set_auto_page_break(True, MARGIN)
        self.set_title(title)
        self.set_lang("en")
        self.set_creation_date(MADE)
        self.set_producer("SEGAR")
        self.add_page()

    def footer(self) -> None:
        """The page number."""
        self.set_y(-MARGIN + 4)
        self.set_font(FONT, size=SMALL)
        self.set_text_color(*SOFT)
        self.cell(0, 4, f"{self.page_no()}", align="R")


def sheets(document: Document) -> bytes:
    """The document as the bytes of a PDF file."""
    pdf = Sheet(document.title)
    line(pdf, document.title, 17, bold=True)
    rich(pdf, document.subtitle, BODY, SOFT)
    for block in document.blocks:
        match block:
            case blocks.Heading():
                heading(pdf, block)
            case blocks.Paragraph():
                rich(pdf, block.text, BODY + (0.5 if block.kind == "lead" else 0), bold=block.kind == "warning")
            case blocks.Bullets():
                for item in block.items:
                    rich(pdf, f"•  {item}", BODY, indent=3)
            case blocks.Table():
                if block.caption:
                    rich(pdf, block.caption, SMALL, SOFT)
                cells(pdf, block.head, block.rows, range(block.left))
            case blocks.Picture():
                picture(pdf, block)
            case blocks.Verdict():
                claim(pdf, block, document)
    return bytes(pdf.output())


def heading(pdf: Sheet, block: blocks.Heading) -> None:
    """A heading that is not left alone at the end of a page."""
    if pdf.get_y() > pdf.h - 55:
        pdf.add_page()
    pdf.ln(4 if block.level == 2 else 2)
    pdf.start_section(block.text, level=block.level - 2)
    line(pdf, block.text, 13 if block.level == 2 else 10.5, bold=True)


def line(pdf: Sheet, text: str, size: float, bold: bool = False) -> None:
    """A line in one font, broken where it is too long."""
    pdf.set_font(FONT, "B" if bold else "", size)
    pdf.set_text_color(*INK)
    pdf.multi_cell(0, size * POINT * LEADING, text, align="L", new_x=XPos.LMARGIN, new_y=YPos.NEXT)
    pdf.ln(1)


def rich(
    pdf: Sheet, text: str, size: float, colour: tuple[int, int, int] = INK, indent: float = 0.0, bold: bool = False
) -> None:
    """A paragraph with its code and its strong words."""
    pdf.set_left_margin(MARGIN + indent)
    pdf.set_x(MARGIN + indent)
    for kind, words in pieces(text):
        face = "B" if (bold or kind == "strong") and kind != "code" else ""
        pdf.set_font(MONO if kind == "code" else FONT, face, size - (0.5 if kind == "code" else 0))
        pdf.set_text_color(*colour)
        pdf.write(size * POINT * LEADING, words)
    pdf.set_left_margin(MARGIN)
    pdf.ln(size * POINT * LEADING + 1.2)


def cells(pdf: Sheet, head: Sequence[str], rows: Sequence[Sequence[str]], words: Sequence[int] | range) -> None:
    """A table: columns of words to the left, numbers to the right; as wide as their contents ask for."""
    pdf.set_font(FONT, size=CELLS)
    pdf.set_text_color(*INK)
    pdf.set_draw_color(*RULE)
    widths = widths_of(pdf, head, rows)
    align = ["LEFT" if k in words else "RIGHT" for k in range(len(head))]
    with pdf.table(
        col_widths=widths, width=int(sum(widths)), text_align=align, line_height=CELLS * POINT * 1.35, padding=0.6,
        align="LEFT", borders_layout="HORIZONTAL_LINES", headings_style=FontFace(emphasis="BOLD", fill_color=TINT),
    ) as table:  # fmt: skip
        for row in (head, *rows):
            drawn = table.row()
            for cell in row:
                colour = COLOURS.get(cell)
                shown = f"{MARKS[cell]} {cell}" if cell in MARKS else cell.replace("`", "").replace("**", "")
                drawn.cell(shown, style=FontFace(color=colour) if colour else None)
    pdf.ln(2.5)


def widths_of(pdf: Sheet, head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[float]:
    """Widths of columns [mm]: what the longest cell needs; where that is too much, long columns give way."""
    needed = [max(pdf.get_string_width(str(row[k])) * 1.12 for row in (head, *rows)) + 2.4 for k in range(len(head))]
    left, cap = pdf.epw, pdf.epw
    for count, width in zip(range(len(needed), 0, -1), sorted(needed), strict=True):
        cap = left / count
        if width > cap:
            break
        left -= width
    return [min(width, cap) for width in needed] if sum(needed) > pdf.epw else needed


def picture(pdf: Sheet, block: blocks.Picture) -> None:
    """A figure across the page, with its caption on the same page."""
    from PIL import Image

    with Image.open(block.png) as image:
        ratio = image.height / image.width
    width = min(pdf.epw, 210 / ratio if ratio > 0.8 else pdf.epw)
    if pdf.get_y() + width * ratio + 22 > pdf.h - MARGIN:
        pdf.add_page()
    pdf.image(block.png, w=width, alt_text=block.caption)
    pdf.ln(1)
    rich(pdf, f"{block.caption} Data: `figures/{block.name}.csv`. Drawn again by `{block.command}`", SMALL, SOFT)
    pdf.ln(1.5)


def claim(pdf: Sheet, block: blocks.Verdict, document: blocks.Document) -> None:
    """A claim: statement, verdicts, what follows, tests."""
    one = block.claim
    if pdf.get_y() > pdf.h - 60:
        pdf.add_page()
    pdf.set_draw_color(*RULE)
    pdf.line(MARGIN, pdf.get_y(), pdf.w - MARGIN, pdf.get_y())
    pdf.ln(1.5)
    rich(pdf, f"**{one.name}**  **{one.statement}**", BODY)
    pdf.set_font(FONT, size=SMALL)
    pdf.set_text_color(*SOFT)
    pdf.write(4, f"{one.where}.  ")
    for settings in document.readings if one.findings else document.readings[:1]:
        verdict = one.verdict(settings)
        if verdict:
            pdf.set_font(FONT, "", SMALL)
            pdf.set_text_color(*SOFT)
            pdf.write(4, f"{settings}: ")
            pdf.set_font(FONT, "B", SMALL)
            pdf.set_text_color(*COLOURS[verdict])
            pdf.write(4, f"{MARKS[verdict]} {document.words.get(verdict, verdict)}    ")
    pdf.ln(5)
    for text in (one.note, one.follows, f"It would take {one.needs}." if one.needs else ""):
        if text:
            rich(pdf, text, BODY)
    if one.findings:
        cells(pdf, FINDING_HEAD, finding_rows(one), (0, 1, 2, len(FINDING_HEAD) - 1))
