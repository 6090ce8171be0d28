"""Intervals in figures."""

import numpy as np
import pytest

from segar.analysis.stats.estimate import mean_of_replicates
from segar.analysis.stats.resampling import mean_of_units


@pytest.mark.parametrize("seed", range(5))
def test_the_interval_of_a_share_is_student_s_within_what_a_share_can_be(seed):
    for n, least in ((3, 0.0), (20, 0.0), (3, -1.0)):
        values = np.random.default_rng([seed, n]).uniform(least, 1, n)
        found, whole = mean_of_units(values, "runs", least, 1.0), mean_of_replicates(values)
        assert found.estimate == whole.estimate
        assert (found.low, found.high) == (max(whole.low, least), min(whole.high, 1.0))
