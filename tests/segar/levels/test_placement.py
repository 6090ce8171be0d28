"""Moving things apart: distributions over random scenes."""

import numpy as np
import pytest

from segar.levels.sampling.placement import closest_pair, fix_overlaps, too_close


def scene(rng: np.random.Generator, n: int, things: int, radius: float) -> dict[str, np.ndarray]:
    """Discs of one radius, some of them not solid, some absent."""
    position = rng.uniform(-1.2, 1.2, (n, things, 2))
    position[rng.random((n, things)) < 0.2] = np.nan
    extent = np.full((n, things, 2), radius)
    solid = (rng.random((n, things)) < 0.7) & ~np.isnan(position[..., 0])
    return {"position": position, "low": -extent, "high": extent, "radius": extent[..., 0], "solid": solid}


@pytest.mark.parametrize(("things", "radius"), [(2, 0.3), (5, 0.15), (12, 0.1)])
def test_afterwards_nothing_overlaps_and_all_are_inside(things, radius):
    parts = scene(np.random.default_rng(things), 300, things, radius)
    fixed, stuck = fix_overlaps(**parts)
    assert not len(stuck)
    assert np.nanmax(np.abs(fixed)) <= 1 - radius - 1e-5 + 1e-12
    solid = np.where(parts["solid"][..., None], fixed, np.nan)
    assert not too_close(solid, 2 * radius + 1e-7).any()


def test_fixing_twice_changes_nothing():
    parts = scene(np.random.default_rng(0), 200, 6, 0.15)
    once, _ = fix_overlaps(**parts)
    twice, _ = fix_overlaps(**parts | {"position": once})
    assert np.array_equal(once, twice, equal_nan=True)


def test_a_level_is_fixed_the_same_way_alone_and_among_others():
    parts = scene(np.random.default_rng(1), 100, 8, 0.15)
    together, _ = fix_overlaps(**parts)
    for i in (0, 17, 99):
        alone, _ = fix_overlaps(**{name: array[i : i + 1] for name, array in parts.items()})
        assert alone.tobytes() == together[i : i + 1].tobytes()


def test_the_input_is_left_alone_and_absent_things_stay_absent():
    parts = scene(np.random.default_rng(2), 50, 5, 0.2)
    before = parts["position"].copy()
    fixed, _ = fix_overlaps(**parts)
    assert np.array_equal(parts["position"], before, equal_nan=True)
    assert np.array_equal(np.isnan(fixed), np.isnan(before))


def test_mirrored_scenes_are_fixed_in_mirrored_ways():
    parts = scene(np.random.default_rng(3), 100, 4, 0.2)
    plain, _ = fix_overlaps(**parts)
    mirrored, _ = fix_overlaps(**parts | {"position": -parts["position"]})
    assert np.allclose(mirrored, -plain, equal_nan=True, atol=1e-12)


def test_what_cannot_fit_is_reported_and_the_rest_is_fixed():
    position = np.zeros((3, 2, 2))
    extent = np.full((3, 2, 2), 0.1)
    extent[1] = 0.9  # two discs that wide do not fit beside each other
    extent[2, 0] = 1.1  # wider than the arena
    fixed, stuck = fix_overlaps(position, -extent, extent, extent[..., 0], np.ones((3, 2), dtype=bool))
    assert stuck.tolist() == [1, 2]
    assert np.ptp(fixed[0, :, 0]) == pytest.approx(0.2, abs=2e-6)


def test_the_closest_pair_is_found_among_those_present():
    position = np.array([[0.0, 0.0], [np.nan, np.nan], [0.3, 0.0], [0.0, 0.25]])
    assert closest_pair(position) == (0, 3, 0.25)
