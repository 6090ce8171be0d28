"""Billiards: push the cue ball so that the others fall into the pockets."""

from functools import partial

import numpy as np

from segar.errors import SegarError, did_you_mean
from segar.language import (
    Action,
    Alive,
    Ball,
    Best,
    CueBall,
    Done,
    Every,
    Factors,
    Hole,
    Mass,
    Position,
    SetFactor,
    Task,
    VectorValue,
    Velocity,
)
from segar.tasks.puttputt_task import ARENA_DIAGONAL, DEATH_PENALTY, IMPULSE, factor_of, push_towards, require_finite

CUE_SPEED = 4.0  # [m/s] of the scripted player
REWARDS = ("distance", "potted")


def billiards(
    reward: str = "distance",
    impulse: float = IMPULSE,
    death_penalty: float = DEATH_PENALTY,
    max_steps: int = 100,
    sub_steps: int = 5,
) -> Task:
    """Ten balls, four pockets, and a cue ball that the agent pushes.

    >>> segar.tasks.billiards("potted").name
    'billiards-potted'

    The episode is over when the cue ball falls or dies, and when all others are down, which is success. A ball is down
    when a hole has swallowed it: it is Done.

    The reward needs no memory beside the factors. 'distance' follows from where the balls are. 'potted' pays for each
    ball that fell in this step: one that is Done and still Alive. The next action takes what is Done off the table,
    Alive becomes False, and so each ball counts once.

    Its results are the cue ball's distance to the nearest pocket, how many balls are down, and the cue ball's velocity,
    mass and life.

    Args:
        reward: 'distance' is minus the sum over balls of d^2, where d is a ball's distance to the nearest pocket as a
            share of the arena's diagonal, after the step; 'potted' is the number of balls that fell in the step.
        impulse: what a unit action adds to the cue ball's momentum [kg m/s].
        death_penalty: subtracted in the step in which the cue ball dies; falling into a pocket is no death.

    Raises:
        SegarError: unknown reward, or a number that is not finite.
    """
    if reward not in REWARDS:
        raise SegarError(f"billiards has no reward '{reward}'.{did_you_mean(reward, REWARDS)}")
    require_finite("billiards", impulse=impulse, death_penalty=death_penalty)

    def strike(cue: CueBall, action: Action) -> SetFactor[Velocity]:
        if cue[Mass] == 0:
            return None
        kick = VectorValue(action[0], action[1]) * impulse
        return SetFactor[Velocity](cue[Velocity], cue[Velocity] + kick / cue[Mass])

    def penalty(cue: CueBall) -> float:
        return 0.0 if cue[Alive] else -death_penalty

    return Task(
        f"billiards-{reward}",
        act=(strike, take_off),
        reward=(nearness if reward == "distance" else has_fallen, penalty),
        terminated=(is_lost, is_clear),
        success=has_cleared,
        death=has_died,
        max_steps=max_steps,
        sub_steps=sub_steps,
        results=RESULTS,
        demo_actions=partial(demo_actions, impulse=impulse),
    )


def take_off(ball: Ball) -> SetFactor[Alive]:
    return SetFactor[Alive](ball[Alive], False) if ball[Done] else None


def nearness(ball: Ball, pocket: Best[Hole]) -> float:
    d = (ball[Position] - pocket[Position]).norm() / ARENA_DIAGONAL
    return -(d * d)


def has_fallen(ball: Ball) -> float:
    return 1.0 if ball[Done] and ball[Alive] else 0.0


def is_lost(cue: CueBall) -> bool:
    return cue[Done] or not cue[Alive]


def is_clear(ball: Every[Ball]) -> bool:
    return ball[Done] or not ball[Alive]


def has_cleared(cue: CueBall, ball: Every[Ball]) -> bool:
    return cue[Alive] and not cue[Done] and (ball[Done] or not ball[Alive])


def has_died(cue: CueBall) -> bool:
    return not cue[Alive]


def demo_actions(factors: Factors, impulse: float = IMPULSE) -> np.ndarray:
    """The actions of a scripted player, float32 ``(num_envs, 2)``: it drives the ball that lies best into a pocket.

    Of all balls on the table and all pockets it takes the pair that the cue ball is most nearly in line with, and goes
    for the place from which it would touch the ball on the line to the pocket. It looks one push ahead and no farther,
    so it falls into pockets itself now and then. It sees ``env.factors``, of one environment too.
    """
    cue, balls, pockets = factors.slots(CueBall)[0], factors.slots(Ball), factors.slots(Hole)
    x, radius = factors["Position"], factors["Size"] / 2
    me, v, m = x[..., cue, :], factors["Velocity"][..., cue, :], factors["Mass"][..., cue]
    ball, pocket = x[..., balls, None, :], x[..., None, pockets, :]
    line = _unit(pocket - ball)
    touch = radius[..., balls] + radius[..., cue, None]
    course = ball - line * touch[..., None, None] - me[..., None, None, :]
    straightness = (line * _unit(course)).sum(axis=-1)
    straightness[(factors["Done"][..., balls] == 1)] = -np.inf
    best = straightness.reshape(*me.shape[:-1], -1).argmax(axis=-1)
    course = np.take_along_axis(course.reshape(*me.shape[:-1], -1, 2), best[..., None, None], axis=-2)[..., 0, :]
    return push_towards(CUE_SPEED * _unit(course), v, m, impulse)


def distance_to_pocket(factors: Factors) -> np.ndarray:
    """Distance of the cue ball and the nearest pocket as a share of the arena's diagonal, float ``(num_envs,)``."""
    x, cue = factors["Position"], factors.slots(CueBall)[0]
    squares = ((x[:, factors.slots(Hole)] - x[:, cue, None]) ** 2).sum(axis=-1)
    return np.sqrt(np.fmin.reduce(squares, axis=1)) / ARENA_DIAGONAL


def balls_potted(factors: Factors) -> np.ndarray:
    """How many balls are down, the cue ball not counted; int ``(num_envs,)``."""
    return (factors["Done"][:, factors.slots(Ball)] == 1).sum(axis=1)


def _unit(vectors: np.ndarray) -> np.ndarray:
    length = np.sqrt((vectors**2).sum(axis=-1, keepdims=True))
    return vectors / np.where(length > 0, length, 1.0)


RESULTS = {
    "distance_to_pocket": distance_to_pocket,
    "balls_potted": balls_potted,
    "velocity": factor_of(CueBall, Velocity),
    "mass": factor_of(CueBall, Mass),
    "alive": factor_of(CueBall, Alive),
}
