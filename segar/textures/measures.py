"""How well factors can be read out of textures."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from segar.errors import SegarError, did_you_mean
from segar.textures.inputs import name_of_input
from segar.textures.standard import UNIFORM, Laws, product_of_marginals
from segar.textures.texture_sets import TextureSet

SAMPLES = 8000


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
