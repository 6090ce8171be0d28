"""Files that somebody made on purpose: every way to change an npz archive or a JSON text that we could think of."""

import copy
import io
import json
import struct
import warnings
import zipfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from segar.errors import SegarError

LEAVES = (None, True, -1, 0, 7, 2**70, 1.5, "", "../../etc/passwd", [], {}, [[]], {"a": []})
MAGIC = b"\x93NUMPY\x01\x00"
HEADERS = {
    "no header": b"",
    "no dictionary": b"3",
    "a call": b"{'descr': __import__('os'), 'fortran_order': False, 'shape': (3,), }",
    "nested": b"{'descr': '<f8', 'fortran_order': False, 'shape': " + b"(" * 3000 + b")" * 3000 + b"}",
    "negative": b"{'descr': '<f8', 'fortran_order': False, 'shape': (-3,), }",
    "negative twice": b"{'descr': '<f8', 'fortran_order': False, 'shape': (-3, -1), }",
    "huge": b"{'descr': '<f8', 'fortran_order': False, 'shape': (999999999999999999, 9999999999), }",
    "true": b"{'descr': '<f8', 'fortran_order': False, 'shape': (True,), }",
    "objects": b"{'descr': '|O', 'fortran_order': False, 'shape': (3,), }",
    "structured": b"{'descr': [('a', '<f8'), ('b', '|O')], 'fortran_order': False, 'shape': (3,), }",
    "no bytes": b"{'descr': '|V0', 'fortran_order': False, 'shape': (99999999,), }",
    "unclosed": b"{'descr': '<f8', 'fortran_order': False, 'shape': (3,",
    "not ascii": b"{'descr': '<f8', 'fortran_order': False, 'sh\xff\xfepe': (3,), }",
}

Crafted = Iterator[tuple[str, bytes]]


def assert_clean_errors(
    files: Iterable[tuple[str, bytes]],
    path: Path,
    load: Callable[[], Any],
    is_harmless: Callable[[Any], bool] | None = None,
    refusal: type[SegarError] = SegarError,
) -> None:
    """Each file, written to ``path``, is refused by one error of SEGAR that names it, or else is harmless.

    Args:
        is_harmless: of what was loaded, whether it is as if nothing was changed; where it is None nothing must load.
        refusal: the class of that error.
    """
    wrong, count = [], 0
    for name, content in list(files):  # each is made from the file as it was, before one of them lies in its place
        path.write_bytes(content)
        count += 1
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                found = load()
        except refusal as error:
            if path.name not in str(error) or "\n" in str(error):
                wrong.append(f"{name}: does not name the file: {error}")
        except Exception as error:  # which is what must not be
            wrong.append(f"{name}: {type(error).__name__}: {error}")
        else:
            if is_harmless is None or not is_harmless(found):
                wrong.append(f"{name}: was accepted")
    assert count and not wrong, f"{len(wrong)} of {count}:\n" + "\n".join(wrong)


def members_of(path: Path) -> dict[str, bytes]:
    """The members of an archive, expanded."""
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def zipped(members: list[tuple[str, bytes]], compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    """An archive of members, some of which may have equal names."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about equal names
        with zipfile.ZipFile(buffer, "w", compression, compresslevel=1) as archive:
            for name, content in members:
                archive.writestr(name, content)
    return buffer.getvalue()


def as_member(array: np.ndarray) -> bytes:
    """An array as an npz archive holds it."""
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, array)
    return buffer.getvalue()


def with_array(path: Path, name: str, array: np.ndarray) -> bytes:
    """The archive with another array of this name."""
    return zipped(list((members_of(path) | {f"{name}.npy": as_member(array)}).items()))


def crafted_archives(path: Path) -> Crafted:
    """Archives like the one at ``path`` in which one member, or the archive itself, was spoilt; none may be read."""
    members = members_of(path)
    for name, content in members.items():
        others = [(n, c) for n, c in members.items() if n != name]
        yield f"{name} missing", zipped(others)
        yield f"{name} twice", zipped([*others, (name, content), (name, content)])
        for share in (0.0, 0.3, 0.9):
            yield f"{name} cut at {share}", zipped([*others, (name, content[: int(share * len(content))])])
        yield f"{name} with more behind", zipped([*others, (name, content + b"\0")])
        for what, header in HEADERS.items():
            padded = MAGIC + struct.pack("<H", len(header)) + header + content[128:]
            yield f"{name} with a header: {what}", zipped([*others, (name, padded)])
        array = np.load(io.BytesIO(content))
        for what, other in crafted_arrays(array):
            yield f"{name} {what}", zipped([*others, (name, as_member(other))])
    whole = path.read_bytes()
    yield "nothing", b""
    yield "no archive", b"no archive at all" * 100
    yield "no members", zipped([])
    for share in (0.1, 0.5, 0.9, 0.99):
        yield f"cut at {share}", whole[: int(share * len(whole))]
    everything = list(members.items())
    yield "encrypted", _with_flags(zipped(everything), flags=1)
    yield "unknown compression", _with_flags(zipped(everything), method=99)


def crafted_sizes(path: Path) -> Crafted:
    """Archives in which one array is of more or fewer things than the others."""
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files if name != "metadata"}
    for name, array in arrays.items():
        for what, other in (("twice", np.concatenate([array, array])), ("less", array[:-1]), ("none", array[:0])):
            yield f"{name} {what}", with_array(path, name, other)


def crafted_arrays(array: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Arrays that are never a good replacement for one."""
    for dtype in ("complex128", "S3", "U2", "M8[s]", "V4", "float16", "O"):
        if array.dtype != dtype:
            yield f"of {dtype}", np.zeros(array.shape, dtype)
    other = array.dtype.newbyteorder(">") if array.dtype.itemsize > 1 else ">i8"
    yield "in the other order of bytes", array.astype(other)
    yield "without axes", np.array(array.flat[0] if array.size else 0, array.dtype)
    yield "of one more axis", array[..., None]
    if array.ndim > 1:
        yield "flat", array.reshape(-1)
        yield "of one less in the second axis", array[:, :-1] if array.shape[1] else array[:, None, 0]


def crafted_descriptions(description: Any) -> Iterator[tuple[str, Any]]:
    """JSON data like the given in which one part is absent or something else."""
    for place in places(description):
        named = ".".join(map(str, place))
        if isinstance(at(description, place[:-1]), dict):
            changed = copy.deepcopy(description)
            del at(changed, place[:-1])[place[-1]]
            yield f"{named} absent", changed
        for leaf in LEAVES:
            yield f"{named} {leaf!r}", replaced(description, place, leaf)


def crafted_metadata(path: Path) -> Crafted:
    """The archive with other descriptions."""
    description, described = description_of(path)
    for what, changed in crafted_descriptions(description):
        yield f"metadata {what}", described(json.dumps(changed).encode())
    for what, text in crafted_texts():
        yield f"metadata {what}", described(text)


def description_of(path: Path) -> tuple[Any, Callable[[bytes], bytes]]:
    """The description in the archive, and a function that gives the archive with the text of another one."""
    with np.load(path) as archive:
        arrays = dict(archive)
    description = json.loads(arrays.pop("metadata").tobytes())

    def described(text: bytes) -> bytes:
        buffer = io.BytesIO()
        np.savez(buffer, **arrays, metadata=np.frombuffer(text, np.uint8))
        return buffer.getvalue()

    return description, described


def crafted_texts() -> Crafted:
    """Texts that are not the JSON of anything."""
    yield "nothing", b""
    yield "no text", bytes(range(256))
    yield "nested", b"[" * 200_000
    yield "open", b'{"format": '
    yield "another", b"[1, 2]"
    yield "digits", b'{"format": ' + b"9" * 10_000 + b"}"


def flipped(path: Path, count: int, seed: int = 0) -> Crafted:
    """The file with single bytes changed, evenly over the file."""
    whole, rng = path.read_bytes(), np.random.default_rng(seed)
    for place in np.linspace(0, len(whole) - 1, count).astype(int):
        content = bytearray(whole)
        content[place] ^= int(rng.integers(1, 256))
        yield f"byte {place}", bytes(content)


def places(data: Any, start: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The places of all parts of plain data, of lists those in the first entry."""
    parts = data.items() if isinstance(data, dict) else enumerate(data[:1]) if isinstance(data, list) else ()
    for key, part in parts:
        yield (*start, key)
        yield from places(part, (*start, key))


def at(data: Any, place: tuple[Any, ...]) -> Any:
    """The part at a place."""
    for key in place:
        data = data[key]
    return data


def replaced(data: Any, place: tuple[Any, ...], value: Any) -> Any:
    """The data with another value at a place."""
    changed = copy.deepcopy(data)
    at(changed, place[:-1])[place[-1]] = value
    return changed


def _with_flags(archive: bytes, flags: int = 0, method: int | None = None) -> bytes:
    """The archive with flags or another method of compression in all of its headers."""
    content = bytearray(archive)
    for signature, at in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        place = content.find(signature)
        while place >= 0:
            content[place + at] |= flags
            if method is not None:
                content[place + at + 2] = method
            place = content.find(signature, place + 1)
    return bytes(content)
