"""Information from neighbours: closed forms, scikit-learn's answers, and nothing where there is nothing."""

import numpy as np
import pytest
from scipy import stats
from sklearn.feature_selection import mutual_info_regression

from segar.analysis.probes.nearest import ksg, ksg_estimate
from segar.errors import SegarError


def rng(seed=0):
    return np.random.default_rng(seed)


def gaussians(r, size, n=3000, seed=0):
    z = rng(seed).normal(size=(n, size))
    return r * z + np.sqrt(1 - r * r) * rng(seed + 1000).normal(size=(n, size)), z


def gaussian_information(r):
    """-log(1 - r²) / 2: the information of two Gaussians with that correlation [nats]."""
    return -0.5 * np.log1p(-(r**2))


@pytest.mark.parametrize("size", [1, 2])
@pytest.mark.parametrize("r", [0.6, 0.9, 0.99])
def test_gaussians_have_the_information_that_the_formula_says(r, size):
    found, said = [], []
    for seed in range(4):
        x, z = gaussians(r, size, seed=seed)
        found.append(ksg(x, z))
        # Of the correlations that the samples have, so that only the estimator errs.
        said.append(sum(gaussian_information(np.corrcoef(x[:, k], z[:, k])[0, 1]) for k in range(size)))
    assert np.mean(found) == pytest.approx(np.mean(said), rel=0.05)


def test_it_is_scikit_learns_in_one_dimension():
    x, z = gaussians(0.7, 1, n=2000)
    expected = mutual_info_regression(x, z[:, 0], n_neighbors=3, random_state=0)[0]
    assert ksg(x / x.std(), z / z.std()) == pytest.approx(expected, abs=1e-3)


def test_bent_scales_change_little_and_order_nothing():
    x, z = gaussians(0.9, 1, n=4000)
    assert ksg(np.exp(x), z**3) == pytest.approx(ksg(x, z), rel=0.05)
    order = rng().permutation(4000)
    assert ksg(x[order], z[order]) == pytest.approx(ksg(x, z), rel=1e-12)


def test_whole_numbers_share_their_entropy():
    z = rng().integers(0, 4, 3000)
    assert ksg(z, z) == pytest.approx(stats.entropy(np.bincount(z)), abs=0.01)


def test_the_interval_holds_and_frames_of_an_episode_are_no_witnesses():
    held, found = 0, []
    for seed in range(40):
        x, z = gaussians(0.0, 1, n=200, seed=seed)
        group = np.repeat(np.arange(200), 10)
        estimate = ksg_estimate(x[group] + 1e-3 * rng(seed).normal(size=(2000, 1)), z[group], rng(seed), group)
        held += estimate.low < 0 < estimate.high
        found.append(estimate.p < 0.05)
    assert held / 40 > 0.8 and np.mean(found) < 0.2


def test_too_few_points_say_so():
    with pytest.raises(SegarError, match="more than 3"):
        ksg(np.zeros(3), np.zeros(3))
    assert "100 episodes" in ksg_estimate(np.arange(9.0), np.arange(9.0), rng(), np.arange(9)).note
