"""The captions of figures and tables, by name, from ``captions.yaml``."""

from collections.abc import Mapping
from pathlib import Path

import yaml

CAPTIONS: Mapping[str, Mapping[str, str]] = yaml.safe_load(Path(__file__).with_suffix(".yaml").read_bytes())
FIGURES, TABLES = CAPTIONS["figures"], CAPTIONS["tables"]
