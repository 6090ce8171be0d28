"""The texts in ``captions.yaml``: captions of figures and tables by name, words, and settings of the paper."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

CAPTIONS: Mapping[str, Any] = yaml.safe_load(Path(__file__).with_suffix(".yaml").read_bytes())
FIGURES: Mapping[str, str] = CAPTIONS["figures"]
TABLES: Mapping[str, str] = CAPTIONS["tables"]
TEXTS: Mapping[str, str] = CAPTIONS["texts"]  # with names in braces for what is filled in
GLOSSARY: Sequence[str] = CAPTIONS["glossary"]
SETTINGS: Sequence[Mapping[str, Any]] = CAPTIONS["settings"]
