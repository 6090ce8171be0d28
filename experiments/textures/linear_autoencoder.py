"""The paper's first renderer: textures trained to be invertible, a linear auto-encoder from factors to pixels and back."""

from dataclasses import asdict, dataclass

import numpy as np
import torch
from torch.nn import functional

from experiments.textures.texture_bars import shortfalls
from segar.errors import SegarError
from segar.textures import (
    CHIEF,
    EXTREMES,
    INPUTS,
    KINDS,
    UNIFORM,
    TextureSet,
    family_laws,
    is_noise,
    looks,
    product_of_marginals,
    units,
)

# The paper's geometry: 3 pixels per cell, 5 x 5 of them from each.
STRIDE, KERNEL = 3, 5


@dataclass(frozen=True)
class Training:
    """How a model is trained.

    Attributes:
        most_attempts: how often a seed is tried until its model meets the bars of :mod:`experiments.textures.texture_bars`.
        steps, batch: of Adam, whose ``learning_rate`` falls along a cosine to 0.
        samples: things from the product of marginals, from which batches are drawn.
        noise_weight: of noise in the error of reconstruction; factors have 1.
        contrast: weight of the squared shortfalls of contrast between two of the floor and the
            looks of :mod:`segar.textures.measures`, whatever their noise.
        texture_contrast, colour_contrast: what it should be: root mean square over pixels, and of the mean colour, in
            units in which black is -1 and white 1.
        calm: weight of the mean square of what noise changes, in these units.
        floor_contrast: how many times as much it should be between the floor and a thing.
        chief_contrast: likewise between the golf ball or the goal and another thing.
    """

    most_attempts: int = 5
    steps: int = 3000
    batch: int = 1024
    learning_rate: float = 1e-2
    samples: int = 200_000
    noise_weight: float = 0.5
    contrast: float = 1.0
    texture_contrast: float = 0.6
    colour_contrast: float = 0.35
    floor_contrast: float = 1.6
    chief_contrast: float = 1.2
    calm: float = 0.3


def train_set(name: str, seeds: range, training: Training) -> TextureSet:
    """A set with one model per seed, the first of its attempts that meets the bars.

    Raises:
        SegarError: no attempt does. What each lacks is printed.
    """
    weights, bias, attempts = zip(*(_good_model(seed, training) for seed in seeds), strict=True)
    origin = {"renderer": "linear auto-encoder", "seeds": list(seeds), "attempts": list(attempts), **asdict(training)}
    return TextureSet(name, INPUTS, np.stack(weights), np.stack(bias), *units(), origin=origin)


def _good_model(seed: int, training: Training) -> tuple[np.ndarray, np.ndarray, int]:
    """Weights and bias of a model that meets the bars, and which attempt of the seed it was."""
    for attempt in range(training.most_attempts):
        weights, bias = train_model(seed, training, attempt)
        candidate = TextureSet("candidate", INPUTS, weights[None], bias[None], *units(), origin={"seeds": [seed]})
        missing = shortfalls(candidate)
        print(f"seed {seed}, attempt {attempt}: {'; '.join(missing) or 'meets the bars'}", flush=True)
        if not missing:
            return weights, bias, attempt
    raise SegarError(f"seed {seed}: none of {training.most_attempts} attempts meets the bars; train for more steps")


def train_model(seed: int, training: Training, attempt: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Weights ``[input, 3, 3, 3]`` and bias ``[3, 3, 3]`` of a model; the same for the same seed and attempt.

    Encoder: a transposed convolution of stride 3 on a field that is constant, so that its output repeats every 3 pixels,
    and tanh. Decoder: a convolution of stride 3. Both are trained to reconstruct the features.
    """
    rng = np.random.default_rng((seed, attempt))
    generator = torch.Generator().manual_seed(int(rng.integers(2**62)))
    count, room = len(INPUTS), 3 * STRIDE**2
    kernels = [0.1 * torch.randn(count, 3, KERNEL, KERNEL, generator=generator, dtype=torch.float64) for _ in range(2)]
    encoder, decoder = (kernel.requires_grad_() for kernel in kernels)
    bias, offset = (torch.zeros(n, dtype=torch.float64, requires_grad=True) for n in (3, count))
    optimizer = torch.optim.Adam([encoder, decoder, bias, offset], lr=training.learning_rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, training.steps)
    pool, clean = feature_pool(training.samples, rng), looks(untrained())
    of_noise = np.array([is_noise(name) for name in INPUTS])
    importance = torch.tensor(np.where(of_noise, training.noise_weight, 1.0))
    for _ in range(training.steps):
        weights, inverse = folded(encoder), unfolded(decoder)
        spread_bias = bias.repeat_interleave(room // 3)
        x = torch.tensor(masked(pool[rng.integers(len(pool), size=training.batch)], rng))
        y = torch.tanh(x @ weights + spread_bias)
        error = (importance * (y @ inverse + offset - x) ** 2).mean()
        plain, noisy = (
            torch.tanh(torch.tensor(x) @ weights + spread_bias) for x in (clean, with_noise(clean, of_noise, rng))
        )
        shortfall, change = contrast_shortfall(noisy, training), ((noisy - plain) ** 2).mean()
        optimizer.zero_grad()
        (error + training.contrast * shortfall + training.calm * change).backward()
        optimizer.step()
        schedule.step()
    final = folded(encoder).detach().reshape(count, 3, STRIDE, STRIDE).permute(0, 2, 3, 1).numpy()
    return final, np.broadcast_to(bias.detach().numpy(), (STRIDE, STRIDE, 3))


def feature_pool(n: int, rng: np.random.Generator) -> np.ndarray:
    """Features of things, float64 ``[n, input]``: half from uniform marginals, half from those of the named families."""
    shift, scale = units()
    laws = UNIFORM, {**UNIFORM, **family_laws()}
    return np.concatenate([(product_of_marginals(INPUTS, n // 2, rng, law) - shift) * scale for law in laws])


def masked(features: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """In half of the rows each feature is absent with probability 1/2, as most are in an entity."""
    keeps = np.where(rng.random((len(features), 1)) < 0.5, 0.5, 1.0)
    return features * (rng.random(features.shape) < keeps)


def untrained() -> TextureSet:
    """A set of one model that shows nothing, with the inputs and units of the others."""
    blank = np.zeros((1, len(INPUTS), STRIDE, STRIDE, 3))
    return TextureSet("untrained", INPUTS, blank, blank[:, 0], *units())


def with_noise(clean: np.ndarray, of_noise: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The looks with fresh noise each; the floor, which comes first, has none."""
    noisy = clean.copy()
    noisy[1:, of_noise] = product_of_marginals([n for n in INPUTS if is_noise(n)], len(clean) - 1, rng)
    return noisy


def folded(kernel: torch.Tensor) -> torch.Tensor:
    """What a transposed convolution makes of constant fields: a linear map, ``[input, 3 * 3 * 3]``, channels first."""
    count = len(kernel)
    fields = torch.eye(count, dtype=kernel.dtype)[:, :, None, None].expand(count, count, 3, 3)
    cells = functional.conv_transpose2d(fields, kernel, stride=STRIDE, padding=1)
    return cells[:, :, STRIDE : 2 * STRIDE, STRIDE : 2 * STRIDE].reshape(count, -1)  # the cell that has all neighbours


def unfolded(kernel: torch.Tensor) -> torch.Tensor:
    """What a convolution makes of textures that repeat: a linear map, ``[3 * 3 * 3, input]``."""
    room = 3 * STRIDE**2
    textures = torch.eye(room, dtype=kernel.dtype).reshape(room, 3, STRIDE, STRIDE).repeat(1, 1, 3, 3)
    return functional.conv2d(textures, kernel, stride=STRIDE, padding=1)[:, :, 1, 1]


def contrast_shortfall(textures: torch.Tensor, training: Training) -> torch.Tensor:
    """Sum over pairs of textures ``[look, 3 * 3 * 3]`` of the squares by which they differ too little, per look."""
    first, second = torch.triu_indices(len(textures), len(textures), 1)
    difference = textures[first] - textures[second]
    whole = _root((difference**2).mean(1))
    colour = _root((difference.reshape(len(difference), 3, -1).mean(2) ** 2).mean(1))
    is_chief = torch.tensor([False, *(isinstance(kind, CHIEF) for kind in KINDS + EXTREMES)])
    wanted = torch.where(is_chief[first] | is_chief[second], training.chief_contrast, 1.0)
    wanted = torch.where(first == 0, training.floor_contrast, wanted)  # the floor comes first
    missing = functional.relu(training.texture_contrast * wanted - whole) ** 2
    missing = missing + functional.relu(training.colour_contrast * wanted - colour) ** 2
    return missing.sum() / len(textures)


def _root(square: torch.Tensor) -> torch.Tensor:
    return (square + 1e-9).sqrt()  # with a gradient at 0
