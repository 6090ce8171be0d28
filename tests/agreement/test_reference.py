"""The engine, with the rules of 2022 where ours are mended, replays the trajectories that the 2022 simulator left."""

import numpy as np
import pytest

from segar import Interpreter, Velocity
from tests.agreement.replay import LAYOUT, folder, levels_of, push, recordings
from tests.agreement.rules_of_2022 import world_in

FILES = sorted(folder().glob("*.npz"))


def test_there_are_recordings():
    assert FILES, f"no recordings in {folder()}: set SEGAR_REFERENCE_DIR to a folder that has some"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_trajectory_agrees_over_its_first_150_sub_steps(path, replays):
    early = [str(v) for v in replays[path.stem] if v.agrees < v.required]
    assert not early, "\n".join(early)


def test_95_percent_of_the_trajectories_agree_over_their_whole_length(replays):
    verdicts = [v for family in replays.values() for v in family]
    assert np.mean([v.whole for v in verdicts]) >= 0.95, "\n".join(str(v) for v in verdicts if not v.whole)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_trajectories_go_on_where_the_2022_simulator_raised(path, replays):
    assert all(v.finite for v in replays[path.stem])


def test_the_interpreter_replays_them_too():
    """The other implementation of the rules, on the first 25 sub-steps of each file's first trajectory."""
    for path in FILES:
        first = recordings(path)[:1]
        interpreter = Interpreter(world_in(first[0].walls), LAYOUT)
        levels = levels_of(first)
        values = levels.values[0].copy()
        for step in range(min(first[0].length, 25)):
            if step % 5 == 0:
                push(first[0], values, step // 5)
            values = interpreter.step(levels, 0, values).values
        for name, column in (("pos", 0), ("vel", LAYOUT.columns[Velocity])):
            theirs = first[0].arrays[name][min(first[0].length, 25)][first[0].slots]
            ours = values[: len(theirs), column : column + 2]
            np.testing.assert_allclose(ours, np.where(np.isnan(ours), np.nan, theirs), atol=1e-6)
