"""The rules of verdicts as data: ``analysis/report/rules.yaml``, its date, and the hash that the report prints."""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

FILE = Path(__file__).with_name("rules.yaml")
TEXT = FILE.read_bytes()
RULES: Mapping[str, Any] = yaml.safe_load(TEXT)
WRITTEN, SHA256 = str(RULES["written"]), hashlib.sha256(TEXT).hexdigest()
MARGINS: Mapping[str, float] = RULES["margins"]
ALPHA: float = RULES["evidence"]["alpha"]
LEAST_BLOCKS: int = RULES["evidence"]["least_blocks"]
WHOLE: Mapping[str, int] = RULES["evidence"]["whole"]
PRESENT: float = RULES["evidence"]["present"]
GATE_MARGIN: float = RULES["gate"]["margin"]
