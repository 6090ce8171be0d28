"""Some blocks of a report as Markdown, for readers of the repository: no figures, no boxes of claims."""

from collections.abc import Sequence

from segar.analysis.report.document.blocks import Block, Bullets, Heading, Paragraph, Table
from segar.analysis.report.document.html import MARKS


def markdown(title: str, answer: str, blocks: Sequence[Block]) -> str:
    """Headings, paragraphs, lists and tables under a title and the answer to it; what is none of these is left out."""
    parts = [f"# {title}", *([f"**{answer}**"] if answer else [])]
    for block in blocks:
        match block:
            case Heading():
                parts.append(f"{'#' * block.level} {block.text}")
            case Paragraph():
                parts.append(block.text)
            case Bullets():
                parts.append("\n".join(f"- {item}" for item in block.items))
            case Table():
                parts += [block.caption] * bool(block.caption)
                rows = (block.head, ["---"] * len(block.head), *block.rows)
                parts.append("\n".join(f"| {' | '.join(map(cell, row))} |" for row in rows))
    return "\n\n".join(parts) + "\n"


def cell(text: str) -> str:
    """The text of a cell; a verdict with its mark."""
    return f"{MARKS[text]} {text}" if text in MARKS else text.replace("|", "\\|")
