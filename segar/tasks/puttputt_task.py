"""PuttPutt: push the golf ball until it rests its centre on the goal's."""

from collections.abc import Callable
from functools import partial

import numpy as np

from segar.errors import SegarError, did_you_mean
from segar.language import (
    Acceleration,
    Action,
    Alive,
    Done,
    Entity,
    Factor,
    Factors,
    Flag,
    GoalTile,
    GolfBall,
    Mass,
    Position,
    SetFactor,
    Task,
    VectorValue,
    Velocity,
)

ARENA_DIAGONAL = 8.0**0.5  # [m] distances are divided by it; 2.828, as in 2022
GOAL_DISTANCE = 0.01  # share of the arena's diagonal at which the ball has arrived
DEATH_PENALTY = 100.0
IMPULSE = 2.0  # [kg m/s] of a unit action
APPROACH = 4.0  # [1/s] the scripted player halves its distance in ln 2 / 4 of a second


def puttputt(
    reward: str = "squared",
    impulse: float = IMPULSE,
    goal_distance: float = GOAL_DISTANCE,
    goal_speed: float | None = None,
    death_penalty: float = DEATH_PENALTY,
    max_steps: int = 100,
    sub_steps: int = 5,
) -> Task:
    """The task of the paper's families. It reports the distance to the goal, and the ball's motion, mass and life.

    Args:
        reward: 'squared' is -d^2, 'linear' is -d, where d is the distance of ball and goal as a share of the
            arena's diagonal, after the step.
        impulse: what a unit action adds to the ball's momentum [kg m/s].
        goal_distance: d at which the ball has arrived.
        goal_speed: speed [m/s] above which the ball rolls over the goal without having arrived; None for no limit.
        death_penalty: subtracted in the step in which the ball dies.

    Raises:
        SegarError: unknown reward, a number that is not finite, or a distance or speed below 0.
    """
    if reward not in ("squared", "linear"):
        raise SegarError(f"puttputt has no reward '{reward}'.{did_you_mean(reward, ('squared', 'linear'))}")
    sizes = {"impulse": impulse, "goal_distance": goal_distance, "death_penalty": death_penalty}
    require_finite("puttputt", **sizes, **({} if goal_speed is None else {"goal_speed": goal_speed}))
    if min(goal_distance, goal_speed or 0) < 0:
        raise SegarError(
            f"puttputt: no ball arrives at goal_distance={goal_distance!r}, goal_speed={goal_speed!r}: at least 0"
        )

    def push(ball: GolfBall, action: Action) -> SetFactor[Velocity]:
        if ball[Mass] == 0:
            return None
        kick = VectorValue(action[0], action[1]) * impulse
        return SetFactor[Velocity](ball[Velocity], ball[Velocity] + kick / ball[Mass])

    def distance_reward(ball: GolfBall, goal: GoalTile) -> float:
        d = distance(ball, goal)
        near = -(d * d) if reward == "squared" else -d
        return near if ball[Alive] else near - death_penalty

    def is_at_goal(ball: GolfBall, goal: GoalTile) -> bool:
        near = distance(ball, goal) <= goal_distance
        return near if goal_speed is None else near and ball[Velocity].norm() <= goal_speed

    def is_over(ball: GolfBall, goal: GoalTile) -> bool:
        return ball[Done] or not ball[Alive] or is_at_goal(ball, goal)

    def has_arrived(ball: GolfBall, goal: GoalTile) -> bool:
        return ball[Alive] and not ball[Done] and is_at_goal(ball, goal)

    return Task(
        f"puttputt-{reward}",
        push,
        distance_reward,
        is_over,
        has_arrived,
        has_died,
        max_steps=max_steps,
        sub_steps=sub_steps,
        results=RESULTS,
        demo_actions=partial(demo_actions, impulse=impulse),
    )


def require_finite(task: str, **numbers: float) -> None:
    """Raise :class:`SegarError` for an option of a task that is not a finite number."""
    for name, value in numbers.items():
        if not isinstance(value, (int, float, np.integer, np.floating)) or not np.isfinite(value):
            raise SegarError(f"{task}: {name} must be a finite number, not {value!r}")


def has_died(ball: GolfBall) -> bool:
    return not ball[Alive]


def demo_actions(factors: Factors, impulse: float = IMPULSE) -> np.ndarray:
    """The actions of a scripted player, float32 ``(num_envs, 2)``: straight to the goal, slower the nearer it is.

    It does not avoid obstacles, and has the same actions as the agent: a push that is too large is scaled down. Of the
    factors of a single environment it gives a single action.
    """
    ball, goal = factors.slots(GolfBall)[0], factors.slots(GoalTile)[0]
    x, v, m = factors["Position"], factors["Velocity"][..., ball, :], factors["Mass"][..., ball]
    return push_towards(APPROACH * (x[..., goal, :] - x[..., ball, :]), v, m, impulse)


def push_towards(wanted: np.ndarray, v: np.ndarray, m: np.ndarray, impulse: float) -> np.ndarray:
    """The actions that turn velocities ``v`` into ``wanted``, or come nearest to that; float32 ``(..., 2)``.

    Args:
        wanted, v: float ``(..., 2)`` [m/s].
        m: masses, float ``(...)``.
        impulse: of a unit action.
    """
    kick = (wanted - v) * m[..., None] / impulse
    too_hard = np.maximum(np.abs(kick).max(axis=-1, keepdims=True), 1.0)
    return np.nan_to_num(kick / too_hard).astype(np.float32)


def distance_to_goal(factors: Factors) -> np.ndarray:
    """Distance of ball and goal as a share of the arena's diagonal, float ``(num_envs,)``."""
    ball, goal = factors.slots(GolfBall)[0], factors.slots(GoalTile)[0]
    x = factors["Position"]
    return np.sqrt(((x[..., ball, :] - x[..., goal, :]) ** 2).sum(axis=-1)) / ARENA_DIAGONAL


def factor_of(entity: type[Entity], factor: type[Factor]) -> Callable[[Factors], np.ndarray]:
    """The result that reports a factor of the first entity of a type."""
    return partial(_report, entity=entity, factor=factor)


def _report(factors: Factors, entity: type[Entity], factor: type[Factor]) -> np.ndarray:
    value = np.take(factors[factor.__name__], factors.slots(entity)[0], axis=1)
    return value == 1 if issubclass(factor, Flag) else value


RESULTS = {
    "distance_to_goal": distance_to_goal,
    "velocity": factor_of(GolfBall, Velocity),
    "acceleration": factor_of(GolfBall, Acceleration),
    "mass": factor_of(GolfBall, Mass),
    "alive": factor_of(GolfBall, Alive),
}


def distance(ball: GolfBall, goal: GoalTile) -> float:
    """Distance of the centres as a share of the arena's diagonal."""
    return (ball[Position] - goal[Position]).norm() / ARENA_DIAGONAL
