"""Counted randomness: the published test vectors, independence of company and order, and soundness of the laws."""

import numpy as np
import pytest
from scipy import stats

from segar.errors import PriorError
from segar.support.counter_rng import LevelGenerator, philox, stream_key

# Random123's known answers for Philox4x32-10: counter, key (low word first), output.
KNOWN_ANSWERS = [
    ((0, 0, 0, 0), 0, (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    ((0xFFFFFFFF,) * 4, 2**64 - 1, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
        0x299F31D0A4093822,
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
]


@pytest.mark.parametrize(("counter", "key", "answer"), KNOWN_ANSWERS)
def test_philox_gives_the_published_answers(counter, key, answer):
    words = philox([np.array([word], dtype=np.uint64) for word in counter], key)
    assert tuple(int(word[0]) for word in words) == answer


def test_a_level_draws_the_same_in_any_company():
    alone = LevelGenerator(7, np.array([41]))
    among = LevelGenerator(7, np.arange(100))
    for draw in (
        lambda rng, n: rng.random(n),
        lambda rng, n: rng.normal(0, 1, (n, 5)),
        lambda rng, n: rng.integers(1, 6, size=n, endpoint=True),
        lambda rng, n: rng.choice([2.0, 3.0, 5.0], size=n, p=[0.2, 0.3, 0.5]),
    ):
        assert np.array_equal(draw(alone, 1)[0], draw(among, 100)[41])


def test_levels_beyond_four_billion_do_not_repeat_the_first():
    low, high = LevelGenerator(7, np.array([3])), LevelGenerator(7, np.array([3 + 2**32]))
    assert low.random(1) != high.random(1)


def test_uniforms_fill_the_unit_interval_evenly():
    u = LevelGenerator(stream_key("a", 1), np.arange(200_000)).random(200_000)
    assert u.min() >= 0 and u.max() < 1
    assert stats.kstest(u, "uniform").pvalue > 1e-3


def test_normals_are_gaussian_and_finite():
    z = LevelGenerator(stream_key("b", 1), np.arange(1000)).standard_normal((1000, 200)).ravel()
    assert np.isfinite(z).all()
    assert stats.kstest(z, "norm").pvalue > 1e-3


@pytest.mark.parametrize(
    "other",
    [
        LevelGenerator(stream_key("d", 0, "train", "golfball", "Mass"), np.arange(50_000)),
        LevelGenerator(stream_key("d", 1, "train", "golfball", "Position"), np.arange(50_000)),
        LevelGenerator(stream_key("d", 0, "test", "golfball", "Position"), np.arange(50_000)),
        LevelGenerator(stream_key("d", 0, "train", "golfball", "Position"), np.arange(50_000), attempt=1),
        LevelGenerator(stream_key("d", 0, "train", "golfball", "Position"), np.arange(1, 50_001)),
    ],
    ids=["another factor", "another seed", "another split", "another attempt", "the next level"],
)
def test_streams_do_not_know_each_other(other):
    u = LevelGenerator(stream_key("d", 0, "train", "golfball", "Position"), np.arange(50_000)).random(50_000)
    v = other.random(50_000)
    cells = np.histogram2d(u, v, bins=20, range=[[0, 1], [0, 1]])[0]
    assert stats.chisquare(cells.ravel()).pvalue > 1e-3


def test_successive_calls_continue_the_stream():
    parts = LevelGenerator(3, np.arange(5))
    first, second = parts.random((5, 2)), parts.random((5, 4))
    assert np.array_equal(np.hstack([first, second]), LevelGenerator(3, np.arange(5)).random((5, 6)))


def test_integers_reach_both_ends_equally():
    draws = LevelGenerator(4, np.arange(60_000)).integers(1, 6, size=60_000, endpoint=True)
    assert stats.chisquare(np.bincount(draws, minlength=7)[1:]).pvalue > 1e-3


def test_an_unknown_method_says_what_to_do_instead():
    with pytest.raises(PriorError, match=r"no method 'gamma'.*distribution\.icdf\(rng\.random\(size\)\)"):
        LevelGenerator(0, np.arange(3)).gamma(2.0, size=3)


def test_a_size_that_does_not_begin_with_the_levels_is_refused():
    with pytest.raises(PriorError, match=r"size must be 3 or \(3, \.\.\.\), not 4"):
        LevelGenerator(0, np.arange(3)).random(4)


def test_every_bit_of_the_uniforms_is_fair():
    u = LevelGenerator(9, np.arange(50_000)).random(50_000)
    whole = (u * 2**53).astype(np.uint64)
    ones = np.array([((whole >> np.uint64(bit)) & np.uint64(1)).mean() for bit in range(53)])
    assert np.abs(ones - 0.5).max() < 5 * 0.5 / np.sqrt(50_000)
