"""SEGAR: a sandbox for research on generalization in reinforcement learning.

Entities, factors, rules and priors make level distributions; levels are sampled from them, simulated by a kernel that
is compiled from the rules, and measured. See README.md for a first run.

Here stand the names that most programs need. All others stand in the rooms: ``segar.language`` (factors, entities,
parameters, shapes, relations, effects, mathematics of rules), ``segar.rules``, ``segar.noise``, ``segar.levels``,
``segar.tasks``, ``segar.observations``, ``segar.envs``, ``segar.metrics``, ``segar.textures``, ``segar.rendering``,
``segar.hardness``, ``segar.policies``, ``segar.evaluation``, ``segar.datasets``, ``segar.suites`` and ``segar.errors``.
"""

from typing import Any, Tuple  # noqa: UP035 - the paper's rules are written with Tuple

from segar import envs, hardness, metrics, noise, tasks
from segar.errors import ConflictError, RuleError, SegarError
from segar.evaluation import evaluate_policy
from segar.language import (
    Acceleration,
    Action,
    Aggregate,
    Ball,
    Bumper,
    Charge,
    Charger,
    Circle,
    Count,
    Damper,
    Differential,
    Entity,
    Factor,
    FireTile,
    Flag,
    Friction,
    GoalTile,
    GolfBall,
    Gravity,
    Hole,
    MagmaTile,
    Magnet,
    Magnetism,
    Mass,
    MinVelocity,
    Mobile,
    Object,
    Parameter,
    Position,
    RandomConvexHull,
    SandTile,
    Scalar,
    SetFactor,
    Shape,
    Size,
    Task,
    ThingFactory,
    Tile,
    Vector,
    Velocity,
    is_on,
    random,
    relation,
    rule,
)
from segar.levels import LevelDistribution, Levels, Prior, families, family
from segar.metrics import design
from segar.noise import (
    DiscreteRangeNoise,
    GaussianMixtureNoise,
    GaussianNoise,
    RandomBottomLocation,
    RandomEdgeLocation,
    RandomMiddleLocation,
    RandomTopLocation,
    RandomUniformLocation,
    UniformNoise,
)
from segar.reference import Interpreter
from segar.rules import DEFAULT_RULES, World, apply_friction, lorentz_law, move
from segar.suites import evaluate_on_suite, register_suites
from segar.support import __version__, deprecated_names, find_moved
from segar.tasks import puttputt

__all__ = [
    "DEFAULT_RULES", "Acceleration", "Action", "Aggregate", "Ball", "Bumper", "Charge", "Charger", "Circle",
    "ConflictError", "Count", "Damper", "Differential", "DiscreteRangeNoise", "Entity", "Factor", "FireTile", "Flag",
    "Friction", "GaussianMixtureNoise", "GaussianNoise", "GoalTile", "GolfBall", "Gravity", "Hole", "Interpreter",
    "LevelDistribution", "Levels", "MagmaTile", "Magnet", "Magnetism", "Mass", "MinVelocity", "Mobile", "Object",
    "Parameter", "Position", "Prior", "RandomBottomLocation", "RandomConvexHull", "RandomEdgeLocation",
    "RandomMiddleLocation", "RandomTopLocation", "RandomUniformLocation", "RuleError", "SandTile", "Scalar",
    "SegarError", "SetFactor", "Shape", "Size", "Task", "ThingFactory", "Tile", "Tuple", "UniformNoise", "Vector",
    "Velocity", "World", "apply_friction", "design", "envs", "evaluate_on_suite", "evaluate_policy", "families", "family",
    "hardness", "is_on", "lorentz_law", "metrics", "move", "noise", "puttputt", "random", "relation", "rule", "tasks",
]  # fmt: skip

# What 0.1 exported here, by the room that has it now.
_ROOMS = {
    "segar.language": "sqrt contains CueBall GlobalFriction Thing entity_name Alive Collides Consumes"
    " Density Done Drag Every Floor FloorFriction Framerate Heat Hexagon ID InfiniteEnergy Best Label Marker MaxVelocity"
    " MinMass Order ConvexHull Relation Rule Square StoredEnergy Text Triangle Visible Wall"
    " WallDamping arctan2 cos exp log maximum minimum sin tanh where is_equal overlaps",
    "segar.noise": "Affine Bernoulli CenterLocation Choice Deterministic Empirical GaussianNoise2D Independent LogUniform"
    " Mixture Noise RandomBottomLeftLocation RandomBottomRightLocation RandomLeftLocation"
    " RandomRightLocation RandomTopLeftLocation RandomTopRightLocation TruncatedGaussianNoise VonMises"
    " Wrapped",
    "segar.rules": "accelerate apply_burn bounce collide come_to_rest consume kill_condition "
    " lorentz_law_r2 record_drag speed_limit stop_condition",
    "segar.observations": "StateVector Pixels TexturedPixels Stack AllObjects AllState AllTiles Multi ObjectState"
    " OneOf PreviousActions TileState",
    "segar.errors": "ActionError FactorError LevelError PlacementError PriorError",
    "segar.levels": "Dependent",
    "segar.engine": "Simulator State",
    "segar.tasks": "billiards invisiball",
}
_FORMER = {name: room for room, names in _ROOMS.items() for name in names.split()}

# Modules of 0.1 that programs may have imported.
find_moved(
    {
        f"segar.{old}": f"segar.{room}.{new}"
        for room, names in {
            "language": "values effects factors entities parameters shapes relations tasks.task=task",
            "levels": "distribution priors conditional explanation",
            "rules": "world",
            "engine": "simulator",
            "tasks": "tasks.puttputt=puttputt_task tasks.billiards=billiards_task tasks.invisiball=invisiball_task"
            " tasks.find=registry",
            "metrics": "designed_levels=level_design",
            "observations": "observations.find=shipped",
            "cli": "rendering.gallery=gallery rendering.game=game",
        }.items()
        for old, _, new in (name.partition("=") for name in names.split())
        for new in [new or old]
    }
)


def __getattr__(name: str) -> Any:
    """Names that 0.1 exported here; a warning says the room that has them now."""
    return deprecated_names("segar", _FORMER, name)


envs.register_all()
register_suites()
