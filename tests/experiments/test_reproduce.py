"""The reproduction trains what is missing, goes on where it stopped, and names what failed."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from experiments.cells import cell_of, paper_cells
from experiments.config import ScaleConfig
from experiments.entry import compose
from experiments.errors import TrainingError
from experiments.reproduce import ReproduceConfig, quoted, reproduce
from experiments.run_folder import folder_path, is_finished
from tests.synthetic_runs import pretend_to_train, settings

ROOT = Path(__file__).parents[2]
FOUR_CELLS = ScaleConfig(name="smoke", families=("empty",), difficulties=("easy", "hard"), counts=(1, 10))


def asked(root, **changes):
    return ReproduceConfig(run=settings(root, **{"seed": 1, "scale": FOUR_CELLS, **changes}), processes=2)


def train_but_for_one(config):
    """Stands for training that fails in one cell."""
    if cell_of(config).panel == "empty-hard" and config.levels.count == 10:
        print("a last word")
        raise ValueError("the loss is not finite")
    return pretend_to_train(config)


def draw_nothing(config, cells):
    """Stands for the report."""
    return True


def trained(root):
    return sorted((root / "trained").read_text().splitlines())


def test_every_cell_is_trained(tmp_path, capfd):
    reproduce(asked(tmp_path), pretend_to_train, draw_nothing)
    assert trained(tmp_path) == [f"empty-{d} n={n} seed=1" for d in ("easy", "hard") for n in (1, 10)]
    said = capfd.readouterr().out
    assert "4 cells, ppo on state, 200,000 frames each; 0 finished before, 4 to train, 2 at a time." in said
    assert "[1/4]" in said and " left\n" in said
    assert "[4/4]" in said and "all done" in said


def test_finished_cells_are_not_trained_again(tmp_path, capfd):
    pretend_to_train(paper_cells(asked(tmp_path).run)[2])
    reproduce(asked(tmp_path), pretend_to_train, draw_nothing)
    assert len(trained(tmp_path)) == len(set(trained(tmp_path))) == 4
    assert "1 finished before, 3 to train" in capfd.readouterr().out
    reproduce(asked(tmp_path), pretend_to_train, draw_nothing)
    assert len(trained(tmp_path)) == 4
    assert "4 finished before, 0 to train" in capfd.readouterr().out


def test_a_failing_cell_stops_no_other_and_is_named_with_its_log(tmp_path, capfd):
    with pytest.raises(TrainingError) as told:
        reproduce(asked(tmp_path), train_but_for_one, draw_nothing)
    assert len(trained(tmp_path)) == 3
    message = str(told.value)
    assert message.startswith("1 of 4 cells failed:\n  empty-hard n=10 seed=1: ValueError: the loss is not finite")
    assert "the same command trains only what is missing" in message
    log = Path(message.partition("log: ")[2].splitlines()[0])
    assert "a last word" in log.read_text() and "in train_but_for_one" in log.read_text()
    assert "[4/4]" in capfd.readouterr().out


def test_the_report_joins_seeds_names_what_failed_and_says_where_it_is(tmp_path, capfd):
    reproduce(asked(tmp_path, seed=2), pretend_to_train, draw_nothing)
    config = asked(tmp_path)
    with pytest.raises(TrainingError, match="1 of 4 cells failed"):
        reproduce(config, train_but_for_one)
    said = capfd.readouterr().out
    assert "7 of 8 runs are in the report." in said
    assert "missing: empty-hard n=10 seed=1: no run" in said
    for name in ("gap_vs_w2.png", "gap_vs_w2.csv", "report.md"):
        assert str(config.folder / name) in said
        assert (config.folder / name).exists()
    assert f"experiments.dashboard root='{tmp_path}'" in said


def test_a_report_that_cannot_be_made_is_an_error(tmp_path):
    with pytest.raises(TrainingError, match="there is no report: see what it says above"):
        reproduce(asked(tmp_path), pretend_to_train, lambda config, cells: False)


def test_a_killed_reproduction_goes_on_where_it_stopped(tmp_path):
    """Killed while the second cell is at work; started again, it trains all but the first."""
    script = tmp_path / "slowly.py"
    script.write_text(
        "import time\n"
        "from tests.experiments.test_reproduce import *\n"
        "def slowly(config):\n"
        f"    while (Path({str(tmp_path)!r}) / 'trained').exists(): time.sleep(0.1)\n"
        "    return pretend_to_train(config)\n"
        "if __name__ == '__main__':\n"
        f"    config = ReproduceConfig(run=asked(Path({str(tmp_path)!r})).run, processes=1)\n"
        "    reproduce(config, slowly, draw_nothing)\n"
    )
    owner = subprocess.Popen([sys.executable, script], env={**os.environ, "PYTHONPATH": str(ROOT)})
    first, *rest = (folder_path(cell) for cell in paper_cells(asked(tmp_path).run))
    end = time.monotonic() + 30
    while not is_finished(first):
        assert time.monotonic() < end and owner.poll() is None
        time.sleep(0.05)
    owner.send_signal(signal.SIGKILL)
    owner.wait()
    assert not any(is_finished(folder) for folder in rest)
    reproduce(asked(tmp_path), pretend_to_train, draw_nothing)
    assert len(trained(tmp_path)) == len(set(trained(tmp_path))) == 4


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "null"),
        (Path("/a b/it's"), "'/a b/it\\'s'"),
        (("empty", "a=b"), "['empty','a=b']"),
        (range(1, 3), "[1,2]"),
    ],
)
def test_values_are_quoted_for_hydra(value, text):
    assert quoted(value) == text


@pytest.mark.parametrize(
    ("command", "cells", "observation", "algorithm", "frames"),
    [
        (["scale=smoke"], 4, "state", "ppo_fast", 20_000),
        (["scale=quick"], 45, "state", "ppo_fast", 200_000),
        (["scale=standard"], 135, "rgb", "ppo_fast", 250_000),
        (["scale=paper"], 225, "rgb", "ppo", 1_000_000),
        (["scale=paper", "observation=state", "scale.seeds=1"], 45, "state", "ppo", 1_000_000),
    ],
)
def test_a_scale_chooses_the_protocol_and_the_command_line_has_the_last_word(
    command, cells, observation, algorithm, frames
):
    planned = paper_cells(compose([*command, "seed=1"]))
    assert len({cell.label() for cell in planned}) == len(planned) == cells
    (cell,) = {(c.observation.name, c.algorithm.name, c.scale.frames) for c in planned}
    assert cell == (observation, algorithm, frames)
    assert planned[0].seed == planned[0].levels.seed == 1


def test_a_misspelt_setting_is_told_with_the_nearest_right_one():
    command = [sys.executable, "-m", "experiments.reproduce", "scale=smoke", "proceses=1"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr == "error: no setting is called 'proceses'. Did you mean 'processes'?\n"
