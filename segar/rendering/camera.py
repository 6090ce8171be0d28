"""The camera of an environment: its frames as arrays, or in a window that follows what happens."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from segar.errors import SegarError, did_you_mean
from segar.language import Framerate
from segar.rendering.scene import Stage
from segar.rendering.view import View
from segar.support import need_pygame

if TYPE_CHECKING:
    from segar.envs import Snapshot, VectorEnv

RENDER_MODES = ["rgb_array", "human"]
SMALL = View(size=256)  # of each of several environments
SHOWN = 16  # environments in a window, at most


class Camera:
    """Draws the environments of a batch.

    Args:
        env: the batch.
        mode: 'rgb_array' or 'human'.
        view: how; by default the arena has 512 pixels, or 256 where there are several environments.

    Raises:
        SegarError: unknown mode, or pygame is not installed.
    """

    def __init__(self, env: VectorEnv, mode: str, view: View | None = None) -> None:
        if mode not in RENDER_MODES:
            raise SegarError(f"there is no render_mode '{mode}'.{did_you_mean(str(mode), RENDER_MODES)}")
        need_pygame("drawing for people")
        from segar.rendering.painter import Painter

        self.view = view or (View() if env.num_envs == 1 else SMALL)
        self._env, self._mode, self._window = env, mode, None
        self._stage = Stage(env.levels, env.simulator.world, env.task, self.view.colours)
        self._painter = Painter(self.view)

    def render(self, endings: Sequence[str] = ()) -> tuple[np.ndarray, ...] | None:
        """A frame of each environment, uint8 ``view.shape``; or None, having shown the first 16 in a window.

        Args:
            endings: how the episode of each environment ended, '' if it did not; none did by default.
        """
        if self._mode == "human":
            self._show(endings)
            return None
        return tuple(self._frames(range(self._env.num_envs), endings))

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()

    def _frames(self, rows: Sequence[int], endings: Sequence[str]) -> list[np.ndarray]:
        now = self._env.state()
        values, level = now.state.values, now.state.level
        lines = [status_line(self._env, now, e, endings[e] if endings else "") for e in rows]
        scenes = (self._stage.scene(values[e], int(level[e]), line) for e, line in zip(rows, lines, strict=True))
        return [self._painter.frame(scene) for scene in scenes]

    def _show(self, endings: Sequence[str]) -> None:
        from segar.rendering.window import Window

        frame = side_by_side(self._frames(range(min(self._env.num_envs, SHOWN)), endings))
        if self._window is None:
            self._window = Window((frame.shape[1], frame.shape[0]), f"SEGAR: {self._env.task.name}")
        self._window.show(frame, steps_per_second(self._env))


def status_line(env: VectorEnv, now: Snapshot, row: int, ending: str = "") -> str:
    """What stands below the arena of an environment: step, return and level, and how the episode ended."""
    said = f"step {now.lengths[row]} / {env.task.max_steps}    return {now.returns[row]:.3f}"
    said += f"    level {now.state.level[row]}    {env.task.name}"
    return (f"{said}    {ending}" if ending else said).replace("-0.000", "0.000")


def ending_of(info: dict[str, Any], terminated: bool, truncated: bool) -> str:
    """How an episode ended, in a word, from what a step of a single environment said; '' if it goes on."""
    if not (terminated or truncated):
        return ""
    return "SUCCESS" if info["success"] else "DEAD" if info["death"] else "TIME IS UP" if truncated else "OVER"


def steps_per_second(env: VectorEnv) -> int:
    """Steps in a second of simulated time, of the environment's first level, at least 1."""
    levels = env.levels
    framerate = levels.parameters[0, levels.layout.parameters.index(Framerate)]
    return max(round(float(framerate) / env.task.sub_steps), 1)


def side_by_side(frames: Sequence[np.ndarray]) -> np.ndarray:
    """Equal frames in rows and columns, about as many of each; uint8 ``(height, width, 3)``."""
    columns = int(np.ceil(np.sqrt(len(frames))))
    rows = -(-len(frames) // columns)
    height, width, colours = frames[0].shape
    sheet = np.zeros((rows, height, columns, width, colours), np.uint8)
    for k, frame in enumerate(frames):
        sheet[k // columns, :, k % columns] = frame
    return sheet.reshape(rows * height, columns * width, colours)
