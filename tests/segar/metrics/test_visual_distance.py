"""Distances between renderers: metrics in the space of weights and of what is seen, with floors and errors."""

import numpy as np
import pytest

import segar
from segar.metrics import clustering_w2, visual_distance, visual_w2
from segar.metrics.visual import _frechet
from segar.textures import FilterBank, TextureSet, product_of_marginals
from segar.textures.filter_clusters import cluster_filters

A, B = TextureSet.load("one"), TextureSet.load("five")[0]
MEASURES = ("paired", "frechet", "mmd")


def measured(a, b, seed=0, **options):
    return visual_distance(a, b, rng=np.random.default_rng(seed), **({"samples": 100, "resamples": 10} | options))


def test_close_variants_are_nearer_to_the_baseline_than_far_ones_in_weights():
    baseline, close, far = (TextureSet.load(name) for name in ("baseline", "close", "far"))
    nearest = max(visual_w2(baseline, close[model]) for model in range(len(close)))
    farthest = min(visual_w2(baseline, far[model]) for model in range(len(far)))
    assert nearest < 0.6 * farthest


@pytest.mark.parametrize("embedding", ["pixels", "filters"])
def test_each_close_variant_is_nearer_to_the_baseline_than_each_far_one_in_what_is_seen(embedding):
    seen = {
        name: [measured("baseline", model, samples=60, embedding=embedding) for model in models_of(name)]
        for name in ("close", "far")
    }
    for measure in MEASURES:
        close, far = ([getattr(one, measure) for one in seen[name]] for name in ("close", "far"))
        assert max(near.value + near.standard_error for near in close) < min(
            away.value - away.standard_error for away in far
        ), measure
        assert all(away.value > 2 * away.floor for away in far), measure


def models_of(name: str) -> list[TextureSet]:
    textures = TextureSet.load(name)
    return [textures[model] for model in range(0, len(textures), 2)]


@pytest.mark.parametrize("aligned", [False, True])
def test_a_renderer_is_at_no_distance_from_itself_and_distances_are_symmetric_in_weights(aligned):
    assert visual_w2("five", "five", aligned=aligned) == pytest.approx(0.0, abs=1e-6)
    assert visual_w2(A, B, aligned=aligned) == pytest.approx(visual_w2(B, A, aligned=aligned))
    assert visual_w2(A, B, aligned=aligned) > 0.5


@pytest.mark.parametrize("embedding", ["pixels", "filters"])
def test_a_renderer_is_at_no_distance_from_itself_and_distances_are_symmetric_in_what_is_seen(embedding):
    itself, there, back = (measured(*pair, embedding=embedding) for pair in (("five", "five"), (A, B), (B, A)))
    for measure in MEASURES:
        assert getattr(itself, measure).value == pytest.approx(0.0, abs=1e-6)
        assert getattr(there, measure).value == pytest.approx(getattr(back, measure).value)
        assert getattr(there, measure).value > getattr(there, measure).floor > 0


def test_the_distance_in_weights_obeys_the_triangle_inequality():
    sets = [TextureSet.load("five")[model] for model in range(3)]
    for aligned in (False, True):
        ab, bc, ac = (visual_w2(sets[i], sets[k], aligned=aligned) for i, k in ((0, 1), (1, 2), (0, 2)))
        assert ac <= ab + bc + 1e-9 and ab <= ac + bc + 1e-9


def test_the_distance_in_weights_is_what_two_models_make_of_the_same_things():
    values = product_of_marginals(A.inputs, 40_000, np.random.default_rng(0))
    values[:, 0] = np.random.default_rng(1).choice(
        [-1.0, 1.0], len(values)
    )  # the floor counts as an input of variance 1
    difference = A.raw(A.features(values)) - B.raw(B.features(values))
    assert visual_w2(A, B) == pytest.approx(np.sqrt((difference**2).mean()), rel=0.01)


def test_a_set_of_models_is_the_same_in_any_order():
    five = TextureSet.load("five")
    assert visual_w2(five, five[[3, 1, 4, 0, 2]]) == pytest.approx(0.0, abs=1e-6)


def test_patterns_that_change_places_are_the_same_patterns():
    order = [0, *range(len(A.inputs) - 1, 0, -1)]
    distribution = {
        name: segar.noise.UniformNoise(-1.0, 1.0)
        for name in A.inputs
        if name not in ("background",) and "noise" not in name
    }
    blank = {"shift": np.zeros(len(A.inputs)), "scale": np.ones(len(A.inputs))}
    inputs = tuple(name if "noise" not in name else f"Factor{name[-1]}" for name in A.inputs)
    distribution |= {f"Factor{k}": segar.noise.UniformNoise(-1.0, 1.0) for k in (1, 2, 3)}
    one = TextureSet("a", inputs, A.weights, A.bias, **blank)
    other = TextureSet("b", inputs, A.weights[:, order], A.bias, **blank)
    assert visual_w2(one, other, aligned=True, laws=distribution) == pytest.approx(0.0, abs=1e-6)
    assert visual_w2(one, other, laws=distribution) > 0.5


def test_sets_of_other_periods_can_be_compared():
    assert visual_w2("one", "baseline") > 0.5
    assert measured("one", "baseline").paired.value > 0.1


def test_hiding_a_factor_is_a_visual_distance():
    without = A.weights.copy()
    without[:, A.inputs.index("Charge")] = 0.0
    blind = TextureSet("blind", A.inputs, without, A.bias, A.shift, A.scale)
    pattern = A.weights[0, A.inputs.index("Charge")]
    assert visual_w2(A, blind) == pytest.approx(np.sqrt((pattern**2).mean()), rel=1e-5)  # Charge has a scale of 1 / std


def test_the_frechet_distance_of_gaussians_is_their_wasserstein_distance():
    rng = np.random.default_rng(0)
    x = rng.normal(size=(200_000, 2)) * [1.0, 2.0]
    y = rng.normal(size=(200_000, 2)) * [3.0, 0.5] + [0.0, 4.0]
    assert _frechet(x, y) == pytest.approx(np.sqrt(16 + 4 + 2.25), rel=0.01)


def test_the_standard_error_falls_with_more_things():
    few, many = (measured(A, B, samples=n, resamples=40).paired.standard_error for n in (30, 270))
    assert 1.8 < few / many < 5  # 3 on average


def test_an_embedding_of_ones_own_is_used():
    def brightness(squares: np.ndarray) -> np.ndarray:
        return squares.mean(axis=(1, 2, 3))[:, None]

    found = measured(A, B, embedding=brightness)
    assert found.embedding == "brightness" and 0 < found.paired.value < 255


def test_clusterings_differ_by_their_clusters_and_not_by_the_order_of_these():
    bank = FilterBank.built_in(np.random.default_rng(0))
    one, other = (cluster_filters(bank, 8, np.random.default_rng(seed)) for seed in (0, 1))
    mixed = one.reordered(np.random.default_rng(2).permutation(8))
    assert clustering_w2(one, mixed) == pytest.approx(0.0, abs=1e-6)
    assert clustering_w2(one, mixed, aligned=False) > 0.5
    assert clustering_w2(one, other) == pytest.approx(clustering_w2(other, one))
    with pytest.raises(segar.SegarError, match="clusterings of 8 and 6 clusters"):
        clustering_w2(one, cluster_filters(bank, 6, np.random.default_rng(0)))
    smaller = cluster_filters(FilterBank.built_in(np.random.default_rng(0), size=3), 8, np.random.default_rng(0))
    with pytest.raises(segar.SegarError, match="filters of 5 pixels cannot be compared with filters of 3 pixels"):
        clustering_w2(one, smaller)


def test_what_cannot_be_measured_is_refused():
    with pytest.raises(segar.SegarError, match=r"no embedding 'pixel'\. Did you mean 'pixels'\?"):
        measured(A, B, embedding="pixel")
    with pytest.raises(segar.SegarError, match="visual_distance needs at least 10 samples, not 5"):
        measured(A, B, samples=5)
    strange = TextureSet("strange", ("Spin",), np.ones((1, 1, 3, 3, 3)), np.zeros((1, 3, 3, 3)), [0.0], [1.0])
    with pytest.raises(segar.SegarError, match="no distribution says how much the input 'Spin' varies"):
        visual_w2(A, strange)
