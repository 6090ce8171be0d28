"""Entries: functions that a compiled module exports, over ranges of things, with arrays as addresses and sizes as numbers.

An entry ``f(start, stop, <sizes>, <numbers>, <addresses>)`` calls a compiled function with arrays. Sizes that are not known
when the module is made, such as the number of environments, are arguments; the others are constants of the code.
"""

import inspect
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, count
from typing import Any

import numpy as np

from segar.engine.compiler.source import import_line
from segar.engine.runtime import scratch

BY_ENTITY, BY_NUMBER = "by entity", "by number"
"""How states lie in memory: one environment after the other, or number after number, each of all environments."""


@dataclass(frozen=True)
class Argument:
    """A number, or an array.

    Attributes:
        name: names the argument.
        dtype: NumPy's name of its type.
        shape: sizes of an array, each a constant or the name of a size; None for a number.
        order: of the array's axes in memory, :data:`BY_ENTITY` (the last axis is the fastest) or :data:`BY_NUMBER` (the first).
    """

    name: str
    dtype: str
    shape: tuple[int | str, ...] | None = None
    order: str = BY_ENTITY


@dataclass(frozen=True)
class Entry:
    """A function of a module, made to be exported.

    Attributes:
        name: of the exported function, and of the function ``name(start, stop, *arguments)`` in its module.
        module: source of the module.
        arguments: after ``start`` and ``stop``, in order.
        things: the name of the size over which the range goes, such as ``envs``.
        scratch: bytes of memory of its own that it keeps on the stack.
        per_environment: how many things each environment has, if only those of environments are meant for which the last
            argument, ``meant`` (bool ``(envs,)``), is true; 0 where there is no such argument.
    """

    name: str
    module: str
    arguments: tuple[Argument, ...]
    things: str = "envs"
    scratch: int = 0
    per_environment: int = 0

    @property
    def sizes(self) -> tuple[str, ...]:
        """Names of the sizes that arrays have, each once."""
        named = [size for argument in self.arguments for size in argument.shape or () if isinstance(size, str)]
        return tuple(dict.fromkeys([self.things, *named]))

    def described(self) -> dict[str, Any]:
        """What a caller needs to know as plain data: of each exported argument in order its name and dtype, the shape of an
        array, and its order where it is :data:`BY_NUMBER`."""
        arguments: list[list[Any]] = [[name, "int64"] for name in ("start", "stop", *self.sizes)]
        for one in self.arguments:
            order = [one.order] if one.order != BY_ENTITY else []
            arguments.append([one.name, one.dtype, *([list(one.shape), *order] if one.shape is not None else [])])
        return {"name": self.name, "things": self.things, "arguments": arguments}


@dataclass(frozen=True)
class Call:
    """A call of an entry, with the arrays that do not change from call to call.

    Attributes:
        arrays: by the names of arguments; those of a level set and of a look. The caller gives the others.
        part: of an observation of several parts, the keys of the part that the call writes, from the outside in.
    """

    entry: Entry
    arrays: Mapping[str, np.ndarray]
    part: tuple[Any, ...] = ()


@dataclass(frozen=True)
class Scratch:
    """In a call: a one-dimensional array of the call's own, which is not filled, of ``float``, ``int`` or ``np.float32``."""

    dtype: type
    length: int


@dataclass(frozen=True)
class Given:
    """In a call: an array or a number that the caller gives in each call; None for the shape of a number."""

    dtype: str
    shape: tuple[int | str, ...] | None


@dataclass(frozen=True)
class Rows:
    """In a call: the numbers of the things that are meant, of which a range is taken; by default of environments."""

    things: str = "rows"


def call_of(
    name: str, function: Callable[..., Any], arguments: Sequence[Any], sizes: Mapping[str, tuple[str | None, ...]]
) -> Call:
    """The call of a compiled function with these arguments, as an entry whose range goes over its :class:`Rows`.

    Args:
        function: a function that numba compiles, in a module that can be imported.
        arguments: one for each of its parameters: :class:`Rows`, :class:`Given`, :class:`Scratch`; arrays, which the call has
            with it, and named tuples of arrays; numbers and None, which become constants.
        sizes: names of the sizes of arrays by parameter, or by ``parameter_field``; an axis whose name is None, and an array
            that is not named, have the sizes that they have.
    """
    plain = getattr(function, "py_func", function)
    made = _Made(sizes)
    passed = [
        made.source(parameter, value)
        for parameter, value in zip(inspect.signature(plain).parameters, arguments, strict=True)
    ]
    things = next(value.things for value in arguments if isinstance(value, Rows))
    header = ", ".join(["start", "stop", *(one.name for one in made.arguments)])
    lines = [
        "from numba import njit",
        import_line(scratch, "local_floats, local_integers, local_singles"),
        import_line(sys.modules[plain.__module__], f"{plain.__name__} as called"),
        *(import_line(sys.modules[kind.__module__], kind.__name__) for kind in made.tuples),
        "",
        '@njit(error_model="numpy", nogil=True, _nrt=False)',
        f"def {name}({header}):",
        f"    called({', '.join(passed)})",
        "",
    ]
    return Call(Entry(name, "\n".join(lines), tuple(made.arguments), things, made.scratch), made.arrays)


class _Made:
    """Collects what the arguments of a call become."""

    def __init__(self, sizes: Mapping[str, tuple[str | None, ...]]) -> None:
        self.sizes = sizes
        self.arguments: list[Argument] = []
        self.arrays: dict[str, np.ndarray] = {}
        self.tuples: list[type] = []
        self.scratch = 0

    def source(self, name: str, value: Any) -> str:
        """The source of an argument."""
        if isinstance(value, Rows):
            self.arguments.append(Argument(value.things, "int64", (value.things,)))
            return f"{value.things}[start:stop]"
        if isinstance(value, Given):
            self.arguments.append(Argument(name, value.dtype, value.shape))
            return name
        if isinstance(value, Scratch):
            self.scratch += 8 * value.length
            makers = {float: f"local_floats(1, {value.length})[0]", int: f"local_integers({value.length})"}
            return makers.get(value.dtype, f"local_singles({value.length})")
        if isinstance(value, np.ndarray):
            named = self.sizes.get(name, (None,) * value.ndim)
            shape = tuple(length if size is None else size for size, length in zip(named, value.shape, strict=True))
            self.arguments.append(Argument(name, value.dtype.name, shape))
            self.arrays[name] = value
            return name
        if isinstance(value, tuple):
            self.tuples.append(type(value))
            fields = value._asdict()  # type: ignore[attr-defined]
            return (
                f"{type(value).__name__}({', '.join(self.source(f'{name}_{key}', one) for key, one in fields.items())})"
            )
        return repr(value.item() if isinstance(value, np.generic) else value)


def for_threads(call: Call, per_environment: int = 1) -> Call:
    """The call for a target with a thread per thing: states lie number after number, and only environments are meant that
    the last argument, ``meant``, names.

    Args:
        per_environment: how many things each environment has.
    """
    arguments = [
        replace(one, order=BY_NUMBER) if one.name == "values" and one.name not in call.arrays else one
        for one in call.entry.arguments
    ]
    meant = Argument("meant", "bool", ("envs",))
    return replace(call, entry=replace(call.entry, arguments=(*arguments, meant), per_environment=per_environment))


def with_array(call: Call, array: np.ndarray, names: Mapping[str, str]) -> Call:
    """The call with an array of its own in the place of arguments that the caller would give.

    Args:
        names: of these arguments, where the call has them, and what they are called then; a number follows a name that
            another argument has.
    """
    taken = {one.name for one in call.entry.arguments}
    given = {old: _free(new, taken) for old, new in names.items() if old in taken and old not in call.arrays}
    arguments = tuple(replace(one, name=given.get(one.name, one.name)) for one in call.entry.arguments)
    own = {given[one.name]: array for one in call.entry.arguments if one.name in given}
    return replace(call, entry=replace(call.entry, arguments=arguments), arrays={**call.arrays, **own})


def with_distinct_names(calls: Sequence[Call]) -> list[Call]:
    """The calls with entries of which no two that differ have one name: later ones get a number, such as ``draw_frames_2``."""
    names: dict[Entry, str] = {}
    for entry in dict.fromkeys(call.entry for call in calls):
        names[entry] = _free(entry.name, names.values())
    return [replace(call, entry=_renamed(call.entry, names[call.entry])) for call in calls]


def _free(name: str, taken: Collection[str]) -> str:
    """The name, with a number from 2 on where it is taken."""
    return next(one for one in chain([name], (f"{name}_{k}" for k in count(2))) if one not in taken)


def _renamed(entry: Entry, name: str) -> Entry:
    return replace(entry, name=name, module=entry.module.replace(f"def {entry.name}(", f"def {name}("))


def wrapper(entry: Entry) -> tuple[str, list[str]]:
    """Source of ``exported(start, stop, <sizes>, ...)``, which makes arrays of addresses; and numba's types for it."""
    lines, passed, types = [], ["start", "stop"], ["int64"] * (2 + len(entry.sizes))
    for argument in entry.arguments:
        kind = "boolean" if argument.dtype == "bool" else argument.dtype
        passed.append(argument.name)
        if argument.shape is None:
            types.append(kind)
            continue
        types.append(f"CPointer({kind})")
        maker = "array_at" if argument.order == BY_ENTITY else "array_by_number_at"
        shape = ", ".join(f"size_{one}" if isinstance(one, str) else str(one) for one in argument.shape)
        lines.append(f"    {argument.name} = {maker}(at_{argument.name}, ({shape},))")
    names = [f"at_{one.name}" if one.shape is not None else one.name for one in entry.arguments]
    sizes = [f"size_{one}" for one in entry.sizes]
    header = f"def exported({', '.join(['start', 'stop', *sizes, *names])}):"
    if entry.per_environment:
        lines += ["    for thing in range(start, stop):", f"        if meant[thing // {entry.per_environment}]:"]
        lines.append(f"            {entry.name}(thing, thing + 1, {', '.join(passed[2:-1])})")
    else:
        lines.append(f"    {entry.name}({', '.join(passed)})")
    return "\n".join([header, *lines, ""]), types
