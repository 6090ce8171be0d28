"""Sets of textures: the formula, files, and what is refused."""

import numpy as np
import pytest

import segar
from segar.language import GoalTile, GolfBall, Heat, Mass
from segar.textures import TextureSet

INPUTS = ("background", Heat, "Charge", GoalTile, "noise_1")


def a_set(models: int = 2, period: int = 3, **changes) -> TextureSet:
    rng = np.random.default_rng(0)
    shape = (models, len(INPUTS), period, period, 3)
    fields = {
        "name": "mine",
        "inputs": INPUTS,
        "weights": rng.normal(size=shape),
        "bias": rng.normal(size=(models, period, period, 3)),
        "shift": np.array([0.0, 0.5, 0.0, 0.0, 0.0]),
        "scale": np.array([1.0, 2.0, 0.5, 1.0, 1.0]),
    }
    return TextureSet(**(fields | changes))


def test_a_patch_is_the_formula_pixel_by_pixel():
    textures, features = a_set(), np.array([0.0, 0.3, -1.2, 1.0, 0.4])
    patch = textures.patches(features, 1)
    for place in np.ndindex(3, 3, 3):
        y = float(textures.bias[1][place])
        for weights, feature in zip(textures.weights[1], features, strict=True):
            y += feature * float(weights[place])
        assert patch[place] == int(255 * (np.tanh(y) + 1) / 2)


def test_a_clipped_texture_reaches_black_and_white_and_no_further():
    textures = a_set(squash="clip")
    assert {textures.patches(np.full(5, scale)).min() for scale in (1e3, -1e3)} == {0}
    assert {textures.patches(np.full(5, scale)).max() for scale in (1e3, -1e3)} == {255}


def test_each_thing_of_an_array_is_drawn_by_its_own_model():
    textures, features = a_set(), np.random.default_rng(1).normal(size=(2, 4, 5))
    models = np.array([0, 1, 1, 0])
    together = textures.patches(features, models)
    assert together.shape == (2, 4, 3, 3, 3)
    for i in range(2):
        for k in range(4):
            np.testing.assert_array_equal(together[i, k], textures.patches(features[i, k], int(models[k])))
    by_all = textures.patches(features[0, 0], np.array([0, 1]))
    np.testing.assert_array_equal(by_all[1], textures.patches(features[0, 0], 1))


def test_what_an_entity_lacks_enters_as_nothing():
    textures = a_set()
    values = textures.values(GoalTile())
    assert np.isnan(values[2])  # a goal has no charge
    np.testing.assert_array_equal(textures.features(values), [0.0, (0.0 - 0.5) * 2.0, 0.0, 1.0, 0.0])


def test_values_are_those_of_the_entity():
    textures = a_set(inputs=("background", Mass, "Charge", "Consumes", "noise_1"))
    np.testing.assert_array_equal(textures.values(GolfBall({Mass: 3.0})), [0.0, 3.0, 1.0, 0.0, 0.0])
    assert textures.values(segar.Hole())[3] == 1.0


def test_some_models_of_a_set_are_a_set():
    textures = a_set(models=3)
    features = np.random.default_rng(1).normal(size=5)
    assert [len(textures[0]), len(textures[1:]), len(textures[[2, 0]])] == [1, 2, 2]
    np.testing.assert_array_equal(textures[[2, 0]].patches(features, 0), textures.patches(features, 2))


def test_a_set_cannot_be_changed_by_accident_and_leaves_the_arrays_that_it_was_made_of_alone():
    bias = np.zeros((2, 3, 3, 3), np.float32)
    textures = a_set(bias=bias)
    with pytest.raises(ValueError, match="read-only"):
        textures.weights[0] = 0.0
    bias += 1.0
    assert not textures.bias.any()


def test_a_set_comes_back_from_a_file_as_it_was(tmp_path):
    textures = a_set(squash="clip", origin={"seeds": [3, 4]})
    textures.save(tmp_path / "mine.npz")
    a_set(squash="clip", origin={"seeds": [3, 4]}).save(tmp_path / "again.npz")
    assert (tmp_path / "mine.npz").read_bytes() == (tmp_path / "again.npz").read_bytes()
    back = TextureSet.load(tmp_path / "mine.npz")
    names = ("background", "Heat", "Charge", "GoalTile", "noise_1")  # of classes, their own
    assert (back.name, back.inputs, back.squash, back.origin) == ("mine", names, "clip", {"seeds": [3, 4]})
    for field in ("weights", "bias", "shift", "scale"):
        np.testing.assert_array_equal(getattr(back, field), getattr(textures, field))


def test_files_that_are_no_textures_are_refused(tmp_path):
    with pytest.raises(segar.SegarError, match=r"no textures 'twnty'\. Did you mean 'twenty'\?"):
        TextureSet.load("twnty")
    with pytest.raises(segar.SegarError, match="there is no texture file"):
        TextureSet.load(tmp_path / "nothing.npz")
    segar.family("empty-easy").sample(1, seed=0, split="train").save(tmp_path / "levels.npz")
    with pytest.raises(segar.SegarError, match="not a texture file"):
        TextureSet.load(tmp_path / "levels.npz")
    a_set().save(tmp_path / "mine.npz")
    (tmp_path / "half.npz").write_bytes((tmp_path / "mine.npz").read_bytes()[:-100])
    with pytest.raises(segar.SegarError, match="only part of one"):
        TextureSet.load(tmp_path / "half.npz")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"inputs": ("background", "Heat", "Heat", "Mass", "noise_1")}, "the input 'Heat' stands twice"),
        ({"squash": "tan"}, "squash must be 'tanh' or 'clip', not 'tan'"),
        ({"weights": np.zeros((2, 4, 3, 3, 3))}, r"must have the shape \[model, 5 inputs, P, P, 3\]"),
        ({"weights": np.zeros((2, 5, 3, 4, 3))}, r"must have the shape \[model, 5 inputs, P, P, 3\]"),
        ({"bias": np.zeros((1, 3, 3, 3))}, r"bias must have the shape \[2, 3, 3, 3\], not \[1, 3, 3, 3\]"),
        ({"scale": np.ones(4)}, r"scale must have the shape \[5\]"),
        ({"bias": np.full((2, 3, 3, 3), np.nan)}, "bias has numbers that are not finite"),
        ({"shift": np.ones(5)}, "the shift of 'background' must be 0"),
    ],
)
def test_what_cannot_be_a_set_is_refused(changes, message):
    with pytest.raises(segar.SegarError, match=message):
        a_set(**changes)


def test_features_and_models_that_do_not_fit_are_refused():
    textures = a_set()
    with pytest.raises(segar.SegarError, match=r"take 5 features \(background, Heat, .*\), not an array"):
        textures.patches(np.zeros(4))
    with pytest.raises(segar.SegarError, match="have models 0 to 1"):
        textures.patches(np.zeros(5), 2)
