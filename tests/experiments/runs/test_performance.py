"""What the episodes of a run say of it."""

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

from segar.experiments.runs.performance import performance


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


def figures(frame):
    """The performance of the frame's only action mode, without its name."""
    mode = frame["action_mode"].iloc[0]
    found = performance(pa.Table.from_pandas(frame, preserve_index=False))
    return {name.removesuffix(f"_{mode}"): value for name, value in found.items()}


def test_training_levels_are_no_sample_and_test_levels_are():
    found = figures(episodes())
    assert (found["eta_train"], found["se_train"]) == (2, 0)  # repeats agree, and there are no other training levels
    assert (found["eta_test"], found["se_test"]) == pytest.approx((2, 2 / np.sqrt(3)))
    assert found["gap_se"] == pytest.approx(found["se_test"])


def test_repeated_episodes_on_a_level_show_their_error():
    found = figures(episodes(train=[0.0, 2, 4, 6], mode="sampled"))
    assert found["se_train"] == pytest.approx(np.sqrt(2 / 2 + 2 / 2) / 2)


def test_the_2022_gap_leaves_the_last_reward_out():
    frame = episodes()
    frame.loc[frame["levels"] == "test", "return_ref"] += 5
    assert figures(frame)["gap_ref"] == pytest.approx(figures(frame)["gap"] + 5)


def test_a_mode_without_episodes_on_both_level_sets_has_no_performance():
    frame = episodes()
    assert performance(pa.Table.from_pandas(frame[frame["levels"] == "train"], preserve_index=False)) == {}


def test_each_trial_has_the_share_of_levels_that_it_solves():
    frame = episodes(train=[1.0, 1, 3, 3], test=[0.0, 2]).assign(trial=[0, 1, 0, 1, 0, 1])
    found = figures(frame.assign(success=[False, True, False, True, False, True]))
    assert (found["success_trial_0_test"], found["success_trial_1_train"]) == (0, 1)
    assert "success_trial_0_test" not in figures(frame.assign(trial=0))
