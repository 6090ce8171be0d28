"""Texture files that others made are data: each is read as it is meant, or refused with its name and what is wrong."""

import numpy as np
import pytest

from segar.textures import FilterBank, TextureSet
from tests.crafted import assert_clean_errors, crafted_archives, crafted_metadata, flipped


@pytest.fixture
def saved(tmp_path):
    rng = np.random.default_rng(0)
    weights, bias = rng.normal(size=(2, 2, 3, 3, 3)), rng.normal(size=(2, 3, 3, 3))
    made = TextureSet("own", ("background", "Mass"), weights, bias, np.array([0.0, 1.0]), np.ones(2))
    made.save(tmp_path / "own.npz")
    return tmp_path / "own.npz"


def test_a_texture_file_that_was_spoilt_is_refused(saved):
    assert_clean_errors(crafted_archives(saved), saved, lambda: TextureSet.load(saved))


def test_a_texture_file_with_another_description_is_refused_or_used(saved):
    assert_clean_errors(
        (file for file in crafted_metadata(saved) if "metadata name" not in file[0]),
        saved,
        lambda: TextureSet.load(saved),
        lambda found: found.patches(np.zeros((1, 2))).shape == (1, 3, 3, 3),
    )


def test_changed_bytes_of_a_texture_file_are_found_or_change_nothing(saved):
    whole = TextureSet.load(saved)
    assert_clean_errors(
        flipped(saved, 200), saved, lambda: TextureSet.load(saved), lambda found: np.array_equal(found.bias, whole.bias)
    )


def test_a_file_of_weights_that_was_spoilt_is_refused_or_gives_its_filters(tmp_path):
    path, filters = tmp_path / "net.npz", np.random.default_rng(0).normal(size=(4, 3, 5, 5))
    np.savez_compressed(path, weight=filters)
    assert_clean_errors(
        crafted_archives(path), path, lambda: FilterBank.load(path), lambda found: found.filters.shape == (4, 3, 5, 5)
    )
