"""Run folders become rows; what has no row is named."""

import numpy as np
import pandas as pd
import pytest

from analysis.tables import Grid, find_runs, missing_cells, performance, read_runs
from experiments.cells import Cell, cell_config
from tests.synthetic_runs import settings, write_grid, write_run


def test_one_row_per_run_and_action_mode(tmp_path):
    write_grid(settings(tmp_path))
    runs, unreadable = find_runs(tmp_path)
    table, missing = read_runs(runs)
    assert (len(table), missing, unreadable) == (2 * 2 * 2 * 3, [], {})
    assert not table.duplicated(["family", "difficulty", "n", "seed", "action_mode"]).any()
    assert table["w2_exact"].to_numpy() == pytest.approx(2 * table["w2_reference"])
    assert set(table["frames"]) == {200_000}


def test_the_row_says_what_the_run_was_and_did(tmp_path):
    cell = Cell("tilesx1", "hard", 50, 7)
    folder = write_run(cell_config(settings(tmp_path), cell), gap=-1.5, w2=0.25)
    table, _ = read_runs(find_runs(tmp_path)[0])
    row = table.set_index("action_mode").loc["deterministic"]
    assert (row["family"], row["difficulty"], row["n"], row["seed"], row["run"]) == (
        "tilesx1",
        "hard",
        50,
        7,
        folder.name,
    )
    assert (row["eta_train"], row["eta_test"], row["gap"]) == pytest.approx((-2.0, -3.5, -1.5))
    assert (row["w2_reference"], row["success_test"], row["death_test"]) == pytest.approx((0.25, 0.75, 0.0))
    assert table.set_index("action_mode").loc["sampled", "eta_test"] == pytest.approx(-4.0)


def episodes(**columns):
    """Evaluation episodes with two returns on each of the training levels 0 and 1, one on each test level."""
    returns = columns.pop("train", [1.0, 1, 3, 3]), columns.pop("test", [0.0, 2, 4])
    frame = pd.DataFrame({"return": [*returns[0], *returns[1]]})
    frame["levels"] = ["train"] * len(returns[0]) + ["test"] * len(returns[1])
    frame["level"] = [i // 2 for i in range(len(returns[0]))] + list(range(len(returns[1])))
    return frame.assign(
        action_mode=columns.get("mode", "deterministic"),
        return_ref=frame["return"] + 1,
        success=True,
        death=False,
        length=5,
    )


def test_training_levels_are_no_sample_and_test_levels_are():
    found = performance(episodes())
    assert (found["eta_train"], found["se_train"]) == (2, 0)  # repeats agree, and there are no other training levels
    assert (found["eta_test"], found["se_test"]) == pytest.approx((2, 2 / np.sqrt(3)))
    assert found["gap_se"] == pytest.approx(found["se_test"])


def test_repeated_episodes_on_a_level_show_their_error():
    found = performance(episodes(train=[0.0, 2, 4, 6], mode="sampled"))
    assert found["se_train"] == pytest.approx(np.sqrt(2 / 2 + 2 / 2) / 2)


def test_the_2022_gap_leaves_the_last_reward_out():
    frame = episodes()
    frame.loc[frame["levels"] == "test", "return_ref"] += 5
    assert performance(frame)["gap_ref"] == pytest.approx(performance(frame)["gap"] + 5)


def test_missing_and_unfinished_cells_are_named(tmp_path):
    config = settings(tmp_path)
    write_run(cell_config(config, Cell("empty", "easy", 1, 0)))
    unfinished = write_run(cell_config(config, Cell("empty", "easy", 10, 0)), finished=False)
    table, known = read_runs(find_runs(tmp_path)[0])
    missing = missing_cells(table, Grid(["empty"], ["easy"], [1, 10, 50], [0]), known)
    assert [(one.cell.count, one.reason) for one in missing] == [
        (10, f"not finished ({unfinished.name})"),
        (50, "no run"),
    ]


def test_a_damaged_run_is_named_and_the_others_are_read(tmp_path):
    config = settings(tmp_path)
    write_run(cell_config(config, Cell("empty", "easy", 1, 0)))
    broken = write_run(cell_config(config, Cell("empty", "easy", 10, 0)))
    (broken / "episodes.parquet").write_bytes(b"half a file")
    table, missing = read_runs(find_runs(tmp_path)[0])
    assert set(table["n"]) == {1}
    assert [one.cell.count for one in missing] == [10]
    assert missing[0].reason.startswith(f"not readable ({broken.name}): ArrowInvalid")


def test_settings_that_cannot_be_read_are_told_apart(tmp_path):
    write_run(settings(tmp_path))
    (tmp_path / "odd").mkdir()
    (tmp_path / "odd" / "config.yaml").write_text("levls: {}\n")
    (tmp_path / "no run at all").mkdir()
    runs, unreadable = find_runs(tmp_path)
    assert len(runs) == 1
    assert [path.name for path in unreadable] == ["odd"]
    assert "Did you mean 'levels'?" in unreadable[tmp_path / "odd"]
