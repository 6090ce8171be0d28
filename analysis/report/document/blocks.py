"""The parts of a report: headings, paragraphs, tables, figures and claims, which ``html`` prints.

Texts may hold ``code`` between backquotes and **strong words** between double asterisks, and nothing else.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import cycle

from segar.analysis.report.claims.claim import ALL_RUNS, LEARNED, METRIC_2022, METRIC_OURS, Claim, is_correlation
from segar.analysis.report.number_format import NONE, effect, effect_of_r, p_value, plain
from segar.analysis.stats.estimate import Estimate

IN_BLOCKS = re.compile(r"in (\d+) blocks")
PIECE = re.compile(r"`([^`]+)`|\*\*([^*]+)\*\*")


@dataclass(frozen=True)
class Heading:
    """A section (level 2) or a subsection (level 3)."""

    text: str
    level: int = 2

    @property
    def anchor(self) -> str:
        """The heading as a link's target."""
        return re.sub(r"[^a-z0-9]+", "-", self.text.lower()).strip("-")


@dataclass(frozen=True)
class Paragraph:
    """Some sentences; ``kind`` is "text", "lead" or "warning"."""

    text: str
    kind: str = "text"


@dataclass(frozen=True)
class Bullets:
    """A list."""

    items: Sequence[str]


@dataclass(frozen=True)
class Table:
    """Cells as they are printed; ``left`` counts the columns, from the first, that are words and not numbers."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: int = 1
    caption: str = ""
    folded: bool = False  # long: a page shows it when asked


@dataclass(frozen=True)
class Picture:
    """A figure: its drawing, what it shows, and the command that draws it again."""

    name: str
    caption: str
    svg: bytes = field(repr=False)
    command: str


@dataclass(frozen=True)
class Tiles:
    """Verdicts on claims at a glance; each leads to its box."""

    claims: Sequence[Claim]


Block = Heading | Paragraph | Bullets | Table | Picture | Claim | Tiles  # a claim is printed as a box


@dataclass(frozen=True)
class Document:
    """A title, and blocks in the order of reading."""

    title: str
    subtitle: str
    blocks: Sequence[Block]
    readings: Sequence[str] = (METRIC_2022, METRIC_OURS)  # in which claims are tested, as findings name them
    words: Mapping[str, str] = field(default_factory=dict)  # for verdicts, where others are better
    answer: str = ""  # to the question of the title, in a word or a few
    appendix: Sequence[Block] = ()  # what is looked up, and not printed

    @property
    def sections(self) -> list[Heading]:
        """The headings of level 2."""
        return [one for one in (*self.blocks, *self.appendix) if isinstance(one, Heading) and one.level == 2]


def pieces(text: str) -> list[tuple[str, str]]:
    """A text as (kind, words), the kinds being "plain", "code" and "strong"."""
    parts = PIECE.split(text)  # between two plain parts lies what either group of the pattern matched
    return [(kind, part) for kind, part in zip(cycle(("plain", "code", "strong")), parts, strict=False) if part]


def finding_rows(claim: Claim) -> list[list[str]]:
    """The tests of a claim as cells, in the order of :data:`FINDING_HEAD`."""
    return [
        [one.settings, SHORT.get(one.runs, one.runs), one.test, SHORT.get(one.measure, one.measure),
         *(effect_of_r if is_correlation(one.measure) else effect)(one.found), counted(one.found),
         p_value(one.found.p), plain(one.margin), plain(one.power), one.beside, one.verdict]
        for one in claim.findings
    ]  # fmt: skip


def counted(found: Estimate) -> str:
    """How many rows an estimate rests on, and in how many blocks where there are several and its note says so."""
    blocks = IN_BLOCKS.search(found.note)
    return (f"{found.n:.0f}" + (f" in {blocks[1]}" if blocks else "")) if found.n else NONE


SHORT = {
    LEARNED: "learned", ALL_RUNS: "all", "Pearson r": "r", "partial Pearson r": "partial r", "mean difference": "difference",
}  # fmt: skip
"""Of words of findings, so that the tests have room in their tables."""
FINDING_HEAD = (
    "settings", "runs", "test", "effect is", "effect", "95 %", "n in blocks", "p", "margin", "power", "in place of W2",
    "verdict",
)  # fmt: skip
