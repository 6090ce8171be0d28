"""The things that must look different, and how well textures tell them apart and factors can be read out of textures."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from segar import language
from segar.errors import SegarError, did_you_mean
from segar.language import Entity
from segar.textures.inputs import is_noise, name_of_input
from segar.textures.standard import UNIFORM, Laws, product_of_marginals
from segar.textures.texture_sets import TextureSet

# What a task is about: it must stand out from everything else.
CHIEF = (language.GolfBall, language.GoalTile)

# Each kind of thing, and tiles where all are hot and rough.
OBJECTS = (language.Ball, language.Magnet, language.Charger, language.Bumper, language.Damper)
TILES = (language.SandTile, language.MagmaTile, language.FireTile, language.Hole)
KINDS: tuple[Entity, ...] = (
    *(kind() for kind in (*CHIEF, *OBJECTS, *TILES)),
    language.Magnet({language.Magnetism: 1.0}),
    language.Charger({language.Charge: 1.0}),
    *(kind({language.Heat: 0.7, language.Friction: 0.7}) for kind in (language.Tile, language.GoalTile, language.Hole)),
)

DRAWS = 40
SAMPLES = 8000


def looks(textures: TextureSet, things: Sequence[Entity] = KINDS) -> np.ndarray:
    """Features of the floor and of things without noise, float64 ``[1 + thing, input]``."""
    return np.stack([textures.background(), *(textures.features(textures.values(thing)) for thing in things)])


def look_distances(
    textures: TextureSet,
    model: int = 0,
    *,
    rng: np.random.Generator,
    things: Sequence[Entity] = KINDS,
    draws: int = DRAWS,
) -> np.ndarray:
    """How far each thing, with noise, is from the floor and from each thing without noise, ``[draw, thing, 1 + thing]``.

    The distance of two textures is the root mean square of the difference of their pixels, in grey levels (0 to 255). Column
    0 is the floor. A thing is recognised in a draw if it is nearest to itself, in the column one after its own number.

    Args:
        things: what is compared, with the factors that it has.
        draws: how many times noise is drawn.
    """
    plain = looks(textures, things)
    noise = np.array([is_noise(name) for name in textures.inputs])
    noisy = np.repeat(plain[None, 1:], draws, axis=0)
    names = [name for name in textures.inputs if is_noise(name)]
    if names:
        drawn = product_of_marginals(names, draws * len(things), rng)
        noisy[..., noise] = drawn.reshape(draws, len(things), -1) * textures.scale[noise]
    seen, known = (textures.patches(features, model).astype(float) for features in (noisy, plain))
    return np.sqrt(((seen[:, :, None] - known) ** 2).mean(axis=(3, 4, 5)))


def linear_read_out(
    textures: TextureSet,
    model: int = 0,
    *,
    rng: np.random.Generator,
    laws: Laws = UNIFORM,
    hidden: Iterable[Any] = (),
    samples: int = SAMPLES,
) -> dict[str, float]:
    """R^2 of each input that varies, read from the uint8 pixels of a texture by a linear map, on held-out things.

    The map is fitted by least squares to one half of the samples from the product of marginals, and 1 - (mean squared
    error) / (variance) is taken on the other half. It can be below 0. Where the name of an input varies but it is
    hidden, its value varies and the texture does not.

    Args:
        laws: the distributions of the values, see :func:`segar.textures.standard.product_of_marginals`.
        hidden: inputs that enter as 0, classes or names.
        samples: how many things are drawn.

    Raises:
        SegarError: something hidden is not an input, there is no distribution for an input, or there are too few samples.
    """
    room = 3 * textures.period**2 + 1
    if samples < 4 * room:
        raise SegarError(
            f"a read-out of {room - 1} numbers per texture needs at least {4 * room} samples, not {samples}"
        )
    values = product_of_marginals(textures.inputs, samples, rng, laws)
    features = textures.features(values)
    for name in map(name_of_input, hidden):
        if name not in textures.inputs:
            raise SegarError(f"'{name}' is no input of {textures!r}.{did_you_mean(name, textures.inputs)}")
        features[:, textures.inputs.index(name)] = 0.0
    pixels = textures.patches(features, model).reshape(samples, -1) / 255.0
    shown = np.concatenate([pixels, np.ones((samples, 1))], axis=1)
    half = samples // 2
    weights = np.linalg.lstsq(shown[:half], values[:half], rcond=None)[0]
    error = ((values[half:] - shown[half:] @ weights) ** 2).mean(0)
    variance = values[half:].var(0)
    return {n: float(1 - e / v) for n, e, v in zip(textures.inputs, error, variance, strict=True) if v > 0}
