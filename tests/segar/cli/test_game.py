"""A person plays: events go in, the ball rolls, and the score says how it went."""

import numpy as np
import pygame
import pytest

import segar
from segar.cli.game import Game
from segar.rendering import View

LEVELS = segar.family("empty-hard").sample(3, seed=0)
VIEW = View(size=256)


@pytest.fixture
def game() -> Game:
    return Game(LEVELS, view=VIEW)


def pixel(game: Game, place) -> tuple[int, int]:
    x, y = game._painter.pixel(np.asarray(place), 1.0)
    return round(x), round(y)


def event(kind: int, **what) -> pygame.event.Event:
    return pygame.event.Event(kind, **what)


def drag(game: Game, start, end) -> None:
    """Press at one place, let go at another."""
    game.handle(event(pygame.MOUSEBUTTONDOWN, pos=pixel(game, start), button=1))
    game.handle(event(pygame.MOUSEMOTION, pos=pixel(game, end), rel=(0, 0), buttons=(1, 0, 0)))
    game.handle(event(pygame.MOUSEBUTTONUP, pos=pixel(game, end), button=1))


def press(game: Game, key: int) -> None:
    game.handle(event(pygame.KEYDOWN, key=key))


def goal(game: Game) -> np.ndarray:
    return game.env.levels.values[game.level, 1, :2]


def test_a_drag_from_the_ball_pushes_it_that_way_and_between_hits_nobody_pushes(game):
    start = game.ball().place
    way = np.array([-0.2, 0.25])
    drag(game, start, start + way)
    assert game.advance()
    velocity = game.ball().velocity
    assert velocity @ way / np.hypot(*velocity) / np.hypot(*way) > 0.99
    game.advance()
    assert np.hypot(*game.ball().velocity) < np.hypot(*velocity)


def test_a_click_pushes_the_ball_there_the_harder_the_farther(game):
    speeds = []
    for far in (0.1, 0.3, 5.0):
        press(game, pygame.K_r)
        place = game.ball().place + far * np.array([-0.6, 0.8])
        drag(game, place, place)
        game.advance()
        speeds.append(float(np.hypot(*game.ball().velocity)))
    assert speeds[0] < speeds[1] < speeds[2]
    largest = np.hypot(0.75, 1.0) * 2.0  # the action is at most 1 in each axis, and its impulse 2
    assert speeds[2] == pytest.approx(largest, rel=0.1)


def test_time_stands_still_until_the_first_hit_while_somebody_aims_and_in_a_pause(game):
    assert not game.advance() and not game.advance()
    assert game.env.state().lengths[0] == 0
    drag(game, game.ball().place, game.ball().place + np.array([0.0, 0.2]))
    assert game.advance()
    game.handle(event(pygame.MOUSEBUTTONDOWN, pos=(10, 10), button=1))
    assert not game.advance()
    game.handle(event(pygame.MOUSEBUTTONUP, pos=pixel(game, game.ball().place), button=1))
    press(game, pygame.K_SPACE)
    assert not game.advance()
    press(game, pygame.K_SPACE)
    assert game.advance()


def test_who_hits_the_goal_wins_and_goes_on_to_the_next_level(game):
    drag(game, game.ball().place, goal(game))
    while game.advance():
        pass
    assert game.ending == "SUCCESS" and game.score().startswith("1 episode, 1 successes")
    assert game.episodes[0][:2] == (0, "SUCCESS")
    drag(game, game.ball().place, goal(game))
    assert not game.advance()  # it is over
    press(game, pygame.K_n)
    assert game.level == 1 and game.ending == "" and game.env.state().lengths[0] == 0
    press(game, pygame.K_n)
    press(game, pygame.K_n)
    assert game.level == 0


def test_r_starts_the_level_again(game):
    start = game.ball().place
    drag(game, start, start + np.array([0.3, 0.0]))
    for _ in range(3):
        game.advance()
    assert (game.ball().place != start).any()
    press(game, pygame.K_r)
    assert (game.ball().place == start).all() and game.level == 0 and not game.advance()


def test_time_runs_out():
    game = Game(LEVELS, view=VIEW, max_steps=3)
    drag(game, game.ball().place, game.ball().place + np.array([0.0, 0.05]))
    while game.advance():
        pass
    assert game.ending == "TIME IS UP" and game.score().startswith("1 episode, 0 successes, best return -")


def test_what_somebody_does_can_be_seen(game):
    pictures = [pygame.image.tobytes(game.picture(), "RGB")]
    game.handle(event(pygame.MOUSEBUTTONDOWN, pos=pixel(game, game.ball().place), button=1))
    for did in (
        event(pygame.MOUSEMOTION, pos=(20, 20), rel=(0, 0), buttons=(1, 0, 0)),  # the arrow of the aim
        event(pygame.MOUSEBUTTONUP, pos=(20, 20), button=1),
        event(pygame.KEYDOWN, key=pygame.K_SPACE),
    ):
        game.handle(did)
        pictures.append(pygame.image.tobytes(game.picture(), "RGB"))
    assert len(set(pictures)) == 4


@pytest.mark.parametrize("leave", [event(pygame.KEYDOWN, key=pygame.K_ESCAPE), event(pygame.QUIT)])
def test_the_window_takes_events_until_somebody_leaves(game, leave, monkeypatch):
    rates = []
    monkeypatch.setattr("segar.rendering.window.pygame.time.Clock", lambda: Clock(rates))
    pygame.display.init()
    pygame.event.clear()
    start = pixel(game, game.ball().place)
    pygame.event.post(event(pygame.MOUSEBUTTONDOWN, pos=start, button=1))
    pygame.event.post(event(pygame.MOUSEBUTTONUP, pos=pixel(game, goal(game)), button=1))
    game.run(frames=3)
    assert game.env.state().lengths[0] == 3 and rates == [20, 20, 20]
    pygame.event.post(leave)
    game.run(frames=100)
    assert game.score().startswith("0 episodes") and not game.is_open
    assert len(rates) <= 5


class Clock:
    """Counts how often it was asked to wait, and does not."""

    def __init__(self, rates: list) -> None:
        self.rates = rates

    def tick(self, rate: float) -> None:
        self.rates.append(rate)


def test_tasks_with_other_actions_are_refused():
    def push(ball: segar.GolfBall, action: segar.Action) -> segar.SetFactor[segar.Velocity]:
        return segar.SetFactor[segar.Velocity](ball[segar.Velocity], segar.language.VectorValue(action[0], 0.0))

    task = segar.Task("sideways", push, action_low=(-1.0,), action_high=(1.0,))
    with pytest.raises(segar.SegarError, match="a mouse gives two numbers; task sideways takes 1"):
        Game(LEVELS, task)
