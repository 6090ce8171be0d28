"""SEGAR: a sandbox for research on generalization in reinforcement learning.

Entities, factors, rules and priors make level distributions; levels are sampled from them, simulated by a kernel that
is compiled from the rules, and measured. See README.md for a first run.
"""

from typing import Tuple  # noqa: UP035 - the paper's rules are written with it

from segar import envs, hardness, metrics, noise, tasks
from segar.engine.simulator import Simulator, State
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
from segar.language import random
from segar.language.effects import Aggregate, Differential, SetFactor
from segar.language.entities import *  # noqa: F403
from segar.language.entities import __all__ as _entity_names
from segar.language.factors import (
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
from segar.language.parameters import (
    FloorFriction,
    Framerate,
    Gravity,
    MaxVelocity,
    MinMass,
    MinVelocity,
    Parameter,
    WallDamping,
)
from segar.language.relations import Relation, contains, is_equal, is_on, overlaps, relation
from segar.language.rule_definition import Rule, rule
from segar.language.shapes import Circle, ConvexHull, Hexagon, RandomConvexHull, Square, Triangle
from segar.language.signature import Action, Best, Every, Wall
from segar.language.task import Task
from segar.language.values import arctan2, cos, exp, log, maximum, minimum, sin, sqrt, tanh, where
from segar.levels.conditional import Dependent
from segar.levels.distribution import LevelDistribution
from segar.levels.level_set import Levels
from segar.levels.named_families import families, family
from segar.levels.priors import Prior
from segar.metrics.level_design import design
from segar.noise import *  # noqa: F403
from segar.noise import __all__ as _noise_names
from segar.observations.composed.actions import PreviousActions
from segar.observations.composed.multi import Multi
from segar.observations.composed.one_of import OneOf
from segar.observations.composed.stack import Stack
from segar.observations.pixels.solid_colours import Pixels
from segar.observations.pixels.textured import TexturedPixels
from segar.observations.state.presets import AllObjects, AllState, AllTiles, ObjectState, TileState
from segar.observations.state.state_vector import StateVector
from segar.reference.interpreter import Interpreter
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
from segar.rules.world import World
from segar.support.version import __version__
from segar.tasks.billiards_task import billiards
from segar.tasks.invisiball_task import invisiball
from segar.tasks.puttputt_task import puttputt

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
