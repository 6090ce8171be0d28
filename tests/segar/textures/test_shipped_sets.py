"""The shipped sets: what they show can be read by a linear map, and what is hidden cannot."""

from functools import cache

import numpy as np
import pytest

from segar.levels import TASK_LEVELS, families, family, mix
from segar.textures import INPUTS, UNIFORM, TextureSet, is_noise, linear_read_out, shipped_sets
from segar.textures.texture_sets import DATA

SIZES = {"one": 1, "five": 5, "twenty": 20, "baseline": 1, "close": 5, "far": 5}
MODELS = [(name, model) for name, count in SIZES.items() for model in range(count)]
FACTORS = [name for name in INPUTS if name in UNIFORM]


@cache
def of_families():
    """The distribution of each factor in the named level distributions: the mixture over all their entities."""
    parts = {}
    for name in (*families(), *TASK_LEVELS):
        for entity, marginals in family(name).marginals().items():
            for factor, marginal in marginals.items():
                if entity not in ("parameters", "global_friction") and factor.__name__ in UNIFORM:
                    parts.setdefault(factor.__name__, []).append((marginal, 1.0))
    return {name: mix(found) for name, found in parts.items()}


@pytest.mark.parametrize("laws", ["uniform", "families"])
@pytest.mark.parametrize(("name", "model"), MODELS)
def test_each_shown_factor_can_be_read_by_a_linear_map(name, model, laws):
    drawn_from = UNIFORM if laws == "uniform" else {**UNIFORM, **of_families()}
    read = linear_read_out(TextureSet.load(name), model, rng=np.random.default_rng(17), laws=drawn_from)
    low = {factor: share for factor, share in read.items() if not is_noise(factor) and share < 0.95}
    assert not low
    assert {factor for factor in read if not is_noise(factor)} >= (
        {"Charge", "Heat"} if laws == "families" else set(FACTORS)
    )


@pytest.mark.parametrize("hidden", [FACTORS[::2], FACTORS[1::2]], ids=["even", "odd"])
@pytest.mark.parametrize(("name", "model"), [(name, count - 1) for name, count in SIZES.items()])
def test_no_hidden_factor_can_be_read_and_all_others_still_can(name, model, hidden):
    read = linear_read_out(TextureSet.load(name), model, rng=np.random.default_rng(18), hidden=hidden)
    assert max(read[factor] for factor in hidden) <= 0.02
    assert min(read[factor] for factor in FACTORS if factor not in hidden) >= 0.95


def test_all_factors_of_the_renderers_of_2022_are_shown():
    assert sum(path.stat().st_size for path in DATA.glob("*.npz")) < 300_000
    for name in shipped_sets():
        textures = TextureSet.load(name)
        assert textures.period == 3 or name not in ("one", "five", "twenty")  # the geometry of the paper's auto-encoder
        assert textures.inputs == INPUTS and len(textures) == SIZES[name] and textures.name == name
        factors = "Heat Friction Charge Magnetism Density StoredEnergy Mass Alive"
        assert set(textures.inputs) >= set(factors.split())


def test_no_two_models_are_alike():
    for pair in (("one", "five", "twenty"), ("baseline", "close", "far")):
        weights = np.concatenate([TextureSet.load(name).weights for name in pair])
        flat = weights.reshape(len(weights), -1)
        differences = np.sqrt(((flat[:, None] - flat[None]) ** 2).mean(axis=-1))
        assert differences[np.triu_indices(len(flat), 1)].min() > 0.1


def test_the_uniform_ranges_hold_what_the_families_draw():
    for factor, law in of_families().items():
        low, high = UNIFORM[factor].support
        drawn = law.sample(np.random.default_rng(0), 20_000)
        assert np.mean((drawn < low) | (drawn > high)) < 0.005, factor
