"""Level distributions as text: the Python expression that makes one, written, and read again without running any code."""

import ast
import dataclasses
import inspect
import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from segar import language, noise
from segar.errors import LevelError, SegarError, did_you_mean
from segar.language import BaseShape, Entity, Factor, Relation, Symbol, ThingFactory, all_subclasses
from segar.levels.conditional import Dependent
from segar.levels.distribution import LevelDistribution
from segar.levels.hashing import content_hash
from segar.levels.priors import Prior
from segar.noise import Noise

# Of what the names can be called in a text: distributions, shapes, priors, and choices of entities.
CALLED = (Noise, BaseShape, Prior, ThingFactory, Dependent)
PARTS = ("numbers", "priors", "parameters", "positions", "min_distance")
"""What a text can change; name, rules and task are those of the distribution that was written."""
WHOLE = "LevelDistribution"
LONGEST = 100_000  # [characters] of a text
TOO_DEEP = "the text is nested too deeply"


def written(distribution: LevelDistribution) -> str:
    """The expression that makes the distribution, over several lines.

    What has no expression, such as a relation that is a function, has a name there, which a comment explains.
    """
    return _Writer().whole(distribution)


def read_distribution(text: str, origin: LevelDistribution) -> LevelDistribution:
    """The distribution that an expression says, with the rules and the task of another one.

    The text may name the entities, factors, parameters, shapes and distributions of SEGAR and those of ``origin``, and all
    entities, factors and parameters that are defined. It may call their constructors, and nothing else.

    Args:
        origin: the distribution from which the text was written.

    Raises:
        LevelError: the text is no such expression, or what it says is no distribution; the message begins with the line.
    """
    if len(text) > LONGEST:
        raise LevelError(f"a distribution is at most {LONGEST:,} characters of text, and these are {len(text):,}")
    try:
        body = ast.parse(text.strip(" \t") or "\n", mode="eval").body
        made = _Reader(_names(origin)).whole(body)
    except SyntaxError as error:
        raise LevelError(f"line {error.lineno or 1}: this is no Python expression: {error.msg}") from None
    except ValueError as error:
        raise error if isinstance(error, SegarError) else LevelError(f"the text cannot be read: {error}") from None
    except (RecursionError, MemoryError):
        raise LevelError(TOO_DEEP) from None
    try:
        found = LevelDistribution(**made, name=origin.name, world=origin.world, task=origin.task)
    except SegarError as error:
        raise LevelError(str(error)) from error
    if found.hash == origin.hash or not origin.name:
        return found
    return dataclasses.replace(found, name=f"{origin.name}, edited")


def _names(origin: LevelDistribution) -> dict[str, Any]:
    """What names stand for: those of the text of ``origin`` before those of SEGAR, and these before all others."""
    writer = _Writer()
    writer.whole(origin)
    known = [getattr(room, name) for room in (language, noise) for name in dir(room)]
    defined = [kind for base in (Entity, Factor) for kind in all_subclasses(base)]
    defined.sort(key=lambda kind: kind.__module__.startswith("segar."))
    constructors = [one for one in known if isinstance(one, type) and issubclass(one, (BaseShape, Noise))]
    listed = [*defined, *constructors, Prior, ThingFactory, Dependent]
    return {one.__name__: one for one in listed} | writer.names


class _Writer:
    """Writes values; ``names`` gathers what the names in the text stand for."""

    def __init__(self) -> None:
        self.names: dict[str, Any] = {}

    def whole(self, distribution: LevelDistribution) -> str:
        """The expression of a distribution, and comments on what has no expression."""
        parts = {name: getattr(distribution, name) for name in PARTS}
        lines = []
        for name, value in parts.items():
            if isinstance(value, float):
                lines.append(f"    {name}={value!r},")
            elif name == "parameters" and value:
                lines += [f"    {name}={{", *(f"        {self.of(k)}: {self.of(v)}," for k, v in value), "    },"]
            elif value:
                lines += [f"    {name}=[", *(f"        {self.of(one)}," for one in value), "    ],"]
        text = "\n".join([f"{WHOLE}(", *lines, ")"]) + "\n"
        unwritten = [(name, value) for name, value in self.names.items() if not isinstance(value, type)]
        comments = [
            f"# {name} is {'a relation' if isinstance(value, Relation) else ' '.join(str(value).split())}, as it was"
            for name, value in unwritten
            if re.search(rf"\b{name}\b", text)
        ]
        return "\n".join([*comments, text])

    def of(self, value: Any) -> str:
        """The expression of a value."""
        if value is None or isinstance(value, (bool, int, float, str)):
            return repr(value) if not isinstance(value, float) or np.isfinite(value) else self.named("number", value)
        if isinstance(value, np.generic):
            return self.of(value.item())
        if isinstance(value, Symbol):
            return self.of(value.args[0]) if value.op == "const" else self.named("formula", value)
        if isinstance(value, type):
            return self.named(value.__name__, value)
        if isinstance(value, (list, np.ndarray)):
            return f"[{', '.join(map(self.of, value))}]"
        if isinstance(value, tuple):
            return f"({', '.join(map(self.of, value))}{',' if len(value) == 1 else ''})"
        if isinstance(value, ThingFactory):
            members = zip(value.types, value.probabilities, strict=True)
            return f"ThingFactory({{{', '.join(f'{self.of(t)}: {p!r}' for t, p in members)}}})"
        for form in (self._keywords, self._positions):
            text = form(value)
            if text is not None and self._means(text, value):
                return text
        return self.named(value.name if isinstance(value, Relation) else type(value).__name__.lower(), value)

    def named(self, name: str, value: Any) -> str:
        """A name of the value, the given one where it is free."""
        name = name if name.isidentifier() else "value"
        known, k = name, 1
        while self.names.setdefault(known, value) is not value:
            k += 1
            known = f"{name}_{k}"
        return known

    def _keywords(self, value: Any) -> str | None:
        """A call with the fields of a dataclass under the names that its constructor gives them."""
        if not dataclasses.is_dataclass(value):
            return None
        fields = [getattr(value, field.name) for field in dataclasses.fields(value)]
        parameters = list(inspect.signature(type(value)).parameters.values())[: len(fields)]
        pairs = [
            (p.name, v) for p, v in zip(parameters, fields, strict=False) if v is not None or p.default is not None
        ]
        unnamed = 2 if isinstance(value, Prior) else 0
        parts = [self.of(v) if k < unnamed else f"{name}={self.of(v)}" for k, (name, v) in enumerate(pairs)]
        return f"{self.named(type(value).__name__, type(value))}({', '.join(parts)})"

    def _positions(self, value: Any) -> str | None:
        """A call with the size of a shape."""
        if not isinstance(value, BaseShape):
            return None
        return f"{self.named(type(value).__name__, type(value))}({value.size!r})"

    def _means(self, text: str, value: Any) -> bool:
        """Whether the text gives the value back."""
        try:
            found = _Reader(self.names).of(ast.parse(text, mode="eval").body)
            return content_hash(found) == content_hash(value)
        except SegarError:
            return False


class _Reader:
    """Evaluates expressions of constants, sequences, names, and calls of known constructors."""

    def __init__(self, names: Mapping[str, Any]) -> None:
        self.names = {"Prior": Prior, "ThingFactory": ThingFactory} | dict(names)

    def whole(self, node: ast.expr) -> dict[str, Any]:
        """The arguments of the distribution that a text says."""
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == WHOLE):
            raise LevelError(f"line {node.lineno}: the text must be {WHOLE}(numbers=[...], priors=[...])")
        if node.args:
            raise LevelError(f"line {node.args[0].lineno}: name the parts of {WHOLE}: {', '.join(PARTS)}")
        made: dict[str, Any] = {}
        for keyword in node.keywords:
            name, line = str(keyword.arg), keyword.value.lineno
            if name not in PARTS:
                raise LevelError(f"line {line}: {WHOLE} has no part '{name}' here.{did_you_mean(name, PARTS)}")
            if name in made:
                raise LevelError(f"line {line}: '{name}' is given twice")
            made[name] = self.of(keyword.value)
        if "numbers" not in made:
            raise LevelError(f"line {node.lineno}: {WHOLE} needs numbers=[(entity type, how many), ...]")
        return made

    def of(self, node: ast.expr) -> Any:
        """The value of an expression."""
        if isinstance(node, ast.Constant) and isinstance(node.value, (bool, int, float, str, type(None))):
            return node.value
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
            number = self.of(node.operand)
            if isinstance(number, (int, float)):
                return -number if isinstance(node.op, ast.USub) else number
        if isinstance(node, (ast.List, ast.Tuple)):
            items = [self.of(item) for item in node.elts]
            return items if isinstance(node, ast.List) else tuple(items)
        if isinstance(node, ast.Dict) and None not in node.keys:
            keys = [self.of(key) for key in node.keys if key is not None]
            return self._made(node, dict, zip(keys, map(self.of, node.values), strict=True))
        if isinstance(node, ast.Name):
            if node.id not in self.names:
                raise LevelError(f"line {node.lineno}: there is no '{node.id}' here.{_nearest(node.id, self.names)}")
            return self.names[node.id]
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            make = self.of(node.func)
            named = {keyword.arg: self.of(keyword.value) for keyword in node.keywords if keyword.arg is not None}
            if isinstance(make, type) and issubclass(make, CALLED) and len(named) == len(node.keywords):
                return self._made(node, make, *map(self.of, node.args), **named)
        raise LevelError(
            f"line {node.lineno}: '{ast.unparse(node)[:80]}' cannot stand here; write numbers, lists, names, and calls such"
            " as UniformNoise(low=0.2, high=1.0)"
        )

    def _made(self, node: ast.expr, make: Callable[..., Any], *args: Any, **named: Any) -> Any:
        try:
            return make(*args, **named)
        except (TypeError, ValueError, ArithmeticError) as error:  # what constructors say of wrong arguments
            raise LevelError(f"line {node.lineno}: {error}") from error


def _nearest(name: str, names: Mapping[str, Any]) -> str:
    found = did_you_mean(name, names)
    return found if found.startswith(" Did") else ""
