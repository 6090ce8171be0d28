"""Matched sets have the measures that were asked for, as the public measures see them."""

import numpy as np
import pytest

import segar
from segar.errors import LevelError
from segar.metrics import coverage, effective_number, matched_set, w2

TEST_LEVELS = 60


def measured(levels, test):
    return np.array([w2(levels, test), coverage(levels, test).radius, effective_number(levels)])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("family", "wanted"),
    [
        ("empty-medium", (0, 0, 0)),
        ("empty-medium", (3, 3, -2)),
        ("objectsx1-medium", (3, 0, 0)),
        ("hazardtilesx1-medium", (0, 3, -2)),
    ],
)
def test_sets_are_as_far_from_independent_ones_as_wanted(family, wanted):
    dist = segar.family(family)
    test = dist.sample(TEST_LEVELS, seed=0, split="test")
    names = dict(zip(("w2", "radius", "effective_number"), map(float, wanted), strict=True))
    made = matched_set(dist, 10, test=test, seed=3, **names)
    independent = np.array([measured(dist.sample(10, seed=100 + k), test) for k in range(60)])
    shift = (measured(made, test) - independent.mean(axis=0)) / independent.std(axis=0, ddof=1)
    # The means and deviations of two times sixty sets differ by chance, by a fifth of the unit and a tenth of the shift.
    assert np.abs(shift - wanted).max() < 1.5
    assert len(np.unique(made.provenance.indices)) == 10


def test_the_same_request_picks_the_same_levels():
    dist = segar.family("empty-easy")
    test = dist.sample(TEST_LEVELS, seed=0, split="test")
    a, b = (matched_set(dist, 5, test=test, w2=1.0, seed=1, pool=200) for _ in range(2))
    other = matched_set(dist, 5, test=test, w2=1.0, seed=2, pool=200)
    np.testing.assert_array_equal(a.values, b.values)
    assert not np.array_equal(a.values, other.values)


def test_what_cannot_be_had_is_told_with_what_was_reached():
    dist = segar.family("empty-easy")
    test = dist.sample(TEST_LEVELS, seed=0, split="test")
    with pytest.raises(LevelError, match=r"no 5 levels of the pool of 200 .* w2 .* instead of -40\.00"):
        matched_set(dist, 5, test=test, w2=-40.0, pool=200)
    with pytest.raises(LevelError, match="tolerance above 0"):
        matched_set(dist, 5, test=test, tolerance=0.0)
    with pytest.raises(LevelError, match="tolerance must be a finite number of at least 0, not '1'"):
        matched_set(dist, 5, test=test, tolerance="1")  # type: ignore
    with pytest.raises(LevelError, match="effective_number is the same for all sets of 1 levels"):
        matched_set(dist, 1, test=test)
