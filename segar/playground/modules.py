"""WebAssembly modules for a page, and the arrays that their calls read, as plain data beside one store of bytes."""

import hashlib
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
EDGES = "geometry_edges"  # follows from the vertices, and would be most of a page


class Blobs:
    """Bytes of a page, each once.

    Attributes:
        data: all of them.
        places: offset and length of each.
    """

    def __init__(self) -> None:
        self.data = bytearray()
        self.places: list[tuple[int, int]] = []
        self._known: dict[bytes, int] = {}

    def add(self, data: bytes) -> int:
        """The number of these bytes."""
        digest = hashlib.sha256(data).digest()
        if digest not in self._known:
            self._known[digest] = len(self.places)
            self.data += bytes(-len(self.data) % 8)
            self.places.append((len(self.data), len(data)))
            self.data += data
        return self._known[digest]


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
                        places[name]["data"] = blobs.add(np.ascontiguousarray(array).tobytes())
            made[role].append({"entry": call.entry.name, "names": names, **({"sizes": own_sizes} if own_sizes else {})})
    return {"code": blobs.add(kernel.code), "places": places, "calls": made, "sizes": dict(sizes)}
