"""The benchmark's rows beside each other: scores, tables, figures, and the leaderboard page."""

from segar.analysis.benchmark.make import report_rows

__all__ = ["report_rows"]
