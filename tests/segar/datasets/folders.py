"""What lies in a folder, beside the lock of who writes there."""

from pathlib import Path

from segar.support import LOCK


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if path.name != LOCK)
