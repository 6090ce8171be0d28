"""Where things lie, whatever folder a test is in."""

from pathlib import Path

TESTS = Path(__file__).parent
ROOT = TESTS.parent
LINKED = ("experiments", "analysis", "conf")
"""Links in ``segar`` to folders beside it; copies of these in an archive of sources."""


def sources(package: str, pattern: str = "*.py") -> list[Path]:
    """The files of a package, each where it is edited."""
    found = sorted((ROOT / package).rglob(pattern))
    return [path for path in found if package != "segar" or path.relative_to(ROOT / package).parts[0] not in LINKED]
