"""Plan files that others made are data: each is read as it is meant, or refused with its name and what is wrong."""

import numpy as np
import pytest

from segar.hardness.planner import Plan
from tests.crafted import assert_clean_errors, crafted_archives, crafted_metadata, flipped


@pytest.fixture
def saved(tmp_path):
    truths, numbers = np.array([True, False]), np.array([3, 5])
    actions, values = np.zeros((2, 5, 2), np.float32), np.zeros((2, 3, 22))
    Plan(truths, ~truths, numbers, numbers * 0.5, actions, values, "puttputt", 0, 10).save(tmp_path / "plan.npz")
    return tmp_path / "plan.npz"


@pytest.mark.parametrize("crafted", [crafted_archives, crafted_metadata, lambda path: flipped(path, 200)])
def test_a_plan_that_was_changed_is_refused_or_holds_what_was_saved(saved, crafted):
    assert_clean_errors(crafted(saved), saved, lambda: Plan.load(saved), lambda found: found.steps.tolist() == [3, 5])
