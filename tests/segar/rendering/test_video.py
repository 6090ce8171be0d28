"""Videos: written whole or not at all, with as many frames as were drawn; Gymnasium's RecordVideo works."""

import subprocess
import sys

import gymnasium
import imageio.v3
import imageio_ffmpeg
import numpy as np
import pytest

import segar
from segar.rendering import View, record, write_video

LEVELS = segar.family("empty-hard").sample(4, seed=0)
SMALL = View(size=128)


def single(**options) -> segar.envs.Env:
    return segar.envs.Env(LEVELS, render_mode="rgb_array", view=SMALL, max_steps=12, **options)


def film_in(path, side: int = 128) -> np.ndarray:
    """The frames of a file, uint8 ``[frame, side, side, 3]``."""
    if path.suffix == ".gif":
        return imageio.v3.imread(path, index=None)
    # Not through imageio, whose reader leaves pipes open.
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-i", path, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    return np.frombuffer(subprocess.run(command, capture_output=True, check=True).stdout, np.uint8).reshape(
        -1, side, side, 3
    )


@pytest.mark.parametrize("name", ["film.mp4", "film.gif"])
def test_an_episode_is_filmed_from_the_reset_to_its_end(tmp_path, name):
    frames = record(single(), tmp_path / name, seed=3, options={"level": 1})
    film = film_in(tmp_path / name)
    assert frames == 13 and film.shape == (13, 128, 128, 3)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    env = single()
    env.reset(seed=3, options={"level": 1})
    assert np.abs(film[0].astype(int) - env.render().astype(int)).mean() < 8  # videos lose a little


def test_the_same_seed_gives_the_same_film_and_another_one_another(tmp_path):
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        record(single(), tmp_path / f"{name}.gif", seed=seed, options={"level": 0})
    a, b, c = ((tmp_path / f"{name}.gif").read_bytes() for name in "abc")
    assert a == b != c


def test_several_environments_are_filmed_side_by_side(tmp_path):
    env = segar.envs.VectorEnv(LEVELS, 4, render_mode="rgb_array", view=SMALL, seed=0)
    assert record(env, tmp_path / "film.gif", steps=5) == 6
    assert film_in(tmp_path / "film.gif").shape == (6, 256, 256, 3)


def test_frames_of_one_s_own_are_written_as_they_come(tmp_path):
    frames = (np.full((64, 64, 3), value, np.uint8) for value in (0, 100, 200))
    assert write_video(tmp_path / "grey.gif", frames, fps=5) == 3
    film = film_in(tmp_path / "grey.gif")
    assert [int(frame.mean()) for frame in film] == [0, 100, 200]


def test_what_fails_in_the_middle_leaves_what_was_there(tmp_path):
    (tmp_path / "film.mp4").write_bytes(b"an older film")

    def frames():
        yield np.zeros((64, 64, 3), np.uint8)
        raise RuntimeError("the policy failed")

    with pytest.raises(RuntimeError, match="the policy failed"):
        write_video(tmp_path / "film.mp4", frames())
    assert [path.name for path in tmp_path.iterdir()] == ["film.mp4"]
    assert (tmp_path / "film.mp4").read_bytes() == b"an older film"


def test_what_cannot_be_written_is_refused(tmp_path):
    with pytest.raises(segar.SegarError, match=r"a video is .mp4 or .gif, not 'film.mp3'. Did you mean '.mp4'\?"):
        write_video(tmp_path / "film.mp3", [])
    with pytest.raises(segar.SegarError, match="would have no frames"):
        write_video(tmp_path / "film.mp4", [])
    with pytest.raises(segar.SegarError, match=r"cannot be written to .*no_such_folder"):
        write_video(tmp_path / "no_such_folder" / "film.gif", [np.zeros((64, 64, 3), np.uint8)])
    with pytest.raises(segar.SegarError, match="render_mode='rgb_array'; this one's is None"):
        record(segar.envs.Env(LEVELS), tmp_path / "film.mp4")


def test_a_missing_package_is_named_with_its_extra(tmp_path, monkeypatch):
    find = sys.modules["importlib.util"].find_spec
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name in ("pygame", "imageio") else find(name))
    with pytest.raises(segar.SegarError, match=r"a window needs pygame.*pip install 'segar\[render\]'"):
        segar.envs.Env(LEVELS, render_mode="human")
    with pytest.raises(segar.SegarError, match=r"needs imageio, which is not installed: pip install 'segar\[render\]'"):
        write_video(tmp_path / "film.mp4", [])


def test_gymnasium_s_recordvideo_works(tmp_path):
    made = gymnasium.make("Segar-empty-hard-state-v0", render_mode="rgb_array", view=SMALL, max_steps=5, num_levels=2)
    env = gymnasium.wrappers.RecordVideo(made, str(tmp_path / "films"), episode_trigger=lambda episode: True)
    for _ in range(2):
        env.reset(seed=0)
        ended = False
        while not ended:
            *_, terminated, truncated, _ = env.step(env.action_space.sample())
            ended = terminated or truncated
    env.close()
    films = sorted((tmp_path / "films").glob("*.mp4"))
    assert [film.name for film in films] == ["rl-video-episode-0.mp4", "rl-video-episode-1.mp4"]
    assert film_in(films[0]).shape == (6, 128, 128, 3)


def test_gymnasium_s_recordvideo_works_on_batches(tmp_path):
    made = segar.envs.VectorEnv(LEVELS, 4, render_mode="rgb_array", view=SMALL, autoreset_mode="Disabled", seed=0)
    env = gymnasium.wrappers.vector.RecordVideo(
        made, str(tmp_path / "films"), step_trigger=lambda step: step == 0, video_length=3
    )
    env.reset(seed=0)
    for _ in range(4):
        env.step(env.action_space.sample())
    env.close()
    (film,) = (tmp_path / "films").glob("*.mp4")
    assert len(film_in(film, 256)) == 4
