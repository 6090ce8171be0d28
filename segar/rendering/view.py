"""What people want to see: size of the picture, and which hints it has."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from segar.errors import SegarError
from segar.language import Entity
from segar.observations import Colour

SMALLEST, LARGEST = 64, 2048  # [px]
READABLE = 192  # [px] smaller pictures have no room for text
LINE_SHARE = 16  # the arena is so many times as high as the line below it


@dataclass(frozen=True)
class View:
    """How an environment is drawn for people.

    Args:
        size: side of the arena in pixels, an even number from 64 to 2048.
        labels: whether things have their names and factors written beside them, in pictures of at least 192 pixels.
        fields: whether faint arrows show where charges push and what magnets turn.
        line: whether there is a line of text below the arena, of at least 192 pixels: step, return, level.
        colours: entity type to its colour, as :class:`segar.observations.pixels.Pixels` takes them.

    Raises:
        SegarError: the size is not one of these.
    """

    size: int = 512
    labels: bool = True
    fields: bool = True
    line: bool = True
    colours: Mapping[type[Entity], Colour] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        if self.size % 2 or not SMALLEST <= self.size <= LARGEST:  # video codecs take even sizes
            raise SegarError(f"View: size must be an even number from {SMALLEST} to {LARGEST}, not {self.size!r}")

    @property
    def line_height(self) -> int:
        """Height of the line below the arena [px], an even number."""
        return 2 * (max(self.size // LINE_SHARE, 20) // 2) if self.line and self.is_readable else 0

    @property
    def is_readable(self) -> bool:
        """Whether text has room."""
        return self.size >= READABLE

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of a frame: rows, columns, colours."""
        return self.size + self.line_height, self.size, 3
