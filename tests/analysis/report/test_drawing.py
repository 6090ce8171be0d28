"""Intervals in figures, and points within axes."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from segar.analysis.report.claims.rows import ACCURACIES
from segar.analysis.report.figures.agents import accuracy_grid
from segar.analysis.stats.estimate import mean_of_replicates
from segar.analysis.stats.resampling import mean_of_units
from tests.synthetic_results import evidence_of, run_rows


@pytest.mark.parametrize("seed", range(5))
def test_the_interval_of_a_share_is_student_s_within_what_a_share_can_be(seed):
    for n, least in ((3, 0.0), (20, 0.0), (3, -1.0)):
        values = np.random.default_rng([seed, n]).uniform(least, 1, n)
        found, whole = mean_of_units(values, "runs", least, 1.0), mean_of_replicates(values)
        assert found.estimate == whole.estimate
        assert (found.low, found.high) == (max(whole.low, least), min(whole.high, 1.0))


def test_points_of_all_rows_lie_within_axes_that_share_their_limits(tmp_path):
    """Each row has accuracies and gaps of its own, and lines, which leave the limits alone."""
    rng, rows = np.random.default_rng(0), []
    for accuracy, gap in ((0.97, -1.0), (0.93, 4.0)):
        runs = run_rows(rng, "appendix_mass", families=("empty",), difficulties=("medium",), counts=(10, 25), seeds=10)
        near = {name: accuracy + 0.01 * rng.normal(size=len(runs)) for name in ACCURACIES}
        rows.append([("a title", runs.assign(**near, gap=gap + rng.normal(size=len(runs))), "gap")])
    evidence = evidence_of(tmp_path, {"runs": run_rows(rng, "appendix_mass")})
    figure = accuracy_grid(evidence, rows)
    figure.draw_without_rendering()
    for axes in figure.axes:
        assert len(axes.lines) == 2
        for points in axes.collections:
            low, high = np.transpose([axes.get_xlim(), axes.get_ylim()])
            assert ((low < points.get_offsets()) & (points.get_offsets() < high)).all()
    plt.close(figure)
