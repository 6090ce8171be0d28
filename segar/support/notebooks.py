"""What notebooks show: the templates that HTML is made by, and the objects that have some."""

from pathlib import Path
from typing import Any, ClassVar


def templates(folder: Path, **options: Any) -> Any:
    """The templates in a folder, in which a name that nobody gives is an error; ``options`` are those of jinja2."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    loader = FileSystemLoader(folder)
    return Environment(loader=loader, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, **options)


class ShownInNotebooks:
    """What a notebook shows as a card where it is the last value of a cell; see :func:`segar.playground.html_of`."""

    # Set by segar itself: a card shows pictures, which stand above the rooms of what is shown.
    _repr_html_: ClassVar[Any]
