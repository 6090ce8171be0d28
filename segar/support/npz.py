"""Reading npz archives that others made: headers are checked before anything is expanded, and nothing is unpickled."""

import math
import struct
import tokenize
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from segar.errors import SegarError
from segar.support.reading import LIMIT, check_size, opened

LONGEST_HEADER = 4096  # [characters]; numpy writes 118
# What zipfile and numpy raise on bytes that nobody wrote; the lists were found by flipping bytes and by crafted headers.
DAMAGE = (
    zipfile.BadZipFile, zlib.error, struct.error, tokenize.TokenError, ValueError, SyntaxError, TypeError, KeyError,
    IndexError, EOFError, OSError, RuntimeError, OverflowError, MemoryError, AttributeError, AssertionError,
)  # fmt: skip


class Form(NamedTuple):
    """What an array must be: its dtype (None: any of numbers or truth values) and its axes.

    An axis is a size, or a name that stands for one size in all arrays that are read together; ``...`` as the last axis
    stands for any further ones.
    """

    dtype: str | None
    axes: tuple[object, ...]

    def fits(self, dtype: np.dtype, shape: tuple[int, ...], sizes: dict[str, int]) -> bool:
        """Whether an array of this dtype and shape has the form; named axes that are new are added to ``sizes``."""
        if dtype.kind not in "biuf" if self.dtype is None else dtype != np.dtype(self.dtype):
            return False
        axes = self.axes[:-1] if self.axes[-1:] == (...,) else self.axes
        if len(shape) < len(axes) or (axes is self.axes and len(shape) > len(axes)):
            return False
        return all(
            (sizes.setdefault(axis, size) if isinstance(axis, str) else axis) == size
            for axis, size in zip(axes, shape, strict=False)
        )

    def said(self, sizes: Mapping[str, int]) -> str:
        """The form in words, with the sizes that are known."""
        axes = [str(sizes.get(a, a)) if isinstance(a, str) else "..." if a is ... else str(a) for a in self.axes]
        return f"{self.dtype or 'numbers'} of shape ({', '.join(axes)}{',' if len(axes) == 1 else ''})"


class Header(NamedTuple):
    """What an array is, as the archive says it before the array."""

    dtype: np.dtype
    shape: tuple[int, ...]


@dataclass
class Npz:
    """An open archive; its errors name the file, the array, and what to do.

    Attributes:
        file: what it is, in words such as ``level file``.
        error: the class of the errors.
        limit: [bytes] to which it may expand, if it is not large itself.
        sizes: of the named axes that were met.
    """

    path: Path
    archive: zipfile.ZipFile
    file: str
    error: type[SegarError]
    limit: int
    sizes: dict[str, int] = field(default_factory=dict)

    @property
    def names(self) -> list[str]:
        """Names of the arrays."""
        return [name.removesuffix(".npy") for name in self.archive.namelist() if name.endswith(".npy")]

    def header(self, name: str) -> Header:
        """Dtype and shape of an array, which is not expanded.

        Raises:
            error: there is none of this name, it is no array, or not as long as it says.
        """
        if name not in self.names:
            raise self._damaged(f"it has no array '{name}'")
        info = self.archive.getinfo(f"{name}.npy")
        with self._reading(name), self.archive.open(info) as member:
            version = np.lib.format.read_magic(member)
            read = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
            shape, _, dtype = read[version](member, max_header_size=LONGEST_HEADER)
            start = member.tell()
        if dtype.hasobject:
            raise self._damaged(f"the array '{name}' holds Python objects, which are not read")
        if min(shape, default=0) < 0 or info.file_size != start + math.prod(shape) * dtype.itemsize:
            raise self._damaged(
                f"the array '{name}' is said to be {dtype} of shape {shape}, and takes {info.file_size - start:,} bytes"
            )
        return Header(dtype, shape)

    def read(self, forms: Mapping[str, Form]) -> dict[str, np.ndarray]:
        """The arrays of these names, in C order. None is expanded before all have been found to have their forms.

        Raises:
            error: an array is absent or of another form, or the arrays are larger than the limit.
        """
        for name, form in forms.items():
            header = self.header(name)
            if not form.fits(*header, self.sizes):
                raise self._damaged(
                    f"the array '{name}' must be {form.said(self.sizes)}, not {header.dtype} of shape {header.shape}"
                )
        size = sum(self.archive.getinfo(f"{name}.npy").file_size for name in forms)
        check_size(self.path, size, self.file, self.error, self.limit)
        return {name: self._expanded(name) for name in forms}

    def _expanded(self, name: str) -> np.ndarray:
        with self._reading(name), self.archive.open(f"{name}.npy") as member:
            array = np.lib.format.read_array(member, allow_pickle=False, max_header_size=LONGEST_HEADER)
            member.read(1)  # the end is where zipfile compares the checksum
        return np.ascontiguousarray(array).reshape(array.shape)

    def _reading(self, name: str) -> AbstractContextManager[None]:
        return damage_told(lambda why: self._damaged(f"the array '{name}' cannot be read ({why})"))

    def _damaged(self, what: str) -> SegarError:
        return self.error(f"{self.path} is not a {self.file}, or only part of one: {what}; save or copy it again")


@contextmanager
def open_npz(path: Path, file: str, error: type[SegarError], limit: int = LIMIT) -> Iterator[Npz]:
    """An archive to read from; see :class:`Npz`.

    Raises:
        error: there is no such file, it is no archive, an array stands twice in it, or it is encrypted.
    """
    with opened(path, file, error) as stream:
        told = f"{path} is not a {file}, or only part of one"
        with damage_told(lambda why: error(f"{told} ({why}); save or copy it again")):
            archive = zipfile.ZipFile(stream)
        npz = Npz(path, archive, file, error, limit)
        twice = [name for name, count in Counter(archive.namelist()).items() if count > 1]
        if twice:
            raise npz._damaged(f"'{twice[0]}' stands in it twice")
        yield npz


@contextmanager
def damage_told(told: Callable[[str], SegarError], *more: type[Exception]) -> Iterator[None]:
    """Have what damaged files raise inside the block be the error that ``told`` makes of its first line.

    Args:
        more: classes of errors beyond :data:`DAMAGE`.
    """
    try:
        yield
    except SegarError:
        raise
    except (*DAMAGE, *more) as cause:
        raise told(first_line(cause)) from cause


def first_line(error: BaseException) -> str:
    """The first line of an error's message, or its class where it has none."""
    return (str(error).splitlines() or [type(error).__name__])[0]
