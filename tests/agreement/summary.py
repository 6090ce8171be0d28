"""What the agreement tests found, for the end of pytest's report; with several workers it comes from one of them."""

from __future__ import annotations

lines: list[str] = []
