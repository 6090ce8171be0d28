"""Textured pixels against a plain renderer, and the laws of when patterns change and when they do not."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest
from scipy import stats

from segar import Ball, Mass, SegarError, Size
from segar.language import Charge, Charger, GoalTile, GolfBall, Heat, Magnet, Position, SandTile, StoredEnergy, Velocity
from segar.observations.pixels.textured import TexturedPixels
from segar.textures import TextureSet
from tests.segar.observations.plain_renderer import Look, draw_plainly
from tests.segar.observations.scenes import ANYTHING, Scene, draw, frames_of, put, random_textures, scene, start

LEVELS = scene((GolfBall,), (GoalTile,), *[ANYTHING] * 4, n=40)
KEYS = np.arange(40, dtype=np.uint64)
NOISELESS = ("noise_1", "noise_2")


def woven(scene: Scene, level: int, textures: TextureSet, model: int) -> Look:
    """Every thing in the pattern that the textures define for its factors; noise is 0."""
    layout = scene.layout

    def look(e: int, row: int, column: int) -> np.ndarray:
        entity = layout.types[scene.types[level, e]]
        by_name = {f.__name__: scene.values[level, e, layout.columns[f]] for f in entity.declared if f.width == 1}
        by_name |= {name: 0.0 for name in ("background", *NOISELESS)}
        by_name["GoalTile"] = float(entity is GoalTile) or np.nan
        values = [by_name.get(name, np.nan) for name in textures.inputs]
        patch = textures.patches(textures.features(values), model)
        return patch[np.ix_((np.arange(64) - row) % len(patch), (np.arange(64) - column) % len(patch))]

    return look


@pytest.mark.parametrize("squash", ["tanh", "clip"])
@pytest.mark.parametrize("period", [1, 3, 8, 50])
def test_everything_has_the_pattern_of_its_factors_fixed_to_its_centre(period, squash):
    textures = random_textures(1, period, squash)
    frames = draw(LEVELS, TexturedPixels(textures, hidden=NOISELESS), KEYS)
    at = np.arange(64) % period
    floor = textures.patches(textures.background())[np.ix_(at, at)]
    for level in range(40):
        plain = draw_plainly(LEVELS, level, woven(LEVELS, level, textures, 0), floor)
        np.testing.assert_array_equal(frames[level], plain)


def test_an_episode_shows_one_model_and_episodes_show_all_of_them_equally_often():
    levels = scene((GolfBall,), (GoalTile,), n=1)
    models = [draw(levels, TexturedPixels(random_textures(4)[i], hidden=NOISELESS))[0] for i in range(4)]
    bound = TexturedPixels(random_textures(4), hidden=NOISELESS).bind(levels, 1)
    counts = np.zeros(4, int)
    frame = np.zeros((1, 64, 64, 3), np.uint8)
    for key in range(400):
        bound.start(np.array([key], np.uint64), np.zeros(1, int), np.ones(1, bool))
        bound.begin(levels.values, np.zeros(1, int), np.ones(1, bool))
        bound.write(levels.values, np.zeros(1, int), frame, np.arange(1))
        counts[[np.array_equal(frame[0], model) for model in models]] += 1
    assert counts.sum() == 400
    assert stats.chisquare(counts).pvalue > 0.01


def seen_noise(levels: Scene, keys: np.ndarray, noise: str = "episode") -> np.ndarray:
    """The noise of the middle of each level, as far as 8 bits of grey show it."""
    zero, one = np.zeros((1, 1, 3)), np.ones((1, 1, 3))
    textures = TextureSet(
        "noise", ("background", "noise_1"), np.array([[zero, one]]), [zero], np.zeros(2), np.ones(2), "clip"
    )
    frames = draw(levels, TexturedPixels(textures, noise=noise), keys)
    return frames[:, 32, 32, 0] / 255 * 2 - 1


def test_noise_is_normal_and_clipped_at_one():
    levels = scene((Ball,), n=4000, hulls=False)
    put(levels, slice(None), 0, Position, 0.0)
    put(levels, slice(None), 0, Size, 0.4)
    noise = seen_noise(levels, np.arange(4000, dtype=np.uint64))
    for clipped in (noise == 1.0, noise == -1.0):
        assert stats.binomtest(int(clipped.sum()), 4000, stats.norm.sf(1.0)).pvalue > 0.01
    inner = noise[np.abs(noise) < 1.0] + np.random.default_rng(0).uniform(0, 2 / 255, (np.abs(noise) < 1.0).sum())
    assert stats.kstest(inner, stats.truncnorm(-1, 1).cdf).pvalue > 0.01


@pytest.mark.parametrize("noise", ["episode", "level", "never"])
def test_another_seed_draws_other_noise(noise):
    first, other = (draw(LEVELS, TexturedPixels(random_textures(), noise=noise, seed=seed), KEYS) for seed in (0, 1))
    assert (first != other).any(axis=(1, 2, 3)).all()


def test_noise_by_level_differs_between_levels_and_goes_with_a_level_into_other_sets():
    same = picked(LEVELS, [0] * 40, np.arange(40))
    by_level = draw(same, TexturedPixels(random_textures(), noise="level"))
    assert (by_level[1:] != by_level[0]).any(axis=(1, 2, 3)).all()
    never = draw(same, TexturedPixels(random_textures(), noise="never"))
    assert (never == never[0]).all()
    pixels, rows = TexturedPixels(random_textures(5), noise="level", model="level"), np.array([5, 3, 17])
    np.testing.assert_array_equal(
        draw(picked(LEVELS, rows, rows), pixels, KEYS[10:13]), draw(LEVELS, pixels, KEYS)[rows]
    )


def picked(levels: Scene, rows: Sequence[int] | np.ndarray, indices: np.ndarray) -> Scene:
    """Some of the levels, as if they stood at these places of their split."""
    arrays = {
        name: getattr(levels, name)[rows] for name in ("types", "shape_kind", "vertex_count", "vertices", "values")
    }
    return dataclasses.replace(levels, **arrays, provenance=dataclasses.replace(levels.provenance, indices=indices))


def test_two_things_of_one_level_have_noise_of_their_own():
    levels = scene((Ball,), (Ball,), hulls=False)
    for entity, x in enumerate((-0.5, 0.5)):
        put(levels, 0, entity, Position, (x, 0.0))
        put(levels, 0, entity, Size, 0.4)
    left, right = (draw(levels, TexturedPixels(random_textures()))[0, 30:35, c - 2 : c + 3] for c in (16, 48))
    assert not np.array_equal(left, right)


def test_a_pattern_follows_its_factors_within_an_episode_only_where_it_is_asked_to():
    for follow in (False, True):
        levels = scene((Charger,), (Magnet,), hulls=False)
        for entity, x in enumerate((-0.5, 0.5)):
            put(levels, 0, entity, Position, (x, 0.0))
            put(levels, 0, entity, Size, 0.4)
        bound = start(levels, TexturedPixels(random_textures(), follow=follow), KEYS[:1])
        before = frames_of(bound, levels)
        put(levels, 0, 0, Charge, 0.9)
        after = frames_of(bound, levels)
        assert (before != after)[:, :, :32].any() == follow
        assert not (before != after)[:, :, 32:].any()
        put(levels, 0, 0, Charge, -1.0)
        np.testing.assert_array_equal(frames_of(bound, levels), before)


def test_a_restored_episode_keeps_the_patterns_of_its_start():
    levels = dataclasses.replace(LEVELS, values=LEVELS.values.copy())
    pixels = TexturedPixels(random_textures())
    bound = start(levels, pixels, KEYS)
    put(levels, slice(None), slice(None), Charge, 0.5)
    put(levels, slice(None), 0, Position, 0.0)
    frames, memory = frames_of(bound, levels), bound.memory()
    fresh, everywhere = pixels.bind(levels, 40), np.ones(40, bool)
    fresh.start(KEYS, np.arange(40), everywhere)
    fresh.recall(memory)
    fresh.begin(levels.values, np.arange(40), everywhere)
    np.testing.assert_array_equal(frames_of(fresh, levels), frames)
    fresh.begin(levels.values, np.arange(40), everywhere)  # as after an intervention: things look as they are now
    assert not np.array_equal(frames_of(fresh, levels), frames)


def test_a_factor_is_shown_and_hidden_with_its_sub_classes():
    class Warmth(Heat): ...

    class Ember(SandTile):
        heat: Warmth

    textured, hiding = (TexturedPixels(random_textures(), hidden=h) for h in ((), (Heat, "StoredEnergy", Mass)))
    assert textured.shows(Warmth) and not any(hiding.shows(f) for f in (Warmth, StoredEnergy, Mass))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"noise": "epsiode"}, "noise must be 'episode' or 'level' or 'never', not 'epsiode'"),
        ({"model": "never"}, "model must be 'episode' or 'level', not 'never'"),
        ({"hidden": (Velocity,)}, "do not show 'Velocity', so it cannot be hidden"),
        ({"textures": "won"}, r"no textures 'won'. Did you mean 'one'?"),
    ],
)
def test_options_that_do_not_exist_are_refused_with_those_that_do(options, message):
    with pytest.raises(SegarError, match=message):
        TexturedPixels(**{"textures": random_textures(), **options})
