"""How well things can be distinguished by their textures under all noise."""

from collections.abc import Sequence

import numpy as np

from segar.language import Entity
from segar.textures.inputs import is_noise
from segar.textures.samples import product_of_marginals
from segar.textures.standard import KINDS, looks
from segar.textures.texture_sets import TextureSet

DRAWS = 40


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
