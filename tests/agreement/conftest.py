"""Replays every file of recordings once, and reports at the end how each family fared."""

from pathlib import Path

import pytest

from tests.agreement.replay import Verdict, folder, replay
from tests.agreement.rules_of_2022 import world_in
from tests.agreement.summary import lines


@pytest.fixture(scope="session")
def replays() -> dict[str, list[Verdict]]:
    """Verdicts of all trajectories, by file."""
    verdicts = {path.stem: replay(path, world_in) for path in sorted(Path(folder()).glob("*.npz"))}
    rows = [line for family, found in verdicts.items() for line in _report(family, found)]
    lines[:] = [f"agreement with the simulator of 2022 ({folder()})", *rows] if rows else []
    return verdicts


def _report(family: str, verdicts: list[Verdict]) -> list[str]:
    whole = sum(v.whole for v in verdicts)
    lengths = {v.counted for v in verdicts if v.counted < v.recording.length}
    over = f"their first {min(lengths)} sub-steps" if lengths else "their whole length"
    rest = [f"    {verdict}" for verdict in verdicts if not verdict.whole]
    return [f"{family}: {whole} of {len(verdicts)} agree to 1e-6 over {over}", *rest]
