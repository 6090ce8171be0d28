"""A game: a person hits the ball with the mouse."""

from collections.abc import Sequence

import numpy as np
import pygame

from segar.envs import VectorEnv
from segar.errors import SegarError
from segar.language import Task
from segar.levels import Levels
from segar.rendering import Figure, Stage, View, episode_verdict, marks, status_line, steps_per_second
from segar.rendering.painter import Painter
from segar.rendering.window import Window
from segar.support import counted

REACH = 0.6  # [m] from the ball to where a hit is as hard as can be
HELP = "hit: drag from the ball, or click      R again      N next level      space pause      Esc quit"
VERDICTS = {"SUCCESS": (120, 255, 120), "DEAD": (255, 110, 110)}
AIM = (255, 255, 255)
MOUSE_BUTTON = 1


class Game:
    """Levels that a person plays. Time stands still before the first hit, and while the player aims.

    A hit is an action in the direction from the ball to the mouse, the harder the farther the mouse is; between hits the
    action is zero. All that happens comes from :meth:`handle` and :meth:`advance`, so a program can play as well.

    Args:
        levels: what is played, from ``level`` on.
        task: the one that the levels name where it is None. Its action is two numbers, a push to the right and one up.
        seed: of the randomness in rules.
        speed: of time; 1 is as fast as the simulation.
        max_steps: of an episode; as many as agents and the pages of playgrounds have where it is None.

    Attributes:
        episodes: ``(level, ending, return)`` of each episode that ended.

    Raises:
        SegarError: the task has other actions.
    """

    def __init__(
        self,
        levels: Levels,
        task: Task | None = None,
        *,
        level: int = 0,
        seed: int = 0,
        speed: float = 1.0,
        max_steps: int | None = None,
        view: View | None = None,
    ) -> None:
        self.env = VectorEnv(levels, 1, task=task, seed=seed, autoreset_mode="Disabled", max_steps=max_steps)
        if len(self.env.task.action_low) != 2:
            raise SegarError(
                f"a mouse gives two numbers; task {self.env.task.name} takes {len(self.env.task.action_low)}"
            )
        self.view = view or View(size=720)
        self._stage = Stage(levels, self.env.simulator.world, self.env.task, self.view.colours)
        self._painter = Painter(self.view)
        self.episodes, self.level, self.speed = list[tuple[int, str, float]](), level % len(levels), speed
        self.is_open = True
        self.env.reset()
        self.env.step(np.zeros((1, 2), np.float32))  # so that the first hit does not wait for a kernel
        self._start()

    def handle(self, event: pygame.event.Event) -> None:
        """Do what the player asks for with mouse or keyboard; pixels are those of :meth:`picture`."""
        if event.type in (pygame.QUIT, pygame.WINDOWCLOSE):
            self.is_open = False
        elif event.type == pygame.KEYDOWN:
            self._press(event.key)
        elif event.type == pygame.MOUSEBUTTONDOWN and event.button == MOUSE_BUTTON:
            self.aim = None if self.ending else self._place(event.pos)
        elif event.type == pygame.MOUSEMOTION and self.aim is not None:
            self.aim = self._place(event.pos)
        elif event.type == pygame.MOUSEBUTTONUP and event.button == MOUSE_BUTTON and self.aim is not None:
            self._action = self._push(self._place(event.pos))
            self.aim, self.is_running, self.is_paused = None, True, False

    def advance(self) -> bool:
        """Play one step, if time runs; return whether it did."""
        if self.ending or self.aim is not None or self.is_paused or not self.is_running:
            return False
        _, _, terminated, truncated, info = self.env.step(self._action[None])
        self._action = np.zeros(2, np.float32)
        flags = {name: bool(info[name][0]) for name in ("success", "death")}
        self.ending = episode_verdict(flags, bool(terminated[0]), bool(truncated[0]))
        if self.ending:
            self.episodes.append((self.level, self.ending, float(info["return"][0])))
        return True

    def picture(self) -> pygame.Surface:
        """The picture of the present state."""
        now = self.env.state()
        line = status_line(self.env.task, now, 0, self.ending)
        picture = self._painter.draw(self._stage.scene(now.state.values[0], int(now.state.level[0]), line))
        if self.aim is not None:
            self._draw_aim(picture)
        if self.ending:
            self._write(picture, [self.ending, "R again      N next level"], VERDICTS.get(self.ending, AIM))
        elif self.aim is None and (self.is_paused or not self.is_running):
            self._write(picture, ["pause" if self.is_paused else "", HELP], AIM)
        return picture

    def ball(self) -> Figure:
        """What the next hit moves: the first thing that actions move and that is still in play."""
        now = self.env.state()
        figures = self._stage.scene(now.state.values[0], int(now.state.level[0])).figures
        agents = [figure for figure in figures if figure.is_agent]
        return next((figure for figure in agents if figure.is_alive and not figure.is_done), agents[0])

    def score(self) -> str:
        """How the player did, in words."""
        best = max((result for _, _, result in self.episodes), default=None)
        successes = sum(ending == "SUCCESS" for _, ending, _ in self.episodes)
        counts = f"{counted(len(self.episodes), 'episode')}, {successes} successes"
        return counts if best is None else f"{counts}, best return {best:.3f}"

    def run(self, frames: int | None = None) -> None:
        """Play in a window until the player leaves, or for so many frames."""
        height, width, _ = self.view.shape
        window = Window((width, height), f"SEGAR: {self.env.task.name}")
        rate = max(self.speed * steps_per_second(self.env.levels, self.env.task), 1)
        shown = 0
        while self.is_open and window.is_open and (frames is None or shown < frames):
            for event in pygame.event.get():
                self.handle(event)
            self.advance()
            window.show(self.picture(), rate)
            shown += 1
        window.close()

    def _start(self) -> None:
        self.env.reset(options={"levels": np.array([self.level])})
        self.aim: np.ndarray | None = None
        self.is_running = self.is_paused = False
        self.ending = ""
        self._action = np.zeros(2, np.float32)

    def _press(self, key: int) -> None:
        if key == pygame.K_ESCAPE:
            self.is_open = False
        elif key == pygame.K_SPACE:
            self.is_paused = not self.is_paused
        elif key in (pygame.K_r, pygame.K_n):
            self.level = (self.level + (key == pygame.K_n)) % len(self.env.levels)
            self._start()

    def _push(self, place: np.ndarray) -> np.ndarray:
        """The action of a hit towards a place, float32 ``(2,)``: at most as hard as the task allows."""
        task, away = self.env.task, (place - self.ball().place) / REACH
        away /= max(1.0, float(np.abs(away).max()))
        push = np.where(away < 0, -away * np.array(task.action_low), away * np.array(task.action_high))
        return push.astype(np.float32)

    def _place(self, pixel: tuple[int, int]) -> np.ndarray:
        return self._painter.place(pixel, self._stage.world.walls)

    def _draw_aim(self, picture: pygame.Surface) -> None:
        """An arrow from the ball, as long as the hit is hard."""
        assert self.aim is not None
        ball, away = self.ball(), (self.aim - self.ball().place) / REACH
        strength = float(np.abs(away).max())
        end = ball.place + away / max(1.0, strength) * REACH
        start, tip = (self._painter.pixel(place, self._stage.world.walls) for place in (ball.place, end))
        marks.arrow(picture, start, tip, self.view.size / 150, AIM, border=self.view.size / 400)
        self._write(picture, [f"{min(strength, 1):.0%}"], AIM)

    def _write(self, picture: pygame.Surface, lines: Sequence[str], colour: tuple[int, int, int]) -> None:
        """Lines of text in a dark band at the top, the first one large."""
        fonts = [pygame.font.Font(None, self.view.size // 14), pygame.font.Font(None, self.view.size // 38)]
        texts = [font.render(line, True, colour) for font, line in zip(fonts, lines, strict=False) if line]
        height = sum(text.get_height() + 8 for text in texts) + 8
        band = pygame.Surface((self.view.size, height), pygame.SRCALPHA)
        band.fill((16, 16, 18, 190))
        top = 8
        for text in texts:
            band.blit(text, ((self.view.size - text.get_width()) // 2, top))
            top += text.get_height() + 8
        picture.blit(band, (0, 0))
