"""Frames of environments: where things are, what can be told from them, and that they follow from the state alone."""

import numpy as np
import pytest

import segar
from segar import Ball, Charge, Charger, GoalTile, GolfBall, Magnet, Mass, Mobile, Position, SandTile, Velocity
from segar.language import Alive, Damper, Done, Heat, StoredEnergy, Visible
from segar.observations import Colour
from segar.rendering import View

LEVEL = [
    GolfBall({Position: (-0.5, 0.5)}),
    GoalTile({Position: (0.6, 0.6)}),
    Ball({Position: (0.0, -0.5)}),
    Charger({Position: (0.6, -0.4)}),
    Magnet({Position: (-0.6, -0.4)}),
    Damper({Position: (0.0, 0.1)}),
    SandTile({Position: (0.0, 0.7), segar.Shape: segar.language.Hexagon(0.4)}),
]


def shown(**options) -> segar.envs.VectorEnv:
    """One environment with one of each kind at its start; without a step, so that nothing is compiled."""
    env = segar.envs.VectorEnv(segar.Levels.from_entities([LEVEL]), 1, render_mode="rgb_array", seed=0, **options)
    env.reset()
    return env


def frame_of(env) -> np.ndarray:
    (frame,) = env.render()
    return frame


def pixel_at(frame: np.ndarray, x: float, y: float, size: int = 512, walls: float = 1.0) -> tuple[int, ...]:
    """The colour at a place; the arena fills all but a margin."""
    margin = 0.018 * size
    scale = (size - 2 * margin) / (2 * walls)
    return tuple(frame[round(margin + (walls - y) * scale), round(margin + (x + walls) * scale)].tolist())


def test_things_are_drawn_in_their_colours_where_they_are_with_y_upwards():
    frame = frame_of(shown())
    assert frame.shape == (544, 512, 3) and frame.dtype == np.uint8 and frame.flags["C_CONTIGUOUS"]
    assert pixel_at(frame, -0.5, 0.57) == (255, 255, 255)  # the golf ball, above its sign
    assert pixel_at(frame, 0.04, -0.44) == (255, 215, 0)  # the ball, beside its label
    assert pixel_at(frame, 0.6, 0.67)[2] == 255 > 100 > pixel_at(frame, 0.6, 0.67)[0]  # the goal, between its rings
    assert max(pixel_at(frame, 0.9, 0.1)) < 100  # the floor


CHANGES = [
    ("golfball", Charge, -1.0),
    ("golfball", Mass, 0.4),
    ("golfball", Velocity, (1.0, 0.5)),
    ("golfball", Alive, False),
    ("golfball", Done, True),
    ("golfball", Visible, False),
    ("charger", Charge, 0.5),
    ("magnet", segar.Magnetism, 0.5),
    ("damper", StoredEnergy, 0.5),
    ("ball", Mobile, False),
    ("ball", Position, (0.01, -0.5)),
    ("sand", segar.Friction, 0.9),
    ("sand", Heat, 0.5),
    ("goal", Heat, 0.5),
]


@pytest.mark.parametrize(("entity", "factor", "value"), CHANGES, ids=[f"{e}-{f.__name__}" for e, f, _ in CHANGES])
@pytest.mark.parametrize("labels", [True, False], ids=["with labels", "without"])
def test_a_change_of_a_factor_can_be_seen(entity, factor, value, labels):
    env = shown(view=View(labels=labels, line=False))
    before = frame_of(env)
    env.intervene(entity, factor, value)
    differing = int((frame_of(env) != before).any(axis=2).sum())
    if factor is Mass and not labels:
        assert differing == 0  # nothing but the label says the mass
    else:
        assert differing >= 20


def test_labels_fields_and_the_line_can_be_left_out():
    frames = {name: frame_of(shown(view=View(**{name: False}))) for name in ("labels", "fields", "line")}
    frames["all"] = frame_of(shown())
    assert frames["line"].shape == (512, 512, 3)
    assert (frames["line"] == frames["all"][:512]).all()
    for name in ("labels", "fields"):
        assert (frames[name] != frames["all"]).any() and frames[name].shape == frames["all"].shape


@pytest.mark.parametrize("size", [64, 128, 512, 1024])
def test_the_size_can_be_chosen(size):
    frame = frame_of(shown(view=View(size=size)))
    assert frame.shape == View(size=size).shape and frame.shape[0] % 2 == 0
    # What stands still has its colour in small pictures, too: its outline is one pixel, not a filled disc.
    damper = pixel_at(frame, 0.0, 0.14 if size > 64 else 0.1, size)
    assert np.abs(np.subtract(damper, (122, 62, 12))).max() <= 15


@pytest.mark.parametrize("size", [63, 65, 4096])
def test_other_sizes_are_refused(size):
    with pytest.raises(segar.SegarError, match="even number from 64 to 2048"):
        View(size=size)


def test_worlds_of_other_walls_are_shown_from_wall_to_wall():
    levels = segar.Levels.from_entities([[GolfBall({Position: (-1.5, 1.5)}), GoalTile()]], world=segar.World(walls=2.0))
    env = segar.envs.VectorEnv(levels, 1, render_mode="rgb_array", seed=0)
    env.reset()
    assert pixel_at(frame_of(env), -1.5, 1.57, walls=2.0) == (255, 255, 255)


def test_colours_can_be_chosen():
    view = View(colours={Ball: Colour((1, 2, 3))}, labels=False)
    assert pixel_at(frame_of(shown(view=view)), 0.0, -0.5) == (1, 2, 3)


def test_a_frame_follows_from_the_state_alone():
    levels = segar.family("empty-hard").sample(4, seed=0)
    env = segar.envs.VectorEnv(levels, 3, render_mode="rgb_array", seed=0)
    env.reset(options={"levels": np.array([0, 1, 2])})
    push = np.tile(np.float32([0.4, -0.3]), (3, 1))
    env.step(push)
    snapshot, frames = env.state(), env.render()
    assert len(frames) == 3 and all(frame.shape == (276, 256, 3) for frame in frames)
    assert not (frames[0] == frames[1]).all()
    env.step(push)
    assert not (env.render()[0] == frames[0]).all()
    env.restore(snapshot)
    assert all((a == b).all() for a, b in zip(env.render(), frames, strict=True))
    # Environment 2 alone looks as it does in the batch.
    other = segar.envs.VectorEnv(levels, 1, render_mode="rgb_array", view=View(size=256), seed=7)
    other.reset()
    other.restore(snapshot[[2]])
    assert (other.render()[0] == frames[2]).all()


def test_a_single_environment_says_how_an_episode_ended():
    env = segar.envs.Env(segar.family("empty-easy").sample(1, seed=0), render_mode="rgb_array", max_steps=1, seed=0)
    env.reset()
    env.step(np.zeros(2, np.float32))
    ended = env.render()
    env.reset()
    again = env.render()
    assert ended is not None and again is not None
    assert (ended[512:] != again[512:]).any() and (ended[:512] == again[:512]).all()


def test_what_cannot_be_drawn_is_refused_and_frames_come_in_time_with_the_simulation():
    levels = segar.family("empty-easy").sample(1, seed=0)
    without = segar.envs.Env(levels, sub_steps=10)
    without.reset()
    assert without.render() is None and without.metadata["render_fps"] == 10
    assert segar.envs.VectorEnv(levels, 1).metadata["render_fps"] == 20
    with pytest.raises(segar.SegarError, match=r"no render_mode 'rgb'. Did you mean 'rgb_array'\?"):
        segar.envs.VectorEnv(levels, 1, render_mode="rgb")
    for env in (
        segar.envs.VectorEnv(levels, 1, render_mode="rgb_array"),
        segar.envs.Env(levels, render_mode="rgb_array"),
    ):
        with pytest.raises(segar.SegarError, match=r"reset\(\) before render"):
            env.render()
