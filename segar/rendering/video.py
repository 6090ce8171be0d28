"""Videos and GIFs of what happens in an environment."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from itertools import chain, count
from os import PathLike
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from segar.errors import SegarError, did_you_mean
from segar.rendering.camera import side_by_side
from segar.support import need, replacing

FORMATS = (".mp4", ".gif")
FRAMES_PER_SECOND = 20  # where the environment does not say


def record(
    env: gymnasium.Env | gymnasium.vector.VectorEnv,
    path: str | PathLike[str],
    policy: Callable[[Any, dict[str, Any]], Any] | None = None,
    *,
    seed: int | None = 0,
    options: dict[str, Any] | None = None,
    steps: int | None = None,
    fps: float | None = None,
) -> int:
    """Play an episode, record a video of it in ``path``, and return how many frames it has.

    Args:
        env: a Gymnasium environment, single or vectorised, made with ``render_mode="rgb_array"``. Several environments
            are shown side by side.
        path: what ends in .mp4 or .gif. A file there is replaced only by a complete one.
        policy: function of observation and info that gives an action (of all environments); uniform where it is None.
        seed: of the environment and of the uniform policy.
        options: for the reset, such as ``{"level": 3}``.
        steps: how many to record at most; by default one episode, of a vector environment 100 steps.
        fps: frames per second; by default in time with the simulation.

    Raises:
        SegarError: the environment gives no frames, the format is not known, imageio is not installed, or the file
            cannot be written.
    """
    if env.render_mode != "rgb_array":
        raise SegarError(f"record needs an environment with render_mode='rgb_array'; this one's is {env.render_mode!r}")
    rate = env.metadata.get("render_fps", FRAMES_PER_SECOND) if fps is None else fps
    return write_video(path, _frames(env, policy, seed, options, steps), float(rate))


def check_video(path: Path) -> None:
    """Raise :class:`SegarError` where no video can be written into such a file: ask before what is shown is computed."""
    if path.suffix.lower() not in FORMATS:
        raise SegarError(f"a video is .mp4 or .gif, not '{path.name}'.{did_you_mean(path.suffix, FORMATS)}")
    need("writing videos", "imageio", "imageio_ffmpeg")


def write_video(path: str | PathLike[str], frames: Iterable[np.ndarray], fps: float = FRAMES_PER_SECOND) -> int:
    """Write frames, uint8 ``(height, width, 3)``, of even height and width for mp4; return how many there were.

    Raises:
        SegarError: there are no frames, the format is not known, imageio is not installed, or the file cannot be
            written.
    """
    path = Path(path)
    check_video(path)
    import imageio.v2 as imageio

    options: dict[str, Any] = {"loop": 0, "duration": 1000 / fps}
    if path.suffix.lower() == ".mp4":
        options = {"fps": fps, "codec": "libx264", "quality": 8, "macro_block_size": 2}
    frames = iter(frames)
    first = next(frames, None)
    if first is None:
        raise SegarError(f"the video {path} would have no frames")
    with replacing(path, "the video") as beside:
        writer: Any = imageio.get_writer(beside, mode="I", **options)
        with closing(writer):  # its own `with` leaves ffmpeg running after an error
            written = 0
            for frame in chain([first], frames):
                writer.append_data(frame)
                written += 1
    return written


def _frames(
    env: Any, policy: Any, seed: int | None, options: dict[str, Any] | None, steps: int | None
) -> Iterator[np.ndarray]:
    """Frames from the reset to the end of an episode."""
    is_batch = isinstance(env, gymnasium.vector.VectorEnv)
    choose = policy or _uniform(env.action_space, seed)
    steps = 100 if steps is None and is_batch else steps
    observation, info = env.reset(seed=seed, options=options)
    yield _frame(env, is_batch)
    for _ in count() if steps is None else range(steps):
        observation, _, terminated, truncated, info = env.step(choose(observation, info))
        yield _frame(env, is_batch)
        if not is_batch and (terminated or truncated):
            return


def _frame(env: Any, is_batch: bool) -> np.ndarray:
    return side_by_side(env.render()) if is_batch else env.render()


def _uniform(space: Any, seed: int | None) -> Callable[[Any, dict[str, Any]], np.ndarray]:
    rng = np.random.default_rng(seed)
    return lambda observation, info: rng.uniform(space.low, space.high).astype(space.dtype)
