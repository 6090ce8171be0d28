"""What the shipped sets have in common: their inputs, the distributions of their values, and the units of these.

Textures are measured on values of the inputs that are drawn from a product of marginals.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from segar.errors import SegarError, did_you_mean
from segar.noise import DiscreteRangeNoise, Noise, UniformNoise
from segar.textures.inputs import BACKGROUND, NOISE_CLIP, is_noise
from segar.textures.texture_sets import TextureSet, hidden_inputs

Laws = Mapping[str, Noise]

# The paper's product of uniform marginals. The ranges hold what the named families draw (charges and magnetisms of the
# hard objects are +-1 +- 0.4) and, where these hold a factor fixed, what experiments vary it over (masses of 0.3 to 3).
UNIFORM: Laws = {
    "Heat": UniformNoise(0.0, 1.0),
    "Friction": UniformNoise(0.0, 1.0),
    "Charge": UniformNoise(-2.0, 2.0),
    "Magnetism": UniformNoise(-2.0, 2.0),
    "Density": UniformNoise(0.0, 2.0),
    "StoredEnergy": UniformNoise(-1.0, 1.0),
    "Mass": UniformNoise(0.1, 3.0),
    "Alive": DiscreteRangeNoise(0, 1),
    "Consumes": DiscreteRangeNoise(0, 1),
    "GoalTile": DiscreteRangeNoise(0, 1),
    "GolfBall": DiscreteRangeNoise(0, 1),
}

# Those of 2022; two by which a goal is told from a hole, and from a tile of the same heat and friction; and one by which the
# ball is told from an object of the same charge.
INPUTS = (
    BACKGROUND,
    *("Heat", "Friction", "Charge", "Magnetism", "Density", "StoredEnergy", "Mass", "Alive"),
    *("Consumes", "GoalTile", "GolfBall"),
    *("noise_1", "noise_2", "noise_3"),
)

# The feature 0 of these is their default, so that a thing whose mass is hidden looks like one of 1 kg.
CENTRED = {"Mass": 1.0, "Density": 1.0}

SAMPLES = 8000  # of a read-out


def product_of_marginals(inputs: Sequence[str], n: int, rng: np.random.Generator, laws: Laws = UNIFORM) -> np.ndarray:
    """Values of n things, float64 ``[n, input]``, each input drawn independently of the others.

    ``TextureSet.features`` turns them into features. The background is 0, noise is N(0, 1) clipped to [-1, 1].

    Args:
        inputs: as in :class:`segar.textures.TextureSet`.
        laws: the distributions of the inputs that are neither background nor noise.

    Raises:
        SegarError: there is no distribution for an input.
    """
    require_laws(inputs, laws)
    drawn: list[Any] = []
    for name in inputs:
        if name == BACKGROUND:
            drawn.append(np.zeros(n))
        elif is_noise(name):
            drawn.append(np.clip(rng.standard_normal(n), -NOISE_CLIP, NOISE_CLIP))
        else:
            drawn.append(np.asarray(laws[name].sample(rng, n), dtype=float))
    return np.stack(drawn, axis=-1)


def units(inputs: Sequence[str] = INPUTS, laws: Laws = UNIFORM) -> tuple[np.ndarray, np.ndarray]:
    """Shift and scale of inputs, float64 ``[input]`` each: a feature is in standard deviations of the input.

    Raises:
        SegarError: there is no distribution for an input.
    """
    require_laws(inputs, laws)
    spreads = [float(laws[name].var) ** 0.5 if name in laws else 1.0 for name in inputs]
    return np.array([CENTRED.get(name, 0.0) for name in inputs]), 1.0 / np.array(spreads)


def require_laws(inputs: Sequence[str], laws: Laws) -> None:
    """Raise :class:`SegarError` for an input without a distribution that is neither background nor noise."""
    for name in inputs:
        if name not in laws and name != BACKGROUND and not is_noise(name):
            raise SegarError(
                f"no distribution says how much the input '{name}' varies; give laws=UNIFORM | {{'{name}':"
                f" UniformNoise(...)}}.{did_you_mean(name, laws)}"
            )


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
    for name in hidden_inputs(textures, hidden):
        features[:, textures.inputs.index(name)] = 0.0
    pixels = textures.patches(features, model).reshape(samples, -1) / 255.0
    shown = np.concatenate([pixels, np.ones((samples, 1))], axis=1)
    half = samples // 2
    weights = np.linalg.lstsq(shown[:half], values[:half], rcond=None)[0]
    error = ((values[half:] - shown[half:] @ weights) ** 2).mean(0)
    variance = values[half:].var(0)
    return {n: float(1 - e / v) for n, e, v in zip(textures.inputs, error, variance, strict=True) if v > 0}
