"""Textured pixels: the arena from above, each thing in a pattern that shows its factors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from segar.errors import SegarError, did_you_mean
from segar.language import Factor, Floor
from segar.observations.composed.checked_memory import checked_memory
from segar.observations.pixels import texture_kernel
from segar.observations.pixels.canvas import LUMA, Channels, canvas_for, check_frame, frame_space
from segar.observations.pixels.drawing import Drawing
from segar.observations.pixels.solid_colours import OUTLINES
from segar.support import stream_key
from segar.textures import TextureSet, name_of_input, type_inputs

if TYPE_CHECKING:
    from segar.levels import Levels

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
                raise SegarError(
                    f"TexturedPixels: {option} must be {' or '.join(map(repr, known))}, not {value!r}."
                    f"{did_you_mean(str(value), known)}"
                )
        object.__setattr__(self, "hidden", tuple(self.hidden))
        textures = self.texture_set
        for strange in sorted({name_of_input(h) for h in self.hidden} - set(textures.inputs)):
            raise SegarError(
                f"TexturedPixels: textures '{textures.name}' do not show '{strange}', so it cannot be hidden."
                f"{did_you_mean(strange, textures.inputs)}"
            )

    @property
    def texture_set(self) -> TextureSet:
        """The textures, loaded."""
        return self.textures if isinstance(self.textures, TextureSet) else TextureSet.load(self.textures)

    def shows(self, factor: type[Factor]) -> bool:
        """Whether frames may depend on the factor: on what decides outlines, or on an input that is not hidden."""
        shown = set(self.texture_set.inputs) - {name_of_input(h) for h in self.hidden}
        return issubclass(factor, OUTLINES) or any(parent.__name__ in shown for parent in factor.__mro__)

    def in_planes(self) -> TexturedPixels:
        """The same frames with their channels first."""
        return replace(self, channels="first")

    def bind(self, levels: Levels, num_envs: int) -> BoundTexturedPixels:
        """The observation at work: holds one background per environment, as large as a frame, and all patterns."""
        return BoundTexturedPixels(self, levels, num_envs)


class BoundTexturedPixels:
    """:class:`TexturedPixels` in one environment; see :class:`segar.observations.protocol.HasMemory`.

    Snapshots hold the features of the patterns: what they were made of at the start of an episode is not in its state.
    """

    def __init__(self, pixels: TexturedPixels, levels: Levels, num_envs: int) -> None:
        textures, entities = pixels.texture_set, levels.types.shape[1]
        inputs = type_inputs(textures, levels.layout, pixels.hidden)
        self._options = pixels
        self._loom = texture_kernel.Loom(
            levels.types,
            np.array([Floor in t.declared for t in levels.layout.types]),
            inputs.columns,
            inputs.constants,
            inputs.noise,
            textures.shift,
            textures.scale,
            textures.weights.reshape(len(textures), len(textures.inputs), -1).astype(np.float64),
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
        self._recalled = False

    def start(self, key: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Draw the noise and the models of the environments where ``mask`` is true."""
        rows = np.flatnonzero(mask)
        keys = {
            "episode": key[rows] ^ self._key,
            "level": self._level_keys[level[rows]],
            "never": np.full(len(rows), self._key),
        }
        texture_kernel.draw_noise(keys[self._options.noise], rows, self._noise)
        texture_kernel.draw_models(keys[self._options.model], rows, len(self._loom.bias), self._drawing.floor)

    def begin(self, values: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Make the patterns of the environments where ``mask`` is true, and paint their backgrounds."""
        rows = np.flatnonzero(mask)
        if not self._recalled:
            texture_kernel.read_features(values, level, rows, self._loom, self._noise, self._features)
        self._recalled = False
        texture_kernel.weave_things(
            level, rows, self._loom, self._drawing.floor, self._features, self._scratch(), self._drawing.texels
        )
        self._drawing.paint(values, level, rows)

    def write(self, values: np.ndarray, level: np.ndarray, out: np.ndarray, rows: np.ndarray) -> None:
        """Draw the frames of environments ``rows`` (int64) into ``out``, uint8 ``[env, *space.shape]``."""
        if self._options.follow:
            texture_kernel.follow_changes(
                values, level, rows, self._loom, self._drawing.floor, self._noise, self._features, self._scratch(),
                self._drawing.texels,
            )  # fmt: skip
        self._drawing.draw(values, level, out, rows)

    def memory(self) -> dict[str, np.ndarray]:
        """The features of all patterns."""
        return {"features": self._features.copy()}

    def recall(self, memory: Mapping[str, np.ndarray]) -> None:
        """Make the next patterns from these features instead of the state's."""
        features = checked_memory(memory, "features", self._features)
        if features is not None:
            self._features[:] = features
            self._recalled = True

    def _scratch(self) -> np.ndarray:
        return np.empty(self._loom.bias.shape[1])


def _keys_of(levels: Levels, seed: int) -> tuple[np.uint64, np.ndarray]:
    """A key of the seed, and one for each level, uint64 ``[level]``, which it has in every set that holds it."""
    origin = levels.provenance
    of_split = stream_key("textures", seed, origin.distribution, origin.seed, origin.split)
    steps = origin.indices.astype(np.uint64) * np.uint64(texture_kernel.GOLDEN)
    return np.uint64(stream_key("textures", seed)), np.uint64(of_split) + steps
