"""``segar play``: hit the ball with the mouse."""

import argparse
from typing import Any

from segar.cli.arguments import TASK_HELP, add_levels, add_number, at_least, command, sampled_levels, task_named
from segar.rendering import View
from segar.support import need_pygame


def add_commands(commands: Any) -> None:
    """Add ``play`` to the sub-commands of a parser."""
    playing = command(commands, "play", play, "play levels with the mouse", answers=False)
    add_levels(playing)
    add_number(playing, "--level", "to begin with", least=0, default=0)
    playing.add_argument("--task", help=TASK_HELP)
    add_number(playing, "--size", "of the arena [px]", least=64, default=720)
    playing.add_argument("--speed", type=float, default=1.0, help="of time, 0.5 for slow motion (default: %(default)s)")
    playing.add_argument("--steps", type=at_least(1), help="time limit (default: the task's, which is 100 in most)")


def play(chosen: argparse.Namespace) -> None:
    """``segar play``."""
    need_pygame("playing")
    from segar.cli.game import Game

    levels = sampled_levels(chosen)
    game = Game(
        levels,
        task_named(chosen.task, levels),
        level=chosen.level,
        seed=chosen.seed,
        speed=chosen.speed,
        max_steps=chosen.steps,
        view=View(size=chosen.size),
    )
    game.run()
    print(game.score())
