"""Replays every file of recordings once, and reports at the end how each family fared."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.agreement.replay import Replay, Verdict, folder
from tests.agreement.rules_of_2022 import WORLD

_report: dict[str, list[Verdict]] = {}


@pytest.fixture(scope="session")
def replays() -> dict[str, list[Verdict]]:
    """Verdicts of all trajectories, by file."""
    for path in sorted(Path(folder()).glob("*.npz")):
        _report[path.stem] = Replay(WORLD, path).run()
    return _report


def pytest_terminal_summary(terminalreporter) -> None:
    if not _report:
        return
    terminalreporter.section(f"agreement with the simulator of 2022 ({folder()})")
    for family, verdicts in _report.items():
        whole = sum(v.whole for v in verdicts)
        lengths = {v.counted for v in verdicts if v.counted < v.recording.length}
        over = f"their first {min(lengths)} sub-steps" if lengths else "their whole length"
        terminalreporter.line(f"{family}: {whole} of {len(verdicts)} agree to 1e-6 over {over}")
        for verdict in verdicts:
            if not verdict.whole:
                terminalreporter.line(f"    {verdict}")
