"""SEGAR: a sandbox for research on generalization in reinforcement learning.

Entities, factors, rules and priors make level distributions; levels are sampled from them, simulated by a kernel that
is compiled from the rules, and measured. See README.md for a first run.
"""

from typing import Tuple  # noqa: UP035 - the paper's rules are written with it

from segar import envs, hardness, metrics, noise, random, tasks
from segar.conditional import Dependent
from segar.designed_levels import design
from segar.distribution import LevelDistribution
from segar.effects import Aggregate, Differential, SetFactor
from segar.engine.interpreter import Interpreter
from segar.engine.signature import Action, Best, Every, Wall
from segar.entities import *  # noqa: F403
from segar.entities import __all__ as _entity_names
from segar.errors import (
    ActionError,
    ConflictError,
    FactorError,
    LevelError,
    PlacementError,
    PriorError,
    RuleError,
    SegarError,
)
from segar.factors import (
    ID,
    Acceleration,
    Alive,
    Charge,
    Collides,
    Consumes,
    Count,
    Density,
    Done,
    Drag,
    Factor,
    Flag,
    Floor,
    Friction,
    Heat,
    InfiniteEnergy,
    Label,
    Magnetism,
    Marker,
    Mass,
    Mobile,
    Order,
    Position,
    Scalar,
    Shape,
    Size,
    StoredEnergy,
    Text,
    Vector,
    Velocity,
    Visible,
)
from segar.families import families, family
from segar.levels import Levels
from segar.noise import *  # noqa: F403
from segar.noise import __all__ as _noise_names
from segar.observations.actions import PreviousActions
from segar.observations.multi import Multi
from segar.observations.one_of import OneOf
from segar.observations.pixels import Pixels
from segar.observations.stack import Stack
from segar.observations.state import StateVector
from segar.observations.state_presets import AllObjects, AllState, AllTiles, ObjectState, TileState
from segar.observations.textured import TexturedPixels
from segar.parameters import (
    FloorFriction,
    Framerate,
    Gravity,
    MaxVelocity,
    MinMass,
    MinVelocity,
    Parameter,
    WallDamping,
)
from segar.priors import Prior
from segar.relations import Relation, contains, is_equal, is_on, overlaps, relation
from segar.rule import Rule, rule
from segar.rules import (
    DEFAULT_RULES,
    accelerate,
    apply_burn,
    apply_friction,
    bounce,
    collide,
    come_to_rest,
    consume,
    kill_condition,
    lorentz_law,
    lorentz_law_r2,
    move,
    record_drag,
    speed_limit,
    stop_condition,
)
from segar.shapes import Circle, ConvexHull, Hexagon, RandomConvexHull, Square, Triangle
from segar.simulator import Simulator, State
from segar.tasks.billiards import billiards
from segar.tasks.invisiball import invisiball
from segar.tasks.puttputt import puttputt
from segar.tasks.task import Task
from segar.values import arctan2, cos, exp, log, maximum, minimum, sin, sqrt, tanh, where
from segar.version import __version__
from segar.world import World

__all__ = [
    *_entity_names,
    *_noise_names,
    "AllObjects",
    "AllState",
    "AllTiles",
    "DEFAULT_RULES",
    "ID",
    "Acceleration",
    "Action",
    "ActionError",
    "Aggregate",
    "Alive",
    "Charge",
    "Circle",
    "Collides",
    "ConflictError",
    "Consumes",
    "ConvexHull",
    "Count",
    "Density",
    "Dependent",
    "Differential",
    "Done",
    "Drag",
    "Every",
    "Factor",
    "FactorError",
    "Flag",
    "Floor",
    "FloorFriction",
    "Framerate",
    "Friction",
    "Gravity",
    "Heat",
    "Hexagon",
    "InfiniteEnergy",
    "Interpreter",
    "Label",
    "Best",
    "LevelDistribution",
    "LevelError",
    "Levels",
    "Magnetism",
    "Marker",
    "Mass",
    "MaxVelocity",
    "MinMass",
    "MinVelocity",
    "Mobile",
    "Multi",
    "ObjectState",
    "OneOf",
    "Order",
    "Parameter",
    "Pixels",
    "PlacementError",
    "Position",
    "PreviousActions",
    "Prior",
    "PriorError",
    "RandomConvexHull",
    "Relation",
    "Rule",
    "RuleError",
    "Scalar",
    "SegarError",
    "SetFactor",
    "Shape",
    "Simulator",
    "Size",
    "Square",
    "Stack",
    "State",
    "StateVector",
    "StoredEnergy",
    "Task",
    "Text",
    "TexturedPixels",
    "TileState",
    "Triangle",
    "Tuple",
    "Vector",
    "Velocity",
    "Visible",
    "Wall",
    "WallDamping",
    "World",
    "__version__",
    "accelerate",
    "apply_burn",
    "apply_friction",
    "arctan2",
    "billiards",
    "bounce",
    "collide",
    "come_to_rest",
    "consume",
    "contains",
    "cos",
    "design",
    "envs",
    "exp",
    "families",
    "family",
    "hardness",
    "invisiball",
    "is_equal",
    "is_on",
    "kill_condition",
    "log",
    "lorentz_law",
    "lorentz_law_r2",
    "maximum",
    "metrics",
    "minimum",
    "move",
    "noise",
    "overlaps",
    "puttputt",
    "random",
    "record_drag",
    "relation",
    "rule",
    "sin",
    "speed_limit",
    "sqrt",
    "stop_condition",
    "tanh",
    "tasks",
    "where",
]

envs.register_all()
