"""Banks of filters such as the first layer of an image network: from a file of weights, or our own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from segar.errors import SegarError, naming
from segar.support import Form, need, open_npz, opened

SMALLEST, LARGEST = 2, 32  # [pixels] sides of filters that are taken for a first layer


@dataclass(frozen=True, eq=False)
class FilterBank:
    """Filters of RGB pictures, float32 ``[filter, 3, k, k]``, and where they come from.

    Raises:
        SegarError: the array has another shape, numbers that are not finite, or a filter that is 0.
    """

    name: str
    filters: np.ndarray

    def __post_init__(self) -> None:
        filters = np.array(self.filters, dtype=np.float32, order="C")
        if filters.ndim != 4 or filters.shape[1] != 3 or filters.shape[2] != filters.shape[3]:
            raise SegarError(f"filters '{self.name}' must have the shape [filter, 3, k, k], not {list(filters.shape)}")
        if not np.isfinite(filters).all() or not filters.any(axis=(1, 2, 3)).all():
            raise SegarError(
                f"filters '{self.name}' have numbers that are not finite, or filters that are 0 everywhere"
            )
        filters.setflags(write=False)
        object.__setattr__(self, "filters", filters)

    @property
    def size(self) -> int:
        """k, in pixels."""
        return self.filters.shape[-1]

    def __len__(self) -> int:
        """How many filters there are."""
        return len(self.filters)

    def __repr__(self) -> str:
        return f"<{len(self)} filters '{self.name}' of {self.size} x {self.size} pixels>"

    def normalised(self) -> np.ndarray:
        """The filters with a root mean square of 1 each, float64 ``[filter, k, k, 3]``."""
        filters = self.filters.astype(float).transpose(0, 2, 3, 1)
        return filters / np.sqrt((filters**2).mean(axis=(1, 2, 3), keepdims=True))

    @classmethod
    def load(cls, path: str | PathLike[str], key: str | None = None) -> FilterBank:
        """The filters of the first convolution in a file of weights, ``.npz`` or ``.safetensors``.

        It is the only array of shape ``[filter, 3, k, k]`` (PyTorch) or ``[k, k, 3, filter]`` (Keras).

        Args:
            key: the name of the array in the file; needed where several have such a shape.

        Raises:
            SegarError: there is no such file or array, or several; ``.safetensors`` needs the extra ``filters``.
        """
        path = Path(path)
        readers = {".npz": _read_npz, ".safetensors": _read_safetensors}
        if path.suffix not in readers:
            raise SegarError(f"{path}: a file of weights must end in .npz or .safetensors")
        if not path.is_file():
            raise SegarError(f"there is no file of weights {path}")
        found = readers[path.suffix](path, key)
        if key is not None and key not in found:
            raise SegarError(f"{path} has no filters '{key}' of shape [filter, 3, k, k]; it has {_listed(found)}")
        if len(found) != 1 and key is None:
            raise SegarError(
                f"{path} has {len(found) or 'no'} arrays of shape [filter, 3, k, k]"
                + (f" ({_listed(found)}): name one with key=" if found else ": is it an image network?")
            )
        with naming(path):
            return cls(path.stem, next(iter(found.values())) if key is None else found[key])

    @classmethod
    def built_in(cls, rng: np.random.Generator, count: int = 192, size: int = 5) -> FilterBank:
        """Filters like those that image networks learn first, drawn by ``rng``: no file is needed.

        A third are blobs of colour; the others are Gabor filters, half in black and white and half between opponent
        colours, in all orientations and phases and of wavelengths from 2.5 pixels to the size. All have a share of plain
        colour.

        Raises:
            SegarError: fewer than 3 filters, or a size that is not from 3 to 32 pixels.
        """
        if count < 3 or not 3 <= size <= LARGEST:
            raise SegarError(f"a bank needs 3 filters or more of 3 to {LARGEST} pixels, not {count} of {size!r}")
        axis = np.arange(size) - (size - 1) / 2
        y, x = np.meshgrid(axis, axis, indexing="ij")
        envelope = np.exp(-(x**2 + y**2) / (2 * (size / 3) ** 2))
        orientation = np.pi * _spread_out(count, rng)
        phase = 2 * np.pi * _spread_out(count, rng)
        wavelength = 2.5 * (size / 2.5) ** _spread_out(count, rng)
        hue = 2 * np.pi * _spread_out(count, rng)
        kind = rng.permutation(np.arange(count) % 3)
        along = np.cos(orientation)[:, None, None] * x + np.sin(orientation)[:, None, None] * y
        wave = envelope * np.cos(2 * np.pi * along / wavelength[:, None, None] + phase[:, None, None])
        plain = rng.uniform(0.3, 1.0, count) * np.where(kind == 0, 2.0, 1.4)
        grey = np.full((count, 3), 3**-0.5) * np.sign(np.cos(hue))[:, None]
        lightness = rng.uniform(-0.7, 0.7, (count, 1))
        colour = _opponent(hue) + lightness * np.full(3, 3**-0.5)
        carrier = np.where((kind == 1)[:, None], grey, _opponent(hue + np.pi / 2 * rng.choice([-1, 1], count)))
        carrier = np.where((kind == 0)[:, None], 0.3 * carrier, carrier)
        filters = wave[:, None] * carrier[:, :, None, None]
        filters += (plain[:, None] * colour)[:, :, None, None] * envelope * np.sqrt((wave**2).mean())
        return cls("gabor", filters)


def _spread_out(count: int, rng: np.random.Generator) -> np.ndarray:
    """Numbers in [0, 1), one in each of ``count`` equal parts, in random order."""
    return (rng.permutation(count) + rng.random(count)) / count


def _opponent(angle: np.ndarray) -> np.ndarray:
    """Unit vectors in the plane of colours without lightness, ``[..., 3]``: red to green, and blue to yellow."""
    red_green, blue_yellow = np.array([1.0, -1.0, 0.0]) / 2**0.5, np.array([-1.0, -1.0, 2.0]) / 6**0.5
    return np.cos(angle)[..., None] * red_green + np.sin(angle)[..., None] * blue_yellow


def _read_npz(path: Path, key: str | None) -> dict[str, np.ndarray]:
    with open_npz(path, "file of weights", SegarError) as npz:
        headers = {name: npz.header(name) for name in (npz.names if key is None else {key} & {*npz.names})}
        banks = {name: h for name, h in headers.items() if _is_bank(h.shape) and h.dtype.kind in "iuf"}
        return _filters_among(npz.read({name: Form(str(h.dtype), h.shape) for name, h in banks.items()}))


def _read_safetensors(path: Path, key: str | None) -> dict[str, np.ndarray]:
    need(f"reading {path}", "safetensors")
    from safetensors import SafetensorError, safe_open

    try:
        with opened(path, "file of weights", SegarError), safe_open(path, framework="numpy") as archive:
            shapes = {name: tuple(archive.get_slice(name).get_shape()) for name in archive.keys()}
            wanted = [name for name, shape in shapes.items() if _is_bank(shape) and key in (None, name)]
            return _filters_among({name: archive.get_tensor(name) for name in wanted})
    except (SafetensorError, TypeError) as error:
        raise SegarError(f"{path} cannot be read as .safetensors: {error}") from error


def _filters_among(arrays: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Those that are filters of RGB pictures, with channels before rows and columns."""
    found = {name: array for name, array in arrays.items() if _is_bank(array.shape)}
    return {n: a if _is_torch_bank(a.shape) else a.transpose(3, 2, 0, 1) for n, a in found.items()}


def _is_bank(shape: tuple[int, ...]) -> bool:
    return len(shape) == 4 and (_is_torch_bank(shape) or _is_torch_bank((shape[3], shape[2], *shape[:2])))


def _is_torch_bank(shape: tuple[int, ...]) -> bool:
    return shape[1] == 3 and shape[2] == shape[3] and SMALLEST <= shape[2] <= LARGEST


def _listed(names: Mapping[str, Any]) -> str:
    return ", ".join(f"'{name}'" for name in names) or "none"
