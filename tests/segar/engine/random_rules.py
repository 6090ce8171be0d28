"""Rules that nobody would write: random bodies over random arguments, from one family that covers the language."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import segar.language.random
from segar import DEFAULT_RULES, Aggregate, ConflictError, Differential, Levels, RuleError, SetFactor, World, puttputt
from segar.engine import generate
from segar.language import Circle, FloorFriction, Friction, Gravity, Parameter, Position, Rule, Square, Triangle, rule
from segar.language.entities import Ball, Entity, GoalTile, GolfBall, Magnet, Object, SandTile, Thing, Tile
from segar.language.factors import ID, Charge, Flag, Heat, Label, Mass, Mobile, Scalar, Shape, Size, Vector, Velocity
from segar.language.relations import as_relation, contains, is_equal, is_on, overlaps
from segar.language.values import ZERO, Number, arctan2, cos, exp, hypot, log, maximum, minimum, sin, tan, tanh, where


class Temperature(Scalar, default=20.0): ...


class Fever(Temperature, default=38.0):
    """A temperature: rules of Temperature apply to it, not the reverse."""


class Delirium(Fever, default=41.0): ...


class Spin(Vector): ...


class Frozen(Flag): ...


class Wind(Parameter, default=0.3): ...


class Ember(Ball):
    temperature: Temperature = 30.0
    spin: Spin
    label: Label = "ember"


class Patient(Ball):
    delirium: Delirium = 42.0
    frozen: Frozen
    label: Label = "patient"


class HotPlate(Tile):
    temperature: Temperature = 90.0
    frozen: Frozen


FACTORS: dict[type, tuple[type, ...]] = {
    GolfBall: (Position, Velocity, Mass, Charge, Mobile),
    Object: (Position, Velocity, Mass, Charge, Mobile),
    Ember: (Position, Velocity, Mass, Temperature, Spin),
    Patient: (Mass, Fever, Delirium, Frozen, Velocity),
    Thing: (Position, Size),
    Tile: (Position, Friction, Heat),
    HotPlate: (Temperature, Frozen, Heat),
}
POOL = (Velocity, Mass, Charge, Mobile, Temperature, Fever, Delirium, Spin, Frozen, Heat, Friction, Size, Position)
# What rules may change, so that states stay sane for many sub-steps.
TARGETS = (Velocity, Mass, Charge, Temperature, Fever, Delirium, Spin, Frozen, Heat, Friction, Position)


@dataclass
class Author:
    """Writes a random rule.

    Args:
        rng: decides everything.
    """

    rng: Any
    depth: int = 3
    draws: bool = True

    def one(self, options: Any) -> Any:
        return options[self.rng.integers(len(options))]

    def chance(self, p: float) -> bool:
        return bool(self.rng.random() < p)

    def rule(self) -> Rule:
        """A rule with one, two or three entities, some relation, and one or two effects."""
        count = self.one((1, 1, 1, 2, 2, 3))
        if count == 1 and self.chance(0.4):
            kinds: list[Any] = ["plain"]
        else:
            kinds = [self.one(("tuple", "tuple", "entity")) for _ in range(count)]
        hints, held = [], []
        for kind in kinds:
            if kind == "entity":
                hint = self.one(tuple(FACTORS))
                held.append(FACTORS[hint])
            else:
                held.append(tuple(dict.fromkeys(self.one(POOL) for _ in range(self.one((1, 2, 2, 3))))))
                hint = tuple.__class_getitem__(held[-1])
            hints.append(hint)
        targets = [(a, f) for a, factors in enumerate(held) for f in factors if f in TARGETS]
        if not targets:
            return self.rule()
        chosen = [self.one(targets) for _ in range(self.one((1, 1, 2)))]
        effects = [(self.one((Aggregate, Differential, SetFactor)), a, f) for a, f in dict.fromkeys(chosen)]
        if any(f is Position for _, _, f in effects):
            self.draws = False  # what moves things cannot draw
        body = self._body(held, effects)
        self.draws = True
        function = self._function(kinds, hints, held, body, effects)
        moves = any(f is Position for _, _, f in effects)
        relation = self._relation(count) if self.chance(0.5) and not moves else None
        return rule(relation=relation, priority=int(self.rng.integers(40)), recheck=self.chance(0.2))(function)

    def _function(self, kinds: list, hints: list, held: list, body: Callable, effects: list) -> Callable:
        """The function in the form that its hints ask for; ``body`` takes one dictionary per entity."""
        if kinds == ["plain"]:
            names = [f"f{n}" for n in range(len(held[0]))]
            annotations: dict[str, Any] = dict(zip(names, held[0], strict=True))
            values = "[dict(zip(held[0], (" + ", ".join(names) + ",)))]"
        else:
            names = [f"e{n}" for n in range(len(kinds))]
            annotations = dict(zip(names, hints, strict=True))
            parts = [
                n if kind == "entity" else f"dict(zip(held[{k}], {n}))"
                for k, (n, kind) in enumerate(zip(names, kinds, strict=True))
            ]
            values = "[" + ", ".join(parts) + "]"
        scope = {"held": held, "body": body}
        exec(f"def made({', '.join(names)}, g, wind):\n    return body({values}, g, wind)", scope)
        made = scope["made"]
        made.__annotations__ = {  # type: ignore[attr-defined]
            **annotations,
            "g": Gravity,
            "wind": Wind,
            "return": tuple.__class_getitem__(tuple(kind[f] for kind, _, f in effects)),
        }
        return made  # type: ignore[return-value]

    def _body(self, held: list, effects: list) -> Callable:
        makers = [
            self.vector(held, self.depth) if f.width == 2 else self.scalar(held, self.depth) for _, _, f in effects
        ]
        test, other = self.truth(held, 2), [self.chance(0.3) for _ in effects]
        early, both = self.chance(0.4), self.chance(0.3)

        def body(entities: list, g: Any, wind: Any) -> Any:
            scope = (entities, g, wind)
            if early and test(scope):
                return None
            said = []
            for (kind, argument, factor), make, swap in zip(effects, makers, other, strict=True):
                value = make(scope)
                if factor.width == 2:
                    value = type(value)(0.9 * tanh(value.x), 0.9 * tanh(value.y))
                    if swap:
                        value = where(test(scope), value, ZERO)
                elif issubclass(factor, Flag):
                    value = value > 0
                else:
                    value = 1.5 + tanh(value)
                    if swap and not test(scope):
                        value = 0.5
                said.append(kind[factor](entities[argument][factor], value))
            return tuple(said) if both or len(said) > 1 else said[0]

        return body

    def scalar(self, held: list, depth: int) -> Callable:
        """A function of the scope that computes a number."""
        reads = [(a, f) for a, factors in enumerate(held) for f in factors]
        if depth == 0 or self.chance(0.15):
            choice = self.one(("read", "read", "read", "constant", "parameter", "draw"))
            if choice == "constant" or (choice == "draw" and not self.draws):
                c = float(self.one((0.0, 1.0, -2.0, 0.3)))
                return lambda s: Number(c)
            if choice == "parameter":
                which = self.one((1, 2))
                return lambda s: s[which]
            if choice == "draw":
                return self.one((lambda s: segar.random.uniform(-1, 1), lambda s: segar.random.normal(0.2, 0.5)))
            a, f = self.one(reads)
            if f.width == 2:
                return self.one((lambda s: s[0][a][f].x, lambda s: s[0][a][f].norm(), lambda s: s[0][a][f][1]))
            return lambda s: s[0][a][f]
        x, y = self.scalar(held, depth - 1), self.scalar(held, depth - 1)
        test = self.truth(held, 1)
        u, v = self.vector(held, 0), self.vector(held, 0)

        def branch(s: Any) -> Any:
            if test(s):
                return x(s)
            return y(s)

        return self.one(
            (
                lambda s: x(s) + y(s),
                lambda s: x(s) - 2 * y(s),
                lambda s: x(s) * y(s),
                lambda s: x(s) / (1 + y(s) ** 2),
                lambda s: 3 / x(s),
                lambda s: abs(x(s)) ** 0.5,
                lambda s: x(s) ** 3,
                lambda s: -x(s),
                lambda s: tanh(x(s)).sign() * y(s),
                lambda s: exp(tanh(x(s))) + log(abs(y(s))),
                lambda s: sin(x(s)) * cos(y(s)),
                lambda s: arctan2(x(s), y(s)),
                lambda s: tan(x(s)) - hypot(x(s), y(s)),
                lambda s: abs(x(s)) ** y(s),
                lambda s: minimum(x(s), y(s)),
                lambda s: maximum(x(s), 0.1) + 1,
                lambda s: where(test(s), x(s), y(s)),
                lambda s: u(s).dot(v(s)),
                branch,
            )
        )

    def vector(self, held: list, depth: int) -> Callable:
        """A function of the scope that computes a vector."""
        reads = [(a, f) for a, factors in enumerate(held) for f in factors if f.width == 2]
        if depth == 0 or self.chance(0.2):
            if not reads:
                x = self.scalar(held, 0)
                return lambda s: segar.language.VectorValue(x(s), 0.25)
            a, f = self.one(reads)
            return lambda s: s[0][a][f]
        u, v, x = self.vector(held, depth - 1), self.vector(held, depth - 1), self.scalar(held, depth - 1)
        return self.one(
            (
                lambda s: u(s) + v(s),
                lambda s: u(s) - v(s),
                lambda s: x(s) * u(s),
                lambda s: u(s) / (1 + abs(x(s))),
                lambda s: u(s).tangent_vector(),
                lambda s: u(s).unit_vector(),
                lambda s: -u(s),
                lambda s: u(s).sign() * v(s).abs(),
                lambda s: u(s) * [1.0, -0.5],
            )
        )

    def truth(self, held: list, depth: int) -> Callable:
        """A function of the scope that computes a truth value."""
        flags = [(a, f) for a, factors in enumerate(held) for f in factors if issubclass(f, Flag)]
        if depth == 0 or self.chance(0.3):
            if flags and self.chance(0.5):
                a, f = self.one(flags)
                return lambda s: s[0][a][f]
            x, c = self.scalar(held, 0), float(self.one((0.0, 0.5, 1.0, 20.0)))
            return self.one((lambda s: x(s) > c, lambda s: x(s) <= c, lambda s: x(s) != c, lambda s: c > x(s)))
        p, q = self.truth(held, depth - 1), self.truth(held, depth - 1)
        x, y = self.scalar(held, 0), self.scalar(held, 0)
        return self.one(
            (
                lambda s: p(s) and q(s),
                lambda s: p(s) or q(s),
                lambda s: not p(s),
                lambda s: (x(s) < y(s)) & (y(s) > 0),
                lambda s: (x(s) < y(s)) | (y(s) > 0),
            )
        )

    def _relation(self, count: int) -> Any:
        """One relation, or two combined."""
        made = self._single(count)
        if self.chance(0.4):
            other = self._single(count)
            made = made & other if self.chance(0.5) else made | other
        return made

    def _single(self, count: int) -> Any:
        def fast(thing: Entity) -> bool:
            return thing[Velocity].norm() > 0.5

        def heavier(a: Object, b: Entity) -> bool:
            return a[Mass] > b[Mass]

        def on_the_left(place: tuple[Position]) -> bool:
            return place[0].x < 0

        one = [
            is_equal(Mobile, True),
            is_equal(Label, "ball"),
            is_equal(Frozen, False),
            as_relation(fast),
            as_relation(on_the_left),
        ]
        two = [is_on, overlaps, contains, as_relation(heavier)]
        return self.one(one if count == 1 else one + 2 * two)


def worlds_of_random_rules(count: int, levels: Levels) -> Iterator[tuple[int, World]]:
    """Worlds of rules with all functions, draws, relations and up to three bodies, of which kernels can be made."""
    seed = 0
    while count:
        seed += 1
        rng = np.random.default_rng(seed)
        author = Author(rng)
        rules = [author.rule() for _ in range(4)] + list(DEFAULT_RULES if seed % 2 else ())
        try:
            world = World([rules[i] for i in rng.permutation(len(rules))])
            generate(levels.layout, world, puttputt().functions())
        except (RuleError, ConflictError):
            continue
        count -= 1
        yield seed, world


def mixed_levels(rng: Any, count: int = 16, small: bool = False) -> Levels:
    """Levels with all that a layout can have: mixed and optional slots, hulls, sub-classed factors, own parameters.

    Args:
        small: one mixed slot and one optional one less, which takes a fifth of the time to compile.
    """
    shapes = (Circle(0.4), Square(0.5), Triangle(0.6))
    levels = []
    for n in range(count):
        entities = [
            GolfBall(_somewhere(rng)),
            GoalTile(_somewhere(rng)),
            Patient(_somewhere(rng)),
        ]
        if not small:
            entities.append(Ember({**_somewhere(rng), Spin: rng.normal(size=2)}))
        for k in range(1 if small else 2):
            kind = (Ball, Magnet, SandTile, HotPlate)[(n + k) % 4 if n < 4 else rng.integers(4)]
            own = {**_somewhere(rng), ID: f"mixed{k}"}
            if issubclass(kind, Tile):
                own |= {Shape: shapes[rng.integers(3)], Heat: rng.uniform(), Friction: rng.uniform()}
            entities.append(kind(own))
        if n % 2:
            entities.append(Ball({**_somewhere(rng), ID: "spare"}))
        if n % 4 == 3 and not small:
            entities.append((HotPlate, Ember)[n // 4 % 2]({**_somewhere(rng), ID: "last"}))
        levels.append(entities)
    draws = {
        Wind: rng.uniform(0, 1, count),
        Gravity: rng.uniform(1, 10, count),
        FloorFriction: rng.uniform(0, 0.1, count),
    }
    return Levels.from_entities(levels, draws)


def _somewhere(rng: Any) -> dict:
    return {Position: rng.uniform(-0.9, 0.9, 2)}
