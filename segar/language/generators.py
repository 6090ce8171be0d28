"""The generators of random numbers that a function can draw from, and whether it did."""

import functools
import pickle
import random
import sys
from collections.abc import Callable, Iterable, Iterator
from types import BuiltinMethodType, CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

GENERATORS = (random.Random, np.random.BitGenerator, np.random.RandomState)
OTHERS = ("segar", "numpy", *sys.stdlib_module_names)  # packages whose functions and classes are not looked into
MOST_REACHED = 1000  # objects that are looked at
LARGE = 100  # containers with more elements hold data


def generators_of(function: Callable[..., Any]) -> list[Any]:
    """The generators that a function, and what it calls of the author's own, can name: of Python and of numpy.

    Looked through are global names, closures, defaults, attributes of modules that the code names, and objects of the author's
    own with their attributes.
    """
    seen: dict[int, Any] = {}
    waiting = [function]
    while waiting and len(seen) < MOST_REACHED:
        one = waiting.pop()
        if id(one) not in seen:
            seen[id(one)] = one  # keeps it, so that its id stays its own
            waiting += _reached(one)
    return [one for one in seen.values() if isinstance(one, GENERATORS) and not isinstance(one, random.SystemRandom)]


def state_of(generator: Any) -> bytes:
    """The state of a generator, for comparison and for :func:`restore`."""
    if isinstance(generator, np.random.BitGenerator):
        return pickle.dumps(generator.state)
    if isinstance(generator, np.random.RandomState):
        return pickle.dumps(generator.get_state(legacy=False))
    return pickle.dumps(generator.getstate())


def restore(generator: Any, state: bytes) -> None:
    """Puts a generator into a state that :func:`state_of` gave."""
    if isinstance(generator, np.random.BitGenerator):
        generator.state = pickle.loads(state)
    elif isinstance(generator, np.random.RandomState):
        generator.set_state(pickle.loads(state))
    else:
        generator.setstate(pickle.loads(state))


def _reached(one: Any) -> Iterable[Any]:
    if isinstance(one, np.random.Generator):
        return [one.bit_generator]
    if isinstance(one, functools.partial):
        return [one.func, *one.args, *one.keywords.values()]
    if isinstance(one, MethodType):
        return [one.__self__, one.__func__]
    if isinstance(one, FunctionType):
        return _named_by(one)
    if isinstance(one, dict | list | tuple | set | frozenset):
        return () if len(one) > LARGE else [*(one.values() if isinstance(one, dict) else one)]
    if isinstance(one, BuiltinMethodType):  # random.random is a method of a generator
        return [one.__self__]
    is_own = (
        getattr(one if isinstance(one, type) else type(one), "__module__", "builtins").partition(".")[0] not in OTHERS
    )
    return [*getattr(one, "__dict__", {}).values()] if is_own and not isinstance(one, ModuleType) else ()


def _named_by(function: FunctionType) -> list[Any]:
    """What a function names, of those that are the author's own: the traced one, and helpers in other packages than ours."""
    codes = [*_codes(function.__code__)]
    names = dict.fromkeys(name for code in codes for name in code.co_names)
    found: list[Any] = []
    places = [function.__globals__]
    for place in places:  # grows by the modules that are named
        here = [place[name] for name in names if name in place]
        places += [
            vars(one) for one in here if isinstance(one, ModuleType) and all(vars(one) is not known for known in places)
        ]
        found += here
    for cell in function.__closure__ or ():
        try:
            found.append(cell.cell_contents)
        except ValueError:  # not filled yet
            continue
    found += [*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values()]
    return [one for one in found if not isinstance(one, FunctionType) or _package(one) not in OTHERS]


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for one in code.co_consts:
        if isinstance(one, CodeType):
            yield from _codes(one)


def _package(function: FunctionType) -> str:
    return (function.__module__ or "").partition(".")[0]
