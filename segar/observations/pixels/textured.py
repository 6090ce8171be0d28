"""Textured pixels: the arena from above, each thing in a pattern that shows its factors; and the compiled kernels that make
patterns of factors, as ``TextureSet.patches`` defines them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np

from segar.engine import Call, Given, Rows, Scratch, call_of
from segar.errors import SegarError, must_be
from segar.language import Factor, Floor
from segar.levels import Levels
from segar.observations.composed.composed import recall_array
from segar.observations.copying import KERNEL_OPTIONS
from segar.observations.pixels.drawing import LUMA, Channels, Drawing, canvas_for, check_frame, frame_space
from segar.observations.pixels.solid_colours import OUTLINES
from segar.support import GOLDEN, cached, mathematics, mix, normal, stream_key, uniform
from segar.textures import NOISE_CLIP, TextureSet, hidden_inputs, type_inputs

REDRAWN = ("episode", "level", "never")


@dataclass(frozen=True)
class TexturedPixels:
    """Frames as :class:`segar.observations.pixels.Pixels` draws them, but everything is in a pattern of its factors.

    A thing's pattern is made when the episode starts, from the values that its factors have then and from noise of its
    own. It moves with the thing. The floor has a pattern, too. Outlines stay black.

    Args:
        textures: the set of models that turn factors into patterns, the name of one that comes with SEGAR, or the
            path of a file. Which of its models an episode shows is drawn.
        resolution: side of the frame in pixels, a multiple of 4 from 32 to 256.
        hidden: inputs of the textures (factors or entity types, as classes or by name) that patterns do not show.
        noise: when the noise of patterns is drawn anew. Drawn per "level", the same thing of a level looks the same in
            every episode; drawn "never", the things in one slot do so in all levels.
        model: whether the model is drawn per "episode" or per "level".
        follow: whether an object's pattern changes when one of its factors does within an episode. (In 2022 it did
            not.) Otherwise patterns follow interventions alone.
        grey: whether frames show the luma of the colours alone, one number per pixel.
        channels: whether the axis of the colours is the "last" or the "first" of a frame.
        seed: of the draws of noise and models; what is drawn per episode follows from the episode's seed, too.

    Raises:
        SegarError: an option is not one of these, there are no such textures, or something hidden is not an input.
    """

    textures: str | TextureSet = "one"
    resolution: int = 64
    hidden: tuple[Any, ...] = ()
    noise: Literal["episode", "level", "never"] = "episode"
    model: Literal["episode", "level"] = "episode"
    follow: bool = False
    grey: bool = False
    channels: Channels = "last"
    seed: int = 0

    def __post_init__(self) -> None:
        check_frame("TexturedPixels", self.resolution, self.channels)
        for option, value, known in (("noise", self.noise, REDRAWN), ("model", self.model, REDRAWN[:2])):
            if value not in known:
                raise SegarError(f"TexturedPixels: {option} {must_be(value, known)}")
        object.__setattr__(self, "hidden", tuple(self.hidden))
        hidden_inputs(self.texture_set, self.hidden)

    @property
    def texture_set(self) -> TextureSet:
        """The textures, loaded."""
        return self.textures if isinstance(self.textures, TextureSet) else TextureSet.load(self.textures)

    def shows(self, factor: type[Factor]) -> bool:
        """Whether frames may depend on the factor: on what decides outlines, or on an input that is not hidden."""
        shown = set(self.texture_set.inputs) - hidden_inputs(self.texture_set, self.hidden)
        return issubclass(factor, OUTLINES) or any(parent.__name__ in shown for parent in factor.__mro__)

    def in_planes(self) -> TexturedPixels:
        """The same frames with their channels first."""
        return replace(self, channels="first")

    def bind(self, levels: Levels, num_envs: int) -> BoundTexturedPixels:
        """The observation at work: holds one background per environment, as large as a frame, and all patterns."""
        return BoundTexturedPixels(self, levels, num_envs)


class BoundTexturedPixels:
    """:class:`TexturedPixels` in one environment.

    Snapshots hold the features of the patterns: what they were made of at the start of an episode is not in its state.
    """

    def __init__(self, pixels: TexturedPixels, levels: Levels, num_envs: int) -> None:
        textures, entities = pixels.texture_set, levels.types.shape[1]
        inputs = type_inputs(textures, levels.layout, pixels.hidden)
        shown = (inputs.columns >= 0).any(axis=0) | inputs.constants.any(axis=0) | (inputs.noise >= 0)
        self._options = pixels
        self._loom = Loom(
            levels.types,
            np.array([Floor in t.declared for t in levels.layout.types]),
            inputs.columns,
            inputs.constants,
            inputs.noise,
            textures.shift,
            textures.scale,
            np.where(shown[:, None], textures.weights.reshape(len(textures), len(shown), -1), 0.0).astype(np.float64),
            textures.bias.reshape(len(textures), -1).astype(np.float64),
            textures.squash == "tanh",
            np.array(LUMA if pixels.grey else (0, 0, 0), np.int64),
        )
        models = np.arange(len(textures))
        floors = textures.patches(np.broadcast_to(textures.background(), (len(models), len(textures.inputs))), models)
        self.space = frame_space(pixels.resolution, pixels.grey, pixels.channels)
        canvas = canvas_for(pixels.resolution, pixels.grey, pixels.channels, levels)
        self._drawing = Drawing(canvas, levels, num_envs, floors)
        self._key, self._level_keys = _keys_of(levels, pixels.seed)
        self._noise = np.zeros((num_envs, entities, inputs.draws))
        self._features = np.zeros((num_envs, entities, len(textures.inputs)))
        draws = (pixels.noise, inputs.draws > 0), (pixels.model, len(textures) > 1)
        self.draws_per_episode = any(when == "episode" and needed for when, needed in draws)
        self._redrawn = REDRAWN.index(pixels.noise), REDRAWN.index(pixels.model)
        self._recalled = False

    def start(self, key: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Draw the noise and the models of the environments where ``mask`` is true."""
        rows, models = np.flatnonzero(mask), len(self._loom.bias)
        draw_looks(
            key, level, rows, self._key, self._level_keys, *self._redrawn, models, self._noise, self._drawing.floor
        )

    def begin(self, values: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Make the patterns of the environments where ``mask`` is true, and paint their backgrounds."""
        rows = np.flatnonzero(mask)
        if not self._recalled:
            read_features(values, level, rows, self._loom, self._noise, self._features)
        self._recalled = False
        weave_things(
            level, rows, self._loom, self._drawing.floor, self._features, self._scratch(), self._drawing.texels
        )
        self._drawing.paint(values, level, rows)

    def write(self, values: np.ndarray, level: np.ndarray, out: np.ndarray, rows: np.ndarray) -> None:
        """Draw the frames of environments ``rows`` (int64) into ``out``, uint8 ``[env, *space.shape]``."""
        if self._options.follow:
            follow_changes(
                values, level, rows, self._loom, self._drawing.floor, self._noise, self._features, self._scratch(),
                self._drawing.texels,
            )  # fmt: skip
        self._drawing.draw(values, level, out, rows)

    def memory(self) -> dict[str, np.ndarray]:
        """The features of all patterns."""
        return {"features": self._features.copy()}

    def recall(self, memory: Mapping[str, np.ndarray]) -> None:
        """Make the next patterns from these features instead of the state's."""
        if recall_array(memory, "features", self._features):
            self._recalled = True

    def calls(self, when: str, in_rows: bool = False) -> list[Call]:
        """What ``start``, ``begin`` and ``write`` do, for other targets; see :class:`segar.observations.RunsOnTargets`."""
        values, level = self._drawing.states
        looms, raw = (self._loom, self._drawing.floor), Scratch(float, self._loom.bias.shape[1])
        if when == "start":
            made = (len(self._loom.bias), self._noise, self._drawing.floor)
            arguments = [Given("uint64", ("envs",)), level, Rows(), self._key, self._level_keys, *self._redrawn, *made]
            return [call_of("draw_looks", draw_looks, arguments, LOOM_SIZES)]
        found = []
        if when == "begin":
            arguments = [values, level, Rows(), self._loom, self._noise, self._features]
            found.append(call_of("read_features", read_features, arguments, LOOM_SIZES))
            arguments = [level, Rows(), *looms, self._features, raw, self._drawing.texels]
            found.append(call_of("weave_things", weave_things, arguments, LOOM_SIZES))
        elif when == "write" and self._options.follow:
            arguments = [values, level, Rows(), *looms, self._noise, self._features, raw, self._drawing.texels]
            found.append(call_of("follow_changes", follow_changes, arguments, LOOM_SIZES))
        return found + self._drawing.calls(when, in_rows)

    def _scratch(self) -> np.ndarray:
        return np.empty(self._loom.bias.shape[1])


def _keys_of(levels: Levels, seed: int) -> tuple[np.uint64, np.ndarray]:
    """A key of the seed, and one for each level, uint64 ``[level]``, which it has in every set that holds it."""
    origin = levels.provenance
    of_split = stream_key("textures", seed, origin.distribution, origin.seed, origin.split)
    steps = origin.indices.astype(np.uint64) * np.uint64(GOLDEN)
    return np.uint64(stream_key("textures", seed)), np.uint64(of_split) + steps


class Loom(NamedTuple):
    """What the kernels know of a set of textures and of the entity types that they show.

    ``types``, ``is_floor``: as in :class:`segar.observations.pixels.drawing.FrameGeometry`; ``columns``, ``constants``,
    ``noise``: as in :class:`segar.textures.TypeInputs`; the others as in :class:`segar.textures.TextureSet`, in float64.
    """

    types: np.ndarray
    is_floor: np.ndarray
    columns: np.ndarray
    constants: np.ndarray
    noise: np.ndarray
    shift: np.ndarray
    scale: np.ndarray
    weights: np.ndarray
    """``[model, input, P * P * 3]``"""
    bias: np.ndarray
    """``[model, P * P * 3]``"""
    bends: bool
    """Whether the squash is tanh; else it clips."""
    luma: np.ndarray
    """int64 ``[3]``, weights of red, green and blue in grey, in thousandths; all 0 for RGB frames."""


LOOM_SIZES: dict[str, tuple[str | None, ...]] = {
    **{"loom_types": ("levels", None), "level_keys": ("levels",), "model": ("envs",), "noise": ("envs", None, None)},
    **{"features": ("envs", None, None), "texels": ("envs", None, None, None, None)},
}
"""Names of the sizes of what kernels of patterns are called with."""


@cached(**KERNEL_OPTIONS)
def draw_looks(key, level, rows, own, level_keys, noise_by, model_by, models, noise, model):
    """Draw noise and models of environments ``rows``.

    Args:
        key: uint64 ``[env]``, of the episodes; ``level_keys``: uint64 ``[level]``; ``own``: the key of the seed.
        noise_by, model_by: by which of ``REDRAWN`` they are drawn.
        models: how many there are.
        noise: float64 ``[env, entity, draw]``, from N(0, 1), clipped; each by its key, entity and number.
        model: int64 ``[env]``, numbers below ``models``, each by its key.
    """
    for r in range(len(rows)):
        env = rows[r]
        of_noise = key_of(noise_by, env, key, level, own, level_keys)
        for entity in range(noise.shape[1]):
            bits = mix(of_noise + np.uint64(entity + 1) * np.uint64(GOLDEN))
            for draw in range(noise.shape[2]):
                bits = mix(bits + np.uint64(GOLDEN))
                noise[env, entity, draw] = min(max(normal(bits), -NOISE_CLIP), NOISE_CLIP)
        model[env] = np.int64(uniform(mix(key_of(model_by, env, key, level, own, level_keys))) * models)


@cached(**KERNEL_OPTIONS)
def key_of(redrawn, env, key, level, own, level_keys):
    """The key of a draw that is made anew by this entry of ``REDRAWN``."""
    if redrawn == 0:
        return key[env] ^ np.uint64(own)
    return level_keys[level[env]] if redrawn == 1 else np.uint64(own)


@cached(**KERNEL_OPTIONS)
def read_features(values, level, rows, loom, noise, features):
    """Fill ``features[rows]``, float64 ``[env, entity, input]``."""
    for r in range(len(rows)):
        env = rows[r]
        for entity in range(loom.types.shape[1]):
            kind = loom.types[level[env], entity]
            if kind >= 0:
                for i in range(features.shape[2]):
                    features[env, entity, i] = feature(values, env, entity, kind, i, loom, noise)


@cached(**KERNEL_OPTIONS)
def weave_things(level, rows, loom, model, features, raw, texels):
    """Make the patterns of all things of environments ``rows`` from their features; ``raw``: float64 ``[P * P * 3]``."""
    for r in range(len(rows)):
        env = rows[r]
        for entity in range(loom.types.shape[1]):
            if loom.types[level[env], entity] >= 0:
                weave(env, entity, loom, model[env], features, raw, texels)


@cached(**KERNEL_OPTIONS)
def follow_changes(values, level, rows, loom, model, noise, features, raw, texels):
    """Make anew the patterns of objects whose features have changed."""
    for r in range(len(rows)):
        env = rows[r]
        for entity in range(loom.types.shape[1]):
            kind = loom.types[level[env], entity]
            if kind < 0 or loom.is_floor[kind]:
                continue
            changed = False
            for i in range(features.shape[2]):
                now = feature(values, env, entity, kind, i, loom, noise)
                changed |= now != features[env, entity, i]
                features[env, entity, i] = now
            if changed:
                weave(env, entity, loom, model[env], features, raw, texels)


@cached(**KERNEL_OPTIONS)
def feature(values, env, entity, kind, i, loom, noise):
    """The feature of input i for an entity of type ``kind``."""
    if loom.noise[i] >= 0:
        return noise[env, entity, loom.noise[i]] * loom.scale[i]
    if loom.columns[kind, i] < 0:
        return loom.constants[kind, i]
    value = (values[env, entity, loom.columns[kind, i]] - loom.shift[i]) * loom.scale[i]
    return value if math.isfinite(value) else 0.0


@cached(**KERNEL_OPTIONS)
def weave(env, entity, loom, model, features, raw, texels):
    """Make one thing's pattern: one period from its features, repeated to the end of each row."""
    for k in range(len(raw)):
        raw[k] = loom.bias[model, k]
    for i in range(features.shape[2]):
        f = features[env, entity, i]
        if f != 0.0:
            for k in range(len(raw)):
                raw[k] += f * loom.weights[model, i, k]
    for k in range(len(raw)):
        y = mathematics.tanh(raw[k]) if loom.bends else min(max(raw[k], -1.0), 1.0)
        raw[k] = np.floor(255.0 * (y + 1.0) / 2.0)
    period, planes = texels.shape[3], texels.shape[2]
    for row in range(period):
        for column in range(period):
            at = (row * period + column) * 3
            if loom.luma[1] > 0:
                texels[env, entity, 0, row, column] = luma_of(raw, at, loom.luma)
            else:
                for c in range(3):
                    plane, to = (c, column) if planes == 3 else (0, 3 * column + c)
                    texels[env, entity, plane, row, to] = np.uint8(raw[at + c])
    back = period if planes == 3 or loom.luma[1] > 0 else 3 * period
    for plane in range(planes):
        for row in range(period):
            for k in range(back, texels.shape[4]):
                texels[env, entity, plane, row, k] = texels[env, entity, plane, row, k - back]


@cached(**KERNEL_OPTIONS)
def luma_of(raw, at, luma):
    """The grey of three numbers from 0 to 255, as :func:`segar.observations.pixels.drawing.grey_of` rounds it."""
    total = luma[0] * int(raw[at]) + luma[1] * int(raw[at + 1]) + luma[2] * int(raw[at + 2])
    return np.uint8((total + 500) // 1000)
