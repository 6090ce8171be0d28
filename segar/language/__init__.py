"""The language in which a person writes worlds: values, factors, entities, relations, rules, tasks; and what reads it."""

from segar.language import entities, factors
from segar.language.effects import Aggregate, Differential, Effect, SetFactor
from segar.language.entities import *  # noqa: F403
from segar.language.factors import *  # noqa: F403
from segar.language.layout import (
    Factors,
    Layout,
    Results,
    SingleFactors,
    SingleResults,
    Slot,
    holds,
    name_slots,
    require_own_names,
)
from segar.language.parameters import (
    BUILT_IN_PARAMETERS,
    FloorFriction,
    Framerate,
    Gravity,
    MaxVelocity,
    MinMass,
    MinVelocity,
    Parameter,
    WallDamping,
)
from segar.language.relations import Relation, as_relation, contains, is_equal, is_on, overlaps, relation
from segar.language.rule_definition import (
    SPECIFICITY_OBJECT,
    SPECIFICITY_SUBCLASS,
    SPECIFICITY_THING,
    Rule,
    as_rule,
    rule,
    value_rule,
)
from segar.language.shapes import (
    CIRCLE,
    HULL,
    BaseShape,
    Circle,
    ConvexHull,
    Hexagon,
    RandomConvexHull,
    Square,
    Triangle,
)
from segar.language.signature import (
    Action,
    Best,
    Every,
    Pattern,
    Signature,
    Wall,
    WallView,
    build_argument,
    code_place,
    read_signature,
    symbolic_arguments,
)
from segar.language.step_order import ACT, FIND_RATES, SUB_STEP, Counts, Operation, Stage, moves
from segar.language.symbols import Symbol, evaluate, make, walk
from segar.language.task import Task, TaskFunctions, default_task, set_default_task
from segar.language.tracing import (
    Branch,
    EffectExpression,
    Leaf,
    Tree,
    effects_of,
    leaves_of,
    number_leaf,
    symbols_of,
    trace,
)
from segar.language.values import (
    ZERO,
    Number,
    Source,
    VectorValue,
    arctan2,
    cos,
    exp,
    hypot,
    log,
    maximum,
    minimum,
    sin,
    sqrt,
    tan,
    tanh,
    where,
)
from segar.language.world import ARENA, WorldRules

__all__ = [
    "ACT", "ARENA", "BUILT_IN_PARAMETERS", "CIRCLE", "FIND_RATES", "HULL", "SPECIFICITY_OBJECT",
    "SPECIFICITY_SUBCLASS", "SPECIFICITY_THING", "SUB_STEP", "ZERO", "Action", "Aggregate", "BaseShape", "Best",
    "Branch", "Circle", "ConvexHull", "Counts", "Differential", "Effect", "EffectExpression", "Every", "Factors",
    "FloorFriction", "Framerate", "Gravity", "Hexagon", "Layout", "Leaf", "MaxVelocity", "MinMass", "MinVelocity",
    "Number", "Operation", "Parameter", "Pattern", "RandomConvexHull", "Relation", "Results", "Rule", "SetFactor",
    "Signature", "SingleFactors", "SingleResults", "Slot", "Source", "Square", "Stage", "Symbol", "Task",
    "TaskFunctions", "Tree", "Triangle", "VectorValue", "Wall", "WallDamping", "WallView", "WorldRules", "arctan2",
    "as_relation", "as_rule", "build_argument", "code_place", "contains", "cos", "default_task", "effects_of",
    "evaluate", "exp", "holds", "hypot", "is_equal", "is_on", "leaves_of", "log", "make", "maximum", "minimum",
    "moves", "name_slots", "number_leaf", "overlaps", "read_signature", "relation", "rule", "set_default_task", "sin",
    "sqrt", "symbolic_arguments", "symbols_of", "tan", "tanh", "trace", "value_rule", "walk", "where",
]  # fmt: skip
__all__ += entities.__all__
__all__ += factors.__all__
