"""What a function can reach by names: generators of random numbers, with their states, and code that cannot be traced."""

import dis
import functools
import linecache
import pickle
import random
import sys
from array import array
from collections import ChainMap, UserDict, UserList, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from types import BuiltinMethodType, CodeType, FunctionType, MethodType, ModuleType, SimpleNamespace
from types import MemberDescriptorType as Slot
from typing import Any

import numpy as np

from segar.errors import RuleError

GENERATORS = (random.Random, np.random.BitGenerator, np.random.RandomState)
LIBRARIES = ("segar", "numpy", "scipy", "pandas", "torch", "pydantic", "omegaconf", "attr", "attrs")
OTHERS = {*LIBRARIES, *sys.stdlib_module_names}  # packages whose functions and classes are not looked into
MOST_REACHED = 1000  # objects that are looked at
LARGE = 100  # containers with more elements hold data
MOST_BYTES = 2**24  # of an array whose numbers are compared
# What some objects lead to; random.random is a method of a generator.
PARTS = {np.random.Generator: ("bit_generator",), functools.partial: ("func", "args", "keywords")}
PARTS |= {MethodType: ("__self__", "__func__"), BuiltinMethodType: ("__self__",)}
CONTAINERS = (dict, list, tuple, set, frozenset, deque)
OF_PYTHON = (SimpleNamespace, UserDict, UserList, ChainMap)  # whose attributes are looked at, too


def reached_by(function: Callable[..., Any]) -> list[Any]:
    """The function, and what it and the functions of the author's own that it calls can name.

    Looked through are global names, closures, defaults, attributes of modules that the code names, and objects of the author's
    own with their attributes and methods.
    """
    seen: dict[int, Any] = {}
    waiting = [function]
    while waiting and len(seen) < MOST_REACHED:
        one = waiting.pop()
        if id(one) not in seen:
            seen[id(one)] = one  # keeps it, so that its id stays its own
            waiting += _reached(one)
    return list(seen.values())


def generators_of(reached: Sequence[Any]) -> list[Any]:
    """The generators of Python and of numpy among what a function reaches."""
    return [one for one in reached if isinstance(one, GENERATORS) and not isinstance(one, random.SystemRandom)]


def watched(reached: Sequence[Any]) -> Callable[[], bool]:
    """A function that says whether these objects still lead to what they lead to now."""

    def places(held: Sequence[Sequence[Any]]) -> list[list[Any]]:
        return [[one if type(one) is bytes else id(one) for one in of_one] for of_one in held]

    before = [[*_reached(one, sys.maxsize)] for one in reached]  # keeps them, so that the id of each stays its own
    return lambda: places([[*_reached(one, sys.maxsize)] for one in reached]) == places(before)


def require_traceable(reached: Sequence[Any], where: str) -> None:
    """Refuse code that would find a symbol to be no number, whatever the symbol does: ``is``, ``type``, ``id``, ``try``.

    Raises:
        RuleError: with the line.
    """
    functions = [one for one in reached if isinstance(one, FunctionType)]
    names = {name for one in functions for code in _codes(one.__code__) for name in code.co_names}
    for one in functions:
        if one is reached[0] or (_is_of_author(one) and (not _is_method(one) or one.__name__ in {*names, "__call__"})):
            for code in _codes(one.__code__):
                _require_traceable(code, one, where)


def _require_traceable(code: CodeType, function: FunctionType, where: str) -> None:
    instructions = list(dis.get_instructions(code))
    for n, at in enumerate(instructions):
        refusal = _refusal(instructions[n - 1], at, instructions[n + 1 : n + 5], function)
        if refusal:
            lines = (one.positions.lineno for one in instructions[n:] if one.positions)
            number = next(filter(None, lines), code.co_firstlineno)
            line = linecache.getline(code.co_filename, number).strip()
            raise RuleError(f"{where} (line {number}: `{line}`): a rule cannot use {refusal}")


def _is_own(module: Any) -> bool:
    """Whether a module of this name is the author's own; Cython's types of types have a descriptor in its place."""
    return module is None or (isinstance(module, str) and module.partition(".")[0] not in OTHERS)


def _is_own_type(kind: type) -> bool:
    return _is_own(getattr(kind, "__module__", "builtins"))


def _is_of_author(function: FunctionType) -> bool:
    is_of_dataclass = function.__code__.co_filename == "<string>" and function.__name__[:2] == "__"  # its __repr__, say
    return not is_of_dataclass and _is_own(function.__globals__.get("__name__"))


def _is_method(function: FunctionType) -> bool:
    owner = function.__qualname__.rpartition(".")[0]
    return bool(owner) and not owner.endswith("<locals>")


def _refusal(
    before: dis.Instruction, at: dis.Instruction, after: list[dis.Instruction], function: FunctionType
) -> str | None:
    """What a rule cannot use of an instruction, and what to write instead; None for any other instruction."""
    if at.opname == "PUSH_EXC_INFO":
        return "'try' and 'with': what raises while it is compiled is not what raises for numbers; test with 'if'"
    # operator.is_ and operator.is_not
    is_named = at.argval in ("is_", "is_not") and at.opname in ("LOAD_ATTR", "LOAD_METHOD", "LOAD_GLOBAL")
    if is_named or (at.opname == "IS_OP" and not (before.opname == "LOAD_CONST" and before.argval is None)):
        return "'is': a number is another object each time, and none while the rule is compiled; write '==', or 'x is None'"
    # To call what type(v) is, as in type(v)(x, y), makes another vector.
    makes_another = "PUSH_NULL" in {before.opname, *(one.opname for one in after)}
    asks = at.argval == "id" or (at.argval == "type" and not makes_another)
    is_builtin = at.opname in ("LOAD_GLOBAL", "LOAD_NAME") and at.argval not in function.__globals__
    if (asks and is_builtin) or (at.opname == "LOAD_ATTR" and at.argval == "__class__"):
        return f"'{at.argval}', which is another one while the rule is compiled; write isinstance(), or compare numbers"
    return None


def state_of(generator: Any) -> bytes:
    """The state of a generator, for comparison and for :func:`restore`."""
    is_bits = isinstance(generator, np.random.BitGenerator)
    return pickle.dumps(generator.state if is_bits else generator.__getstate__())


def restore(generator: Any, state: bytes) -> None:
    """Puts a generator into a state that :func:`state_of` gave."""
    if isinstance(generator, np.random.BitGenerator):
        generator.state = pickle.loads(state)
    else:
        generator.__setstate__(pickle.loads(state))


def _reached(one: Any, most: int = LARGE) -> Iterable[Any]:
    for kind, names in PARTS.items():
        if isinstance(one, kind):
            return [getattr(one, name) for name in names]
    if isinstance(one, FunctionType):
        return _named_by(one)
    if isinstance(one, CONTAINERS):
        return () if len(one) > most else [*(one.values() if isinstance(one, dict) else one)]
    if isinstance(one, np.ndarray | array):
        return [one.tobytes()] if np.asarray(one).nbytes <= MOST_BYTES else ()
    kind = one if isinstance(one, type) else type(one)
    if isinstance(one, Iterator) and not _is_own_type(kind):
        return [object()]  # which is another one each time, as what it gives
    if isinstance(one, ModuleType) or not (issubclass(kind, OF_PYTHON) or _is_own_type(kind)):
        return ()
    held = vars(one) if type(one).__dictoffset__ else {}  # its class may answer for attributes that it does not have
    members = (member for c in kind.__mro__ if _is_own_type(c) for member in vars(c).values())
    slots = [getattr(one, m.__name__, None) for m in members if type(m) is Slot]
    return [*held.values(), *slots, *(one.__bases__ if isinstance(one, type) else [type(one)])]


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
    found += [*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values(), *vars(function).values()]
    return [one for one in found if not isinstance(one, FunctionType) or _is_own(one.__module__)]


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for one in code.co_consts:
        if isinstance(one, CodeType):
            yield from _codes(one)
