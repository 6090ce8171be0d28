"""The camera of an environment: its frames as arrays, also without pygame, or in a window that follows what happens."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from segar.engine import State
from segar.errors import SegarError, did_you_mean
from segar.language import NO_LIMIT, Framerate, Task, WorldRules
from segar.levels import Levels
from segar.observations import Pixels
from segar.rendering.scene import Stage, View
from segar.support import has_pygame, need_pygame

RENDER_MODES = ["rgb_array", "human"]  # the second needs pygame
SMALL = View(size=256)  # of each of several environments
SHOWN = 16  # environments in a window, at most
LARGEST = 256  # [px] the side of the largest frame that Pixels draws; larger ones repeat pixels
MULTIPLE = 4  # of which the side is one


class Episodes(Protocol):
    """What is drawn of running episodes; a :class:`segar.envs.Snapshot` has it.

    Attributes:
        state: the states of all environments.
        returns: float64 ``(num_envs,)``, rewards so far.
        lengths: int64 ``(num_envs,)``, steps so far.
    """

    state: State
    returns: np.ndarray
    lengths: np.ndarray


class Camera:
    """Draws the environments of a batch.

    Args:
        levels, world, task: those of the batch.
        num_envs: how many environments it has.
        mode: 'rgb_array' or 'human'.
        view: how; by default the arena has 512 pixels, or 256 where there are several environments.

    Frames in an array need no pygame. Without it they are plain: colours and outlines as the agent sees them, and neither
    labels nor arrows nor the text below the arena; a warning says so once.

    Raises:
        SegarError: unknown mode, or pygame, which a window needs, is not installed.
    """

    def __init__(
        self, levels: Levels, world: WorldRules, task: Task, num_envs: int, mode: str, view: View | None = None
    ) -> None:
        if mode not in RENDER_MODES:
            raise SegarError(f"there is no render_mode '{mode}'.{did_you_mean(str(mode), RENDER_MODES)}")
        if mode == "human":
            need_pygame("a window")
        self.view = view or (View() if num_envs == 1 else SMALL)
        self._stage = Stage(levels, world, task, self.view.colours)
        self._num_envs, self.mode, self._window = num_envs, mode, None

    def render(self, now: Episodes, verdicts: Sequence[str] = ()) -> tuple[np.ndarray, ...] | None:
        """A frame of each environment, uint8 ``view.shape``; or None, after the first 16 were shown in a window.

        Args:
            now: the episodes that run.
            verdicts: how the episode of each environment ended, '' if it did not; by default none ended.
        """
        if self.mode == "human":
            self._show(now, verdicts)
            return None
        return tuple(self._frames(now, range(self._num_envs), verdicts))

    def show_levels(self, levels: Levels) -> None:
        """Draw the states of other levels of the same layout, in the same window."""
        self._stage = replace(self._stage, levels=levels)
        vars(self).pop("_plain", None)

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()

    def _frames(self, now: Episodes, rows: Sequence[int], verdicts: Sequence[str]) -> list[np.ndarray]:
        if not has_pygame():
            return self._plain.frames(now.state, rows)
        lines = [status_line(self._stage.task, now, e, verdicts[e] if verdicts else "") for e in rows]
        values, level = now.state.values, now.state.level
        scenes = (self._stage.scene(values[e], int(level[e]), line) for e, line in zip(rows, lines, strict=True))
        return [self._painter.frame(scene) for scene in scenes]

    @cached_property
    def _painter(self) -> Any:
        """Draws for people; made when the first frame is asked for, because it loads pygame."""
        need_pygame("drawing for people")
        from segar.rendering.painter import Painter

        return Painter(self.view)

    @cached_property
    def _plain(self) -> "PlainFrames":
        """Draws where pygame is not installed."""
        warnings.warn(
            "pygame is not installed: frames have no labels, arrows and text; pip install 'segar[render]'",
            UserWarning,
            stacklevel=6,
        )
        return PlainFrames(self._stage.levels, self.view, self._num_envs)

    def _show(self, now: Episodes, verdicts: Sequence[str]) -> None:
        from segar.rendering.window import Window

        frame = side_by_side(self._frames(now, range(min(self._num_envs, SHOWN)), verdicts))
        if self._window is None:
            self._window = Window((frame.shape[1], frame.shape[0]), f"SEGAR: {self._stage.task.name}")
        self._window.show(frame, steps_per_second(self._stage.levels, self._stage.task))


class PlainFrames:
    """Frames without pygame, as large as a view asks for: what :class:`segar.observations.Pixels` draws of a batch of
    ``num_envs`` environments on these levels."""

    def __init__(self, levels: Levels, view: View, num_envs: int) -> None:
        side = min(view.size // MULTIPLE * MULTIPLE, LARGEST)
        self._view, self._num_envs = view, num_envs
        self._pixels = Pixels(side, colours=view.colours).bind(levels, num_envs)
        self._nearest = np.arange(view.size) * side // view.size
        self._drawn = np.empty((num_envs, side, side, 3), np.uint8)

    def frames(self, state: State, rows: Sequence[int]) -> list[np.ndarray]:
        """A frame of each environment in ``rows``, uint8 ``view.shape``; the line below the arena is black."""
        everywhere = np.arange(self._num_envs)
        self._pixels.begin(state.values, state.level, np.ones(self._num_envs, np.bool_))
        self._pixels.write(state.values, state.level, self._drawn, everywhere)
        frames = np.zeros((len(rows), *self._view.shape), np.uint8)
        frames[:, : self._view.size] = self._drawn[np.ix_(np.asarray(rows), self._nearest, self._nearest)]
        return list(frames)


def status_line(task: Task, now: Episodes, row: int, verdict: str = "") -> str:
    """The text below the arena of an environment: step, return and level, and how the episode ended."""
    limit = "" if task.max_steps == NO_LIMIT else f" / {task.max_steps}"
    line = f"step {now.lengths[row]}{limit}    return {now.returns[row]:.3f}"
    line += f"    level {now.state.level[row]}    {task.name}"
    return (f"{line}    {verdict}" if verdict else line).replace("-0.000", "0.000")


def episode_verdict(info: Mapping[str, Any], terminated: bool, truncated: bool) -> str:
    """How an episode ended, in a word; '' if it goes on. ``info`` is that of a step of a single environment."""
    if not (terminated or truncated):
        return ""
    return "SUCCESS" if info["success"] else "DEAD" if info["death"] else "TIME IS UP" if truncated else "OVER"


def steps_per_second(levels: Levels, task: Task) -> int:
    """Steps of a task in a second of simulated time on the first level, at least 1."""
    framerate = levels.parameters[0, levels.layout.parameters.index(Framerate)]
    return max(round(float(framerate) / task.sub_steps), 1)


def side_by_side(frames: Sequence[np.ndarray]) -> np.ndarray:
    """Equal frames in rows and columns, about as many of each; uint8 ``(height, width, 3)``."""
    columns = int(np.ceil(np.sqrt(len(frames))))
    rows = -(-len(frames) // columns)
    height, width, colours = frames[0].shape
    sheet = np.zeros((rows, height, columns, width, colours), np.uint8)
    for k, frame in enumerate(frames):
        sheet[k // columns, :, k % columns] = frame
    return sheet.reshape(rows * height, columns * width, colours)
