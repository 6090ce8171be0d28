"""Power: the numbers of EXPERIMENTS.md, 6.1, again; and the size of tests where there is nothing."""

import numpy as np
import pytest

from analysis.stats.power import critical_r, points_needed, power_of_design
from segar.errors import SegarError
from tests.analysis.grids import grid


def powers(table, **options):
    found = power_of_design(table, "w2", np.random.default_rng(1), **options)
    return found[found["alpha"] == 0.05].set_index("test")["estimate"]


@pytest.mark.parametrize(("rho", "eighty", "ninety"), [(0.3, 85, 113), (0.5, 30, 38), (0.7, 14, 17), (0.9, 7, 8)])
def test_points_needed(rho, eighty, ninety):
    assert abs(points_needed(rho) - eighty) <= 1 and abs(points_needed(rho, 0.9) - ninety) <= 1
    assert points_needed(-rho) == points_needed(rho)


@pytest.mark.parametrize(("n", "r"), [(5, 0.878), (10, 0.632), (15, 0.514), (45, 0.294), (135, 0.169)])
def test_critical_r(n, r):
    assert critical_r(n) == pytest.approx(r, abs=6e-4)


def test_the_paper_s_design():
    """45 runs: the pooled test finds r = -0.6 always, the panels by themselves hardly ever."""
    power = powers(grid(np.random.default_rng(0)), replicates=1000)
    assert power["pooled"] > 0.99
    assert power["given panel"] == pytest.approx(0.97, abs=0.03)
    assert power["given panel and log n"] == pytest.approx(0.30, abs=0.12)
    assert power["within"] == pytest.approx(0.17, abs=0.05)
    assert power["within, Holm"] < power["within"]


def test_more_seeds_find_more():
    few, many = (powers(grid(np.random.default_rng(0), seeds), replicates=300) for seeds in (1, 5))
    assert many["given panel and log n"] > few["given panel and log n"] + 0.3
    assert many["within"] == pytest.approx(0.65, abs=0.08)


def test_where_there_is_nothing_power_is_the_size():
    found = powers(grid(np.random.default_rng(0), 3), pooled_r=0.0, replicates=2000)
    for test in ("pooled", "given panel", "given panel and log n", "within"):
        assert found[test] == pytest.approx(0.05, abs=0.016), test


def test_shared_noise_breaks_the_promise_of_the_pooled_test():
    """W2 differs between panels, and so does shared noise: the pooled test takes one for the other."""
    table = grid(np.random.default_rng(0), 3)
    found = powers(table, pooled_r=0.0, cluster=("family", "difficulty"), cluster_share=0.5, replicates=500)
    assert found["pooled"] > 0.2 and found["given panel"] == pytest.approx(0.05, abs=0.03)


def test_a_design_without_variation_says_so():
    with pytest.raises(SegarError, match="does not vary"):
        power_of_design(grid(np.random.default_rng(0)).assign(w2=1.0), "w2", np.random.default_rng(0))
