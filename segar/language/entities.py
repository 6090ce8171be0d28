"""Entity types: sets of factors with defaults, and the factory that draws a type.

An entity type is a class whose annotations name its factors; a class inherits its parent's factors and defaults::

    class Ember(segar.Tile):
        temperature: Temperature = 300.0
"""

# pyright: reportAssignmentType=false
import inspect
import sys
from collections import ChainMap
from collections.abc import Mapping, Sequence
from itertools import islice
from traceback import walk_stack
from types import MappingProxyType
from typing import Any, ClassVar

from segar.errors import FactorError, naming
from segar.language import factors
from segar.language.factors import ID, Factor, Label, Shape, Size
from segar.language.shapes import Circle, Square


def _resolve(hint: str, cls: type) -> Any:
    """Evaluate a string annotation in the class's module and in the frames that define the class."""
    scope = dict(vars(sys.modules[cls.__module__])) if cls.__module__ in sys.modules else {}
    local = ChainMap(*(frame.f_locals for frame, _ in islice(walk_stack(sys._getframe(2)), 8)))
    try:
        return eval(hint, scope, local)
    except NameError:
        raise FactorError(f"entity {cls.__name__}: cannot find the factor '{hint}'") from None


class Entity:
    """A container of factors. Built from a dictionary, it may hold any factors; a sub-class declares its own.

    Args:
        factors: factor class to value. For a sub-class, values for some of its factors; the rest are the defaults.
    """

    declared: ClassVar[Mapping[type[Factor], Any]] = MappingProxyType({})
    """Factor class to default value, inherited ones included."""

    _own: ClassVar[dict[type[Factor], Any]] = {}

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls._own = {}
        for name, hint in inspect.get_annotations(cls).items():
            factor = _resolve(hint, cls) if isinstance(hint, str) else hint
            if not (isinstance(factor, type) and issubclass(factor, Factor)):
                continue  # an ordinary attribute such as a ClassVar
            value = cls.__dict__.get(name, None)
            with naming(f"entity {cls.__name__}.{name}", FactorError):
                cls._own[factor] = factor.default if value is None else factor.check(value)
        inherited: dict[type[Factor], Any] = {}  # of all parents, in Python's order of resolution
        for parent in reversed(cls.__mro__[1:]):
            inherited |= vars(parent).get("_own", {})
        if Size in cls._own and Shape not in cls._own and isinstance(inherited.get(Shape), Circle):
            cls._own[Shape] = Circle(cls._own[Size])  # the inherited circle gets the new size
        cls.declared = MappingProxyType(inherited | cls._own)

    def __init__(self, factors: Mapping[type[Factor], Any] | None = None) -> None:
        self.factors: dict[type[Factor], Any] = dict(self.declared)
        for factor, value in (factors or {}).items():
            if not (isinstance(factor, type) and issubclass(factor, Factor)):
                raise FactorError(f"{type(self).__name__}: {factor!r} is not a factor class")
            if type(self) is not Entity and factor not in self.declared:
                raise FactorError(f"{type(self).__name__} has no factor {factor.__name__}")
            self.factors[factor] = factor.check(value)
        shape = self.factors.get(Shape)
        if isinstance(shape, Circle) and Size not in (factors or {}):
            self.factors[Size] = shape.size

    def __getitem__(self, factor: type[Factor]) -> Any:
        if factor not in self.factors:
            raise FactorError(f"this {type(self).__name__} has no {factor.__name__}")
        return self.factors[factor]

    def __contains__(self, factor: object) -> bool:
        return factor in self.factors

    def __repr__(self) -> str:
        return f"{type(self).__name__}({{{', '.join(f'{f.__name__}: {v!r}' for f, v in self.factors.items())}}})"


class GlobalFriction(Entity):
    """The arena's floor: it has friction but no position, and acts on all entities that move."""

    friction: factors.Friction
    id: ID = "global_friction"


class Thing(Entity):
    position: factors.Position
    visible: factors.Visible
    order: factors.Order
    shape: Shape = Circle(0.2)
    size: Size = 0.2
    label: Label = "thing"
    id: ID = ""


class Object(Thing):
    """A thing that moves, collides, and feels forces."""

    collides: factors.Collides
    mobile: factors.Mobile
    velocity: factors.Velocity
    acceleration: factors.Acceleration
    drag: factors.Drag
    mass: factors.Mass
    charge: factors.Charge
    density: factors.Density
    magnetism: factors.Magnetism
    stored_energy: factors.StoredEnergy
    infinite_energy: factors.InfiniteEnergy
    alive: factors.Alive
    done: factors.Done
    label: Label = "object"


class Ball(Object):
    label: Label = "ball"


class Magnet(Object):
    magnetism: factors.Magnetism = -1.0
    mobile: factors.Mobile = False
    label: Label = "magnet"


class Charger(Object):
    charge: factors.Charge = -1.0
    mobile: factors.Mobile = False
    label: Label = "charger"


class Bumper(Object):
    stored_energy: factors.StoredEnergy = 1.0
    mobile: factors.Mobile = False
    label: Label = "bumper"


class Damper(Object):
    stored_energy: factors.StoredEnergy = -0.5
    mobile: factors.Mobile = False
    label: Label = "damper"


class GolfBall(Object):
    charge: factors.Charge = 1.0
    label: Label = "golfball"
    id: ID = "golfball"


class CueBall(Object):
    charge: factors.Charge = 1.0
    label: Label = "cueball"
    id: ID = "cueball"


class Tile(Thing):
    """A thing that does not move; objects roll over it."""

    floor: factors.Floor
    friction: factors.Friction
    heat: factors.Heat
    shape: Shape = Square(1.0)
    size: Size = 1.0
    label: Label = "tile"


class Hole(Tile):
    """A tile that swallows the objects that it contains."""

    consumes: factors.Consumes
    shape: Shape = Circle(1.0)
    order: factors.Order = -1
    label: Label = "hole"


class SandTile(Tile):
    friction: factors.Friction = 0.4
    label: Label = "sand"


class MagmaTile(Tile):
    heat: factors.Heat = 1.0
    friction: factors.Friction = 0.1
    label: Label = "magma"


class FireTile(MagmaTile):
    heat: factors.Heat = 0.5
    friction: factors.Friction = 0.0
    shape: Shape = Circle(1.0)
    label: Label = "fire"


class GoalTile(Tile):
    shape: Shape = Circle(0.3)
    size: Size = 0.3
    order: factors.Order = -2
    label: Label = "goal"
    id: ID = "goal"


class ThingFactory:
    """A random entity type: uniform over a sequence, or by the probabilities of a dictionary.

    >>> obstacles = segar.ThingFactory([segar.Charger, segar.Damper])
    >>> hazards = segar.ThingFactory({segar.FireTile: 0.75, segar.Hole: 0.25})
    >>> hazards.probabilities
    (0.75, 0.25)

    Raises:
        FactorError: a member is not a Thing type or comes twice, the types are a set, or the probabilities do not sum to one.
    """

    def __init__(self, types: Sequence[type[Thing]] | Mapping[type[Thing], float]) -> None:
        names = list(types)
        weights = list(types.values()) if isinstance(types, Mapping) else [1.0 / max(len(names), 1)] * len(names)
        for member in names:
            if not (isinstance(member, type) and issubclass(member, Thing)):
                raise FactorError(f"ThingFactory takes types of things, not {member!r}")
        if not names or len(set(names)) != len(names) or isinstance(types, set | frozenset):  # sets have no order
            raise FactorError("ThingFactory needs a list of at least one type, and each only once, or a mapping")
        if not (all(w >= 0 for w in weights) and abs(sum(weights) - 1.0) <= 1e-9):
            raise FactorError(f"ThingFactory: probabilities must be positive and sum to 1, not {weights}")
        self.types: tuple[type[Thing], ...] = tuple(names)
        self.probabilities: tuple[float, ...] = tuple(float(w) for w in weights)

    def __repr__(self) -> str:
        members = zip(self.types, self.probabilities, strict=True)
        return f"ThingFactory({{{', '.join(f'{t.__name__}: {p:g}' for t, p in members)}}})"


def entity_name(entity: type[Entity]) -> str:
    """The name of an entity type for people: its ID, else its label, else the class name in lower case."""
    return entity.declared.get(ID) or entity.declared.get(Label) or entity.__name__.lower()
