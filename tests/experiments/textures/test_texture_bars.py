"""No set of textures is shipped with a model that does not show what it must."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from experiments import make_textures
from experiments.textures.linear_autoencoder import Training, train_model, train_set
from experiments.textures.texture_bars import refuse_below_bars, shortfalls
from segar.errors import SegarError
from segar.textures import TextureSet
from segar.textures.standard import INPUTS

ONE, FIVE = TextureSet.load("one"), TextureSet.load("five")


def with_weights(textures: TextureSet, model: int, name: str, factor: float) -> TextureSet:
    """The set with the patterns of one input of one model made stronger or weaker."""
    weights = textures.weights.copy()
    weights[model, INPUTS.index(name)] *= factor
    return dataclasses.replace(textures, weights=weights)


def test_a_set_that_meets_the_bars_passes():
    refuse_below_bars(ONE)


def test_a_factor_that_cannot_be_read_is_named_with_its_model():
    faint = with_weights(FIVE[:2], 1, "Magnetism", 0.05)
    with pytest.raises(SegarError, match=r"'five' must not be shipped") as refused:
        refuse_below_bars(faint)
    assert "model 1: Magnetism is read with an R^2 of 0." in str(refused.value)
    assert "model 0" not in str(refused.value)


def test_things_that_look_alike_are_named():
    said = " ".join(shortfalls(with_weights(ONE, 0, "GolfBall", 0.0)))
    assert "Charger of Charge 1 for GolfBall" in said and "GolfBall differs by" in said


def test_a_floor_like_the_things_on_it_is_refused():
    unlike = np.zeros(len(INPUTS))
    unlike[INPUTS.index("Consumes")] = ONE.scale[INPUTS.index("Consumes")]  # the feature of a hole
    weights = ONE.weights.copy()
    weights[:, INPUTS.index("background")] = np.tensordot(unlike, ONE.weights[0], axes=1)
    said = shortfalls(dataclasses.replace(ONE, weights=weights))
    assert any("Hole differs by" in shortfall and "grey levels from the floor" in shortfall for shortfall in said)


def test_a_training_that_is_too_short_says_so_after_all_its_attempts(capsys):
    with pytest.raises(SegarError, match="seed 3: none of 2 attempts meets the bars; train for more steps"):
        train_set("short", range(3, 4), Training(steps=3, samples=2000, most_attempts=2))
    assert "seed 3, attempt 1: " in capsys.readouterr().out


def test_another_attempt_starts_elsewhere_and_a_seed_repeats():
    quick = Training(steps=2, samples=1000)
    first, again, other = (train_model(0, quick, attempt)[0] for attempt in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert not np.allclose(first, other)


def test_what_is_below_the_bars_is_not_written(tmp_path, monkeypatch):
    monkeypatch.setattr(make_textures, "train_set", lambda *_: with_weights(ONE, 0, "Mass", 0.0))
    with pytest.raises(SegarError, match="Mass is read with an R"):
        make_textures.main(["one", "--into", str(tmp_path)])
    assert not list(tmp_path.iterdir())


def test_the_table_of_shipped_sets_can_be_had_without_making_them(capsys):
    make_textures.main(["one", "--only-table"])
    assert "| StoredEnergy   |      1 |" in capsys.readouterr().out
