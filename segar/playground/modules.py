"""WebAssembly modules for a page, and the arrays that their calls read, as plain data beside one store of bytes."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from segar.engine import Call, build_kernel

NAMES = {
    "unresolved": "unresolved_contacts",
    "frames": "observation",
    "out": "observation",
    "keys": "key",
    "steps": "tick",
}
"""Arguments of calls that the memory of a page knows by another name."""
BYTES = ("bytes",)  # the shape of frames; a frame that is stacked has fewer bytes than the stack
SHORTER = {"float64": np.float32, "float32": np.float16}
FEW = 8  # of so many numbers, one may be longer than the shorter type
CUT = 24_000  # [bytes] of the first part of a module's code
EDGES = "geometry_edges"  # follows from the vertices, and would be most of a page


class Blobs:
    """Bytes of a page, each once."""

    def __init__(self) -> None:
        self._numbers: dict[bytes, int] = {}

    def add(self, data: bytes) -> int:
        """The number of these bytes."""
        return self._numbers.setdefault(data, len(self._numbers))

    def add_array(self, array: np.ndarray) -> dict[str, Any]:
        """What a page knows of an array, to the bit, in few bytes when they are packed.

        The parts are its numbers, in a shorter type where that holds nearly all of them, such as the weights of a network that
        was rounded to 16 bits; the places (int32) of the others; and the others. Of numbers of less than 8 bytes, all first
        bytes stand before all second ones. Longer ones are mostly states of things, which repeat as a whole.
        """
        exact = np.ravel(array)
        with np.errstate(over="ignore"):
            held = exact.astype(SHORTER.get(exact.dtype.name, exact.dtype))
        others = np.flatnonzero(held != exact).astype(np.int32)
        if FEW * len(others) > len(exact) or not np.isfinite(exact).all():
            held, others = exact, others[:0]
        planes = held.view(np.uint8).reshape(len(held) if held.itemsize < 8 else 1, -1).T
        return {"dtype": held.dtype.name, "parts": [self.add(x.tobytes()) for x in (planes, others, exact[others])]}

    def laid_out(self) -> tuple[bytes, list[tuple[int, int]]]:
        """All bytes, and offset and length of each by its number. First parts of modules lie side by side, because modules that
        differ in a few numbers are packed to little more than one where deflate, which looks back 32 kB, sees both."""
        data, places = bytearray(), {}
        for part in sorted(self._numbers, key=lambda part: len(part) // CUT):
            data += bytes(-len(data) % 8)
            places[part] = (len(data), len(part))
            data += part
        return bytes(data), [places[part] for part in self._numbers]


def described_module(
    calls: Mapping[str, Sequence[Call]], sizes: Mapping[str, int], entities: int, blobs: Blobs
) -> dict[str, Any]:
    """A module that makes these calls: its code, the arrays in its memory by name, and which call reads which of them.

    Arrays that calls share, and arrays that the caller gives under one name, are one in memory.

    Args:
        calls: by what they are for, in the order in which they are made.
        sizes: of the arrays, by name.
        entities: how many slots a level has.
    """
    entries = dict.fromkeys(call.entry for some in calls.values() for call in some)
    kernel = build_kernel([*entries], "wasm")
    places: dict[str, dict[str, Any]] = {}
    known: dict[int, str] = {}
    made: dict[str, list[dict[str, Any]]] = {}
    for role, some in calls.items():
        made[role] = []
        for call in some:
            names: dict[str, str] = {}
            own_sizes: dict[str, int] = {}
            for argument in call.entry.arguments:
                if argument.shape is None:
                    continue
                array = call.arrays.get(argument.name)
                shape: Sequence[int | str] = argument.shape
                if array is not None and argument.shape == BYTES:
                    own_sizes["bytes"], shape = array.size, [array.size]
                plain = argument.name.removeprefix("state_").removeprefix("result_")
                name = NAMES.get(plain, plain)
                if array is not None:
                    name = known.setdefault(id(array), name if name not in places else f"{call.entry.name}.{name}")
                names[argument.name] = name
                if name not in places:
                    places[name] = {"dtype": argument.dtype, "shape": list(shape)}
                    if argument.shape[0] == "levels":
                        places[name] |= {"of_levels": True, "of_things": argument.shape[1:2] == (entities,)}
                    if argument.name == EDGES:
                        places[name]["edges_of"] = [names["geometry_vertices"], names["geometry_vertex_counts"]]
                    elif array is not None and np.any(array):
                        places[name]["data"] = blobs.add_array(array)
            made[role].append({"entry": call.entry.name, "names": names, **({"sizes": own_sizes} if own_sizes else {})})
    code = [blobs.add(part) for part in (kernel.code[:CUT], kernel.code[CUT:])]
    return {"code": code, "places": places, "calls": made, "sizes": dict(sizes)}
