"""Names that a reader knows, for what tables name: families, algorithms, designs, variations, players, groups of factors."""

from collections.abc import Mapping
from pathlib import Path

import yaml

GROUPS: Mapping[str, Mapping[str, str]] = yaml.safe_load(Path(__file__).with_suffix(".yaml").read_bytes())
WORDS = {name: words for group in GROUPS.values() for name, words in group.items()}


def word_for(name: object) -> str:
    """What a table names, in words; its own name where there are none."""
    return WORDS.get(str(name), str(name))


def panel_name(panel: object) -> str:
    """A panel in words, such as ``Hazard tiles, hard``."""
    family, _, difficulty = str(panel).partition("-")
    return ", ".join(filter(None, (word_for(family), difficulty)))
