"""Sets of textures: what a thing's factors look like, periodic patterns that are linear in the factors but for a squash."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from segar.errors import SegarError, did_you_mean, naming
from segar.language import Entity
from segar.support import ArchiveFormat, Form, counted
from segar.textures.inputs import BACKGROUND, entity_values, is_noise, name_of_input

ARRAYS = {
    "weights": Form("float32", ("models", "inputs", "P", "P", 3)),
    "bias": Form("float32", ("models", "P", "P", 3)),
    "shift": Form("float64", ("inputs",)),
    "scale": Form("float64", ("inputs",)),
}
DESCRIPTION = {"name": str, "inputs": [str], "squash": str, "origin": {}}
FORMAT = ArchiveFormat("segar-textures", 1, "textures", "texture file", SegarError, DESCRIPTION)
SQUASHES = ("tanh", "clip")
DATA = Path(__file__).parent / "data"


@dataclasses.dataclass(frozen=True, eq=False)
class TextureSet:
    """One or more models that turn factors into a texture of P x P pixels, repeated without end.

    A value v of input i enters as the feature ``(v - shift[i]) * scale[i]``; what an entity lacks, and what is hidden,
    enters as the feature 0. The texture of features f under a model is::

        y = squash(bias + sum over i of f[i] weights[i])       in float64; tanh, or clip to [-1, 1]
        patch = uint8(trunc(255 (y + 1) / 2))

    A thing's pattern is fixed to its centre and moves with it: the pixel in row r and column c of the picture shows
    ``patch[(r - r0) % P, (c - c0) % P]``, where (r0, c0) is the pixel of the thing's position. The floor's is fixed to
    the picture's upper left corner.

    Attributes:
        name: of the set.
        inputs: what enters, in order: ``"background"`` (1 for the floor of the arena, 0 for things), names of factors,
            of entity types, and ``"noise_1"`` and so on; see :mod:`segar.textures.inputs`. Factors and entity types may
            be given as classes.
        weights: float32 ``[model, input, P, P, 3]``, RGB.
        bias: float32 ``[model, P, P, 3]``.
        shift, scale: float64 ``[input]``; the scale of a noise input multiplies a draw from N(0, 1) clipped to [-1, 1].
        squash: ``"tanh"`` or ``"clip"``.
        origin: how it was made, for people: names to texts and numbers.

    Raises:
        SegarError: shapes do not fit each other, an input stands twice, or a number is not finite.
    """

    name: str
    inputs: tuple[str, ...]
    weights: np.ndarray
    bias: np.ndarray
    shift: np.ndarray
    scale: np.ndarray
    squash: str = "tanh"
    origin: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "inputs", tuple(name_of_input(i) for i in self.inputs))
        for field, dtype in (("weights", np.float32), ("bias", np.float32), ("shift", float), ("scale", float)):
            array = np.array(getattr(self, field), dtype=dtype, order="C")
            array.setflags(write=False)
            set_(self, field, array)
        _check(self)

    @property
    def period(self) -> int:
        """P, in pixels."""
        return self.weights.shape[2]

    def __len__(self) -> int:
        """How many models there are."""
        return len(self.weights)

    def __getitem__(self, models: int | slice | Sequence[int]) -> TextureSet:
        """The set of some of the models."""
        picked = np.atleast_1d(np.arange(len(self))[models])
        return dataclasses.replace(self, weights=self.weights[picked], bias=self.bias[picked])

    def __repr__(self) -> str:
        inputs = counted(len(self.inputs), "input")
        return f"<textures '{self.name}': {counted(len(self), 'model')}, {inputs}, period {self.period}>"

    def values(self, entity: Entity) -> np.ndarray:
        """Values of the inputs for an entity such as ``GolfBall({Mass: 2.0})``, float64 ``[input]``; nan: it lacks that."""
        return entity_values(self.inputs, entity)

    def features(self, values: Any) -> np.ndarray:
        """Features of values of the inputs, float64 ``[..., input]`` both; nan, a factor that is absent, becomes 0."""
        features = (np.asarray(values, dtype=float) - self.shift) * self.scale
        return np.where(np.isnan(features), 0.0, features)

    def background(self) -> np.ndarray:
        """Features of the floor of the arena, float64 ``[input]``."""
        features = np.zeros(len(self.inputs))
        if BACKGROUND in self.inputs:
            features[self.inputs.index(BACKGROUND)] = 1.0
        return features

    def patches(self, features: Any, model: Any = 0) -> np.ndarray:
        """Textures, uint8 ``[..., P, P, 3]``.

        Args:
            features: float ``[..., input]``, as :meth:`features` returns them.
            model: index of a model, or an array of them that broadcasts with ``[...]``.

        Raises:
            SegarError: there are not as many features as inputs, or there is no such model.
        """
        features = np.asarray(features, dtype=float)
        if features.shape[-1:] != (len(self.inputs),):
            raise SegarError(
                f"textures '{self.name}' take {len(self.inputs)} features ({', '.join(self.inputs)}), not an array of"
                f" shape {features.shape}"
            )
        model = np.asarray(model)
        if not np.issubdtype(model.dtype, np.integer) or (model < 0).any() or (model >= len(self)).any():
            raise SegarError(f"textures '{self.name}' have models 0 to {len(self) - 1}, not {model!r}")
        raw = self.raw(features, model)
        y = np.tanh(raw) if self.squash == "tanh" else np.clip(raw, -1.0, 1.0)
        return (255.0 * (y + 1.0) / 2.0).astype(np.uint8)

    def raw(self, features: np.ndarray, model: Any = 0) -> np.ndarray:
        """What is squashed: ``bias + features . weights``, float64 ``[..., P, P, 3]``."""
        shape = np.broadcast_shapes(np.shape(model), features.shape[:-1])
        features = np.broadcast_to(features, (*shape, len(self.inputs)))
        if np.ndim(model) == 0:
            return self.bias[model] + np.tensordot(features, self.weights[model].astype(float), axes=1)
        model = np.broadcast_to(model, shape)
        result = np.empty((*shape, *self.bias.shape[1:]))
        for one in np.unique(model):
            result[model == one] = self.raw(features[model == one], int(one))
        return result

    def save(self, path: str | PathLike[str]) -> None:
        """Write the set to ``path`` (npz without pickle). An existing file is replaced only by a complete one.

        Raises:
            SegarError: the file cannot be written.
        """
        arrays = {field: getattr(self, field) for field in ARRAYS}
        description = {
            "name": self.name,
            "inputs": list(self.inputs),
            "squash": self.squash,
            "origin": dict(self.origin),
        }
        FORMAT.write(Path(path), arrays, description)

    @classmethod
    def load(cls, name: str | PathLike[str]) -> TextureSet:
        """The shipped set of that name (see :func:`shipped_sets`), or the one in a file that ``save`` wrote.

        Raises:
            SegarError: there is no such set or file, or the file is no texture file or incomplete.
        """
        path = Path(name)
        if path.suffix != ".npz":
            if str(name) not in shipped_sets():
                raise SegarError(
                    f"there are no textures '{name}'.{did_you_mean(str(name), shipped_sets())} Of a file, give the path"
                    " with .npz"
                )
            path = DATA / f"{name}.npz"

        arrays, description = FORMAT.read(path, lambda description: ARRAYS)
        with naming(path):
            return cls(**arrays, **{name: description[name] for name in DESCRIPTION})


def hidden_inputs(textures: TextureSet, hidden: Iterable[Any]) -> set[str]:
    """The names of inputs that are hidden, given as classes or names; raises :class:`SegarError` for what is no input."""
    names = {name_of_input(thing) for thing in hidden}
    for name in sorted(names - set(textures.inputs)):
        raise SegarError(
            f"textures '{textures.name}' do not show '{name}', so it cannot be hidden."
            f"{did_you_mean(name, textures.inputs)}"
        )
    return names


def shipped_sets() -> tuple[str, ...]:
    """Names of the sets that come with SEGAR."""
    return tuple(sorted(path.stem for path in DATA.glob("*.npz")))


def _check(textures: TextureSet) -> None:
    """Raise :class:`SegarError` unless the arrays fit the inputs and each other."""
    where, inputs, shape = f"TextureSet '{textures.name}'", textures.inputs, textures.weights.shape
    for name in inputs:
        if inputs.count(name) > 1:
            raise SegarError(f"{where}: the input '{name}' stands twice")
    if textures.squash not in SQUASHES:
        raise SegarError(
            f"{where}: squash must be 'tanh' or 'clip', not {textures.squash!r}.{did_you_mean(str(textures.squash), SQUASHES)}"
        )
    if len(shape) != 5 or 0 in shape or shape[1:] != (len(inputs), shape[2], shape[2], 3):
        raise SegarError(
            f"{where}: weights must have the shape [model, {len(inputs)} inputs, P, P, 3], not {list(shape)}"
        )
    expected = {"bias": (shape[0], *shape[2:]), "shift": (len(inputs),), "scale": (len(inputs),)}
    for field in ("weights", *expected):
        array = getattr(textures, field)
        if array.shape != expected.get(field, shape):
            raise SegarError(f"{where}: {field} must have the shape {list(expected[field])}, not {list(array.shape)}")
        if not np.isfinite(array).all():
            raise SegarError(f"{where}: {field} has numbers that are not finite")
    for name, shift in zip(inputs, textures.shift, strict=True):
        if (name == BACKGROUND or is_noise(name)) and shift != 0.0:
            raise SegarError(f"{where}: the shift of '{name}' must be 0")
