"""A task whose state has a clock, a counter that no network reads well: guess where the ball is."""

import segar


class Clock(segar.Count):
    """Sub-steps since the episode began, from 0 to 200."""


class Timed(segar.GolfBall):
    clock: Clock


@segar.rule
def tick(clock: Clock) -> segar.SetFactor[Clock]:
    return segar.SetFactor[Clock](clock, clock + 1)


def levels() -> segar.LevelDistribution:
    """Balls anywhere on a line, which nothing moves."""
    return segar.LevelDistribution(
        numbers=[(Timed, 1), (segar.GoalTile, 1)],
        priors=[segar.Prior(segar.Position, segar.RandomUniformLocation())],
        world=segar.World(rules=[tick]),
    )


def stay(ball: Timed, action: segar.Action) -> segar.SetFactor[segar.Charge]:
    return segar.SetFactor[segar.Charge](ball[segar.Charge], 0.0 * action[0])


def guess(ball: Timed, action: segar.Action) -> float:
    miss = action[0] - ball[segar.Position][0]
    return -miss * miss


task = segar.Task("guess", stay, guess, action_low=(-1.0,), action_high=(1.0,), max_steps=40)
