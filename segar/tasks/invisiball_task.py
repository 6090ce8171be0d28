"""Invisiball: PuttPutt with a ball that is invisible after the first push."""

from dataclasses import replace
from typing import Any

from segar.language import GolfBall, SetFactor, Task, Visible
from segar.tasks.puttputt_task import demo_actions, puttputt

__all__ = ["demo_actions", "invisiball"]


def invisiball(reward: str = "squared", **options: Any) -> Task:
    """PuttPutt, but each action makes the ball invisible: from the first step on, it can only be seen by its effects on others.

    >>> segar.tasks.invisiball().name
    'invisiball-squared'

    Physics and reward go on as in PuttPutt; so do the results and the scripted player, which sees the true factors.
    Pixels do not draw what is invisible. A state vector holds the true state, the ball included;
    ``StateVector(sees_invisible=False)`` shows zeros instead.

    Args:
        reward, options: as :func:`segar.tasks.puttputt_task.puttputt` takes them.
    """
    task = puttputt(reward, **options)

    def vanish(ball: GolfBall) -> SetFactor[Visible]:
        return SetFactor[Visible](ball[Visible], False)

    assert callable(task.act)
    return replace(task, name=f"invisiball-{reward}", act=(task.act, vanish))
