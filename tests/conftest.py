"""What pytest collects: the tests of the paper's listings only where the paper's source is at hand."""

from __future__ import annotations

import os
from pathlib import Path

PAPER = Path(os.environ.get("SEGAR_PAPER", Path(__file__).parents[2] / "shared" / "paper" / "segar.tex"))

collect_ignore = [] if PAPER.is_file() else ["test_paper_listings.py"]
