"""The report as a PDF, by fpdf2, in the fonts that matplotlib brings along: no system library, no browser."""

import datetime
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib
from fpdf import FPDF
from fpdf.enums import XPos, YPos
from fpdf.fonts import FontFace

from analysis.plotting import style
from analysis.plotting.figures import PAGE_WIDTH
from analysis.report.document import blocks
from analysis.report.document.blocks import FINDING_HEAD, WORDS_OF_FINDING, Document, finding_rows, pieces
from analysis.report.document.html import MARKS

FONT, MONO = "DejaVu Sans", "DejaVu Sans Mono"
FACES = {(FONT, ""): "DejaVuSans.ttf", (FONT, "B"): "DejaVuSans-Bold.ttf", (MONO, ""): "DejaVuSansMono.ttf"}
BODY, SMALL, CELLS = 9.0, 7.5, 6.5  # [pt]
MARGIN = 16.0  # [mm]
TEXT_WIDTH = 210.0 - 2 * MARGIN  # of A4 [mm]
ENDLESS = (210.0, 1e5)  # a sheet as wide as A4 on which no page ends [mm]
HIGHEST = 225.0  # a figure is no higher [mm]
LEAST_SCALE = 0.85  # of a figure that is to fit on a page; its letters are then as small as those of a table
LONG = 80.0  # a table that may be cut is higher [mm]
LEAST_BEGUN, LEAST_REST = 60.0, 25.0  # and more of it stands before and after the cut [mm]
BESIDE = 3.4  # what a cell needs beside its text [mm]
HEAD_WORD = re.compile(r"\S+(?: %)?")
LEADING = 1.4  # of the font size
INK, SOFT, RULE, TINT = (27, 31, 36), (89, 99, 110), (200, 206, 212), (245, 247, 249)
COLOURS = {
    "supported": (0, 114, 178), "not supported": (179, 71, 0), "undecided": (138, 97, 0), "cannot be tested": SOFT,
}  # fmt: skip
# The same report gives the same bytes, whenever it is made.
MADE = datetime.datetime(2022, 1, 1, tzinfo=datetime.UTC)
POINT = 25.4 / 72  # [mm]


class Sheet(FPDF):
    """Sheets with page numbers, in our fonts; A4 unless another ``format`` is named."""

    def __init__(self, title: str, format: str | tuple[float, float] = "A4"):
        super().__init__(format=format)
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

    def close_fonts(self) -> None:
        """Closes the files of its fonts, as :meth:`output` does."""
        for font in self.fonts.values():
            font.close()  # type: ignore[union-attr]

    def footer(self) -> None:
        """The page number."""
        self.set_y(-MARGIN + 4)
        self.set_font(FONT, size=SMALL)
        self.set_text_color(*SOFT)
        self.cell(0, 4, f"{self.page_no()}", align="R")


def sheets(document: Document) -> bytes:
    """The document as the bytes of a PDF file."""
    endless, first, pdf = Sheet(document.title, ENDLESS), Sheet(document.title), Sheet(document.title)
    heights = draw(endless, document, {}, {})
    draw(first, document, {}, heights)
    pages = {entry.name: entry.page_number for entry in first._outline}  # that the contents name
    draw(pdf, document, pages, heights)
    for tried in (endless, first):
        tried.close_fonts()
    return bytes(pdf.output())


def draw(pdf: Sheet, document: Document, pages: Mapping[str, int], heights: Mapping[int, float]) -> dict[int, float]:
    """Draws the document and returns the height [mm] of each block under its headings, by its place.

    A block whose height is known begins on a new page where :func:`is_cramped` says so; a table that is cut goes on under its
    head. ``pages`` are those of the sections that the contents name.
    """
    line(pdf, document.title, 17, bold=True)
    rich(pdf, document.subtitle, BODY, SOFT)
    contents(pdf, document, pages)
    found: dict[int, float] = {}
    waiting: list[blocks.Heading] = []  # until the block is known that they have to stay with
    for place, block in enumerate(document.blocks):
        if isinstance(block, blocks.Heading):
            waiting.append(block)
            continue
        height, room = heights.get(place, 0.0), pdf.page_break_trigger - pdf.get_y()
        scale = scale_of(block, height, room) if isinstance(block, blocks.Picture) else 1.0
        if scale == 1 and pdf.get_y() > pdf.t_margin and is_cramped(block, height, room):
            pdf.add_page()
        top = pdf.get_y()
        draw_block(pdf, waiting, block, document, scale)
        found[place] = pdf.get_y() - top
        waiting = []
    return found


def scale_of(block: blocks.Picture, height: float, room: float) -> float:
    """The scale at which a figure fits in the room [mm] that is left, where with its caption and headings it has this height;
    1 where that is below :data:`LEAST_SCALE`."""
    _, tall = size_of(block)
    scale = min(1.0, 1.0 - (height - room) / tall)
    return scale if scale >= LEAST_SCALE else 1.0


def is_cramped(block: blocks.Block, height: float, left: float) -> bool:
    """Whether a block of this height [mm] is to begin on a new page, where so much is ``left`` of this one: a long table is cut
    between two rows where a good part of it has room here and more than a few rows follow, and everything else stays in one
    piece."""
    is_cut = isinstance(block, blocks.Table | blocks.Verdict) and height > LONG
    return height > left and not (is_cut and left > LEAST_BEGUN and height - left > LEAST_REST)


def draw_block(
    pdf: Sheet, headings: Sequence[blocks.Heading], block: blocks.Block, document: Document, scale: float = 1.0
) -> None:
    """A block under its headings; a figure at this scale."""
    for one in headings:
        heading(pdf, one)
    match block:
        case blocks.Paragraph():
            rich(pdf, block.text, BODY + {"lead": 0.5, "warning": -1.0}.get(block.kind, 0.0))
        case blocks.Bullets():
            for item in block.items:
                rich(pdf, f"•  {item}", BODY, indent=3)
        case blocks.Table():
            if block.caption:
                rich(pdf, block.caption, SMALL, SOFT)
            cells(pdf, block.head, block.rows, range(block.left))
        case blocks.Picture():
            picture(pdf, block, scale)
        case blocks.Verdict():
            claim(pdf, block, document)


def contents(pdf: Sheet, document: Document, pages: Mapping[str, int]) -> None:
    """The sections with their pages, in two columns."""
    names = [block.text for block in document.blocks if isinstance(block, blocks.Heading) and block.level == 2]
    pdf.set_font(FONT, size=SMALL)
    pdf.set_text_color(*SOFT)
    half, height, top = -(-len(names) // 2), SMALL * POINT * LEADING, pdf.get_y()
    for k, name in enumerate(names):
        link = pdf.add_link(page=pages[name]) if name in pages else ""
        pdf.set_xy(MARGIN + (k // half) * pdf.epw / 2, top + (k % half) * height)
        pdf.cell(pdf.epw / 2 - 14, height, name, link=link)
        pdf.cell(8, height, str(pages.get(name, "")), align="R", link=link)
    pdf.set_xy(MARGIN, top + half * height + 2)


def heading(pdf: Sheet, block: blocks.Heading) -> None:
    """A heading, which the outline of the file names, too."""
    pdf.ln(4 if block.level == 2 else 2)
    pdf.start_section(block.text, level=block.level - 2)
    line(pdf, block.text, 13 if block.level == 2 else 10.5, bold=True)


def line(pdf: Sheet, text: str, size: float, bold: bool = False) -> None:
    """A line in one font, broken where it is too long."""
    pdf.set_font(FONT, "B" if bold else "", size)
    pdf.set_text_color(*INK)
    pdf.multi_cell(0, size * POINT * LEADING, text, align="L", new_x=XPos.LMARGIN, new_y=YPos.NEXT)
    pdf.ln(1)


def rich(pdf: Sheet, text: str, size: float, colour: tuple[int, int, int] = INK, indent: float = 0.0) -> None:
    """A paragraph with its code and its strong words."""
    height = size * POINT * LEADING
    pdf.set_left_margin(MARGIN + indent)
    pdf.set_x(MARGIN + indent)
    for kind, words in pieces(text):
        face = "B" if kind == "strong" else ""
        pdf.set_font(MONO if kind == "code" else FONT, face, size - (0.5 if kind == "code" else 0))
        pdf.set_text_color(*colour)
        for word in re.findall(r"\S+\s*|\s+", words):
            # fpdf2 would cut a word that changes its font at the end of a line.
            end = pdf.get_x() + pdf.get_string_width(word.rstrip()) + 2 * pdf.c_margin
            if end > pdf.w - pdf.r_margin and pdf.get_x() > pdf.l_margin:
                pdf.ln(height)
            pdf.write(height, word)
    pdf.set_left_margin(MARGIN)
    pdf.ln(height + 1.2)


def cells(pdf: Sheet, head: Sequence[str], rows: Sequence[Sequence[str]], words: Sequence[int] | range) -> None:
    """A table: columns of words to the left, numbers to the right; as wide as their contents ask for."""
    pdf.set_font(FONT, size=CELLS)
    pdf.set_text_color(*INK)
    pdf.set_draw_color(*RULE)
    shown = [[as_shown(cell) for cell in row] for row in (head, *rows)]
    widths = widths_of(pdf, shown[1:], shown[0])
    align = ["LEFT" if k in words else "RIGHT" for k in range(len(head))]
    with pdf.table(
        col_widths=widths, width=int(sum(widths)), text_align=align, line_height=CELLS * POINT * 1.35, padding=0.6,
        align="LEFT", borders_layout="HORIZONTAL_LINES", headings_style=FontFace(emphasis="BOLD", fill_color=TINT),
    ) as table:  # fmt: skip
        for row, texts in zip((head, *rows), shown, strict=True):
            line_of = table.row()
            for cell, text in zip(row, texts, strict=True):
                colour = COLOURS.get(cell)
                line_of.cell(text, style=FontFace(color=colour) if colour else None)
    pdf.ln(2.5)


def as_shown(cell: str) -> str:
    """The text of a cell; a verdict with its mark."""
    return f"{MARKS[cell]} {cell}" if cell in MARKS else cell.replace("`", "").replace("**", "")


def widths_of(pdf: Sheet, rows: Sequence[Sequence[str]], head: Sequence[str]) -> list[float]:
    """Widths of columns [mm]: what the longest cell and the head need. Where that is too much, the words of a head stand below
    each other, and long columns give way."""
    columns = zip(*rows, strict=True) if rows else ((),) * len(head)
    cell = [max(map(pdf.get_string_width, texts), default=0.0) + BESIDE for texts in columns]
    pdf.set_font(FONT, "B", CELLS)
    whole = [pdf.get_string_width(text) + BESIDE for text in head]
    word = [max(map(pdf.get_string_width, HEAD_WORD.findall(text)), default=0.0) + BESIDE for text in head]
    pdf.set_font(FONT, "", CELLS)
    easy = list(map(max, cell, whole))
    if sum(easy) <= pdf.epw:
        return easy
    needed = list(map(max, cell, word))
    left, cap = pdf.epw, pdf.epw
    for count, width in zip(range(len(needed), 0, -1), sorted(needed), strict=True):
        cap = left / count
        if width > cap:
            break
        left -= width
    return [min(width, cap) for width in needed]


def size_of(block: blocks.Picture) -> tuple[float, float]:
    """Width and height [mm] of a figure, in the scale in which one of :data:`PAGE_WIDTH` fills the page."""
    from PIL import Image

    with Image.open(block.png) as image:
        ratio = image.height / image.width
        share = image.width / style.SETTINGS["savefig.dpi"] / PAGE_WIDTH
    width = min(TEXT_WIDTH * min(share, 1.0), HIGHEST / ratio)
    return width, width * ratio


def picture(pdf: Sheet, block: blocks.Picture, scale: float) -> None:
    """A figure with its caption on the same page."""
    width = size_of(block)[0] * scale
    pdf.image(block.png, w=width, alt_text=block.caption)
    pdf.ln(1)
    rich(pdf, f"{block.caption} Data: `figures/{block.name}.csv`. Drawn again by `{block.command}`", SMALL, SOFT)
    pdf.ln(1.5)


def claim(pdf: Sheet, block: blocks.Verdict, document: blocks.Document) -> None:
    """A claim: statement, verdicts, what follows, tests."""
    one = block.claim
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
        cells(pdf, FINDING_HEAD, finding_rows(one), WORDS_OF_FINDING)
