"""Textures from filters: reading banks, clusters, alignment, patterns."""

import importlib.util

import numpy as np
import pytest
from safetensors.numpy import save_file

import segar
from segar.noise import UniformNoise
from segar.textures import UNIFORM, FilterBank, filter_textures, linear_read_out
from segar.textures.filter_clusters import aligned, cluster_costs, cluster_filters, filter_patterns


def built_in(seed: int = 0, **options) -> FilterBank:
    return FilterBank.built_in(np.random.default_rng(seed), **options)


def weights_of_a_network() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    shapes = {"first.weight": (32, 3, 3, 3), "first.bias": (32,), "second": (64, 32, 3, 3), "head.weight": (10, 64)}
    return {name: rng.normal(size=shape).astype(np.float32) for name, shape in shapes.items()}


def save(path, arrays):
    if path.suffix == ".npz":
        np.savez(path, **arrays)
    else:
        save_file(arrays, path)


@pytest.mark.parametrize("suffix", [".npz", ".safetensors"])
def test_the_first_convolution_is_found_among_the_weights_of_a_network(tmp_path, suffix):
    weights = weights_of_a_network()
    save(tmp_path / f"net{suffix}", weights)
    bank = FilterBank.load(tmp_path / f"net{suffix}")
    np.testing.assert_array_equal(bank.filters, weights["first.weight"])
    assert (bank.name, len(bank), bank.size) == ("net", 32, 3)


def test_filters_of_keras_have_their_channels_moved(tmp_path):
    filters = np.random.default_rng(0).normal(size=(3, 3, 3, 32)).astype(np.float32)
    np.savez(tmp_path / "net.npz", kernel=filters)
    np.testing.assert_array_equal(FilterBank.load(tmp_path / "net.npz").filters[5, 1], filters[:, :, 1, 5])


@pytest.mark.parametrize("suffix", [".npz", ".safetensors"])
def test_of_several_first_convolutions_one_is_named(tmp_path, suffix):
    weights = weights_of_a_network() | {"other.weight": np.ones((8, 3, 7, 7), np.float32)}
    save(tmp_path / f"net{suffix}", weights)
    with pytest.raises(segar.SegarError, match=r"has 2 arrays .*'first.weight'.*: name one with key="):
        FilterBank.load(tmp_path / f"net{suffix}")
    assert FilterBank.load(tmp_path / f"net{suffix}", key="other.weight").size == 7
    with pytest.raises(segar.SegarError, match=r"has no filters 'head.weight'"):
        FilterBank.load(tmp_path / f"net{suffix}", key="head.weight")


def test_files_without_filters_are_refused(tmp_path):
    np.savez(tmp_path / "net.npz", weight=np.ones((10, 10)))
    with pytest.raises(segar.SegarError, match=r"has no arrays of shape .*: is it an image network"):
        FilterBank.load(tmp_path / "net.npz")
    with pytest.raises(segar.SegarError, match="there is no file of weights"):
        FilterBank.load(tmp_path / "nothing.npz")
    with pytest.raises(segar.SegarError, match=r"must end in \.npz or \.safetensors"):
        FilterBank.load(tmp_path / "net.pth")
    for name in ("bad.npz", "bad.safetensors"):
        (tmp_path / name).write_bytes(b"no such thing")
        with pytest.raises(segar.SegarError, match=r"cannot be read as|is not a file of weights"):
            FilterBank.load(tmp_path / name)


def test_without_its_package_safetensors_says_which_extra_to_install(tmp_path, monkeypatch):
    save(tmp_path / "net.safetensors", weights_of_a_network())
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(segar.SegarError, match=r"needs safetensors.*pip install 'segar\[filters\]'"):
        FilterBank.load(tmp_path / "net.safetensors")


def test_filters_of_another_shape_are_refused():
    with pytest.raises(segar.SegarError, match=r"must have the shape \[filter, 3, k, k\], not \[4, 1, 3, 3\]"):
        FilterBank("grey", np.ones((4, 1, 3, 3)))
    with pytest.raises(segar.SegarError, match="filters that are 0 everywhere"):
        FilterBank("dead", np.zeros((4, 3, 3, 3)))


def test_the_built_in_bank_follows_from_its_seed_and_has_all_orientations():
    np.testing.assert_array_equal(built_in().filters, built_in().filters)
    assert not np.allclose(built_in().filters, built_in(1).filters)
    bank = built_in(count=300, size=9)
    grey = bank.filters.mean(axis=1)
    grey = grey - grey.mean(axis=(1, 2), keepdims=True)
    dy, dx = np.gradient(grey, axis=(1, 2))
    angle = 0.5 * np.arctan2(2 * (dx * dy).sum((1, 2)), (dx**2 - dy**2).sum((1, 2))) % np.pi
    counts, _ = np.histogram(angle, bins=6, range=(0, np.pi))
    assert counts.min() > 300 / 6 / 3


def test_clusters_share_the_bank_out_and_keep_like_with_like():
    bank = built_in()
    clusters = cluster_filters(bank, 14, np.random.default_rng(0))
    assert sum(len(clusters.members(k)) for k in range(14)) == len(bank)

    def spread(labels: np.ndarray) -> float:
        return sum(np.var(clusters.filters[labels == k], axis=0).sum() * (labels == k).sum() for k in range(14))

    assert spread(clusters.labels) < 0.75 * spread(np.random.default_rng(1).permutation(clusters.labels))


def test_more_inputs_than_filters_are_refused():
    with pytest.raises(segar.SegarError, match="cannot be dealt into 14 clusters; take a larger bank"):
        cluster_filters(built_in(count=10), 14, np.random.default_rng(0))
    with pytest.raises(segar.SegarError, match="too many of its filters are alike"):
        cluster_filters(FilterBank("same", np.ones((20, 3, 3, 3))), 14, np.random.default_rng(0))


def test_aligned_clusters_are_nearer_than_in_any_other_order():
    baseline = cluster_filters(built_in(), 6, np.random.default_rng(0))
    other = aligned(cluster_filters(built_in(1), 6, np.random.default_rng(1)), baseline)
    rng = np.random.default_rng(2)
    least = np.trace(cluster_costs(baseline, other))
    assert all(
        np.trace(cluster_costs(baseline, other.reordered(rng.permutation(6)))) >= least - 1e-12 for _ in range(20)
    )


def test_patterns_but_for_their_colours_are_orthogonal_and_all_as_strong():
    patterns = filter_patterns(cluster_filters(built_in(), 14, np.random.default_rng(0)), np.random.default_rng(1))
    assert patterns.shape == (14, 8, 8, 3)
    np.testing.assert_allclose((patterns**2).mean(axis=(1, 2, 3)), 1.0)
    waves = (patterns - patterns.mean(axis=(1, 2), keepdims=True)).reshape(14, -1)
    products = waves @ waves.T
    np.testing.assert_allclose(products - np.diag(np.diag(products)), 0.0, atol=1e-9)


@pytest.mark.parametrize("size", [3, 7, 11])
def test_filters_of_any_network_show_all_factors(size):
    rng = np.random.default_rng(size)
    bank = FilterBank("net", rng.normal(size=(64, 3, size, size)))
    textures = filter_textures("mine", bank, seeds=(s for s in (0, 1)))
    assert len(textures) == 2 and textures.origin["seeds"] == [0, 1]
    for model in range(2):
        read = linear_read_out(textures, model, rng=np.random.default_rng(0))
        assert min(share for name, share in read.items() if "noise" not in name) > 0.9


def test_a_set_can_show_factors_of_ones_own():
    laws = UNIFORM | {"Temperature": UniformNoise(0.0, 300.0)}
    textures = filter_textures("mine", built_in(), inputs=("background", "Temperature", "Mass"), laws=laws)
    assert linear_read_out(textures, rng=np.random.default_rng(0), laws=laws)["Temperature"] > 0.95
    with pytest.raises(segar.SegarError, match="no distribution says how much the input 'Temperature' varies"):
        filter_textures("mine", built_in(), inputs=("background", "Temperature"))
