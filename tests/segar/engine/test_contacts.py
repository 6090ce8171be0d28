"""Contacts: nothing overlaps, nothing leaves the arena, and what cannot be resolved ends within a bounded time."""

import numpy as np
import pytest

import segar
from segar import Ball, Levels, Mass, RuleError, Shape, Size, World, move
from segar.engine.simulator import State
from segar.language import ID, Alive, Charge, Done, GoalTile, GolfBall, Mobile, Position, Square, StoredEnergy, Velocity
from tests.segar.engine.worlds import after, random_states, read, set_factor, start

OVERLAP = 1e-6  # [m] what two bodies or a body and a wall may share at the end of a sub-step


def depths(state: State, levels: Levels) -> tuple[np.ndarray, np.ndarray]:
    """How deep the two closest solid bodies, and the body nearest to a wall, reach into what stops them [m]."""
    x, r = read(state, levels, Position), read(state, levels, Size) / 2
    body = ~np.isnan(read(state, levels, Mass))
    solid = body & (read(state, levels, Alive) != 0) & (read(state, levels, Done) == 0)
    gaps = np.linalg.norm(x[:, :, None] - x[:, None], axis=-1) - (r[:, :, None] + r[:, None])
    pairs = solid[:, :, None] & solid[:, None] & ~np.eye(x.shape[1], dtype=bool)
    into_walls = np.abs(x).max(axis=-1) + r - 1
    return np.where(pairs, -gaps, -np.inf).max(axis=(1, 2)), np.where(body, into_walls, -np.inf).max(axis=1)


@pytest.mark.parametrize("name", ["objectsx3-hard", pytest.param("tilesx3-hard", marks=pytest.mark.slow)])
def test_bodies_neither_overlap_nor_leave_the_arena_in_random_play(sampled, name):
    simulator, levels = sampled(name)
    state, rng = start(levels, 6), np.random.default_rng(0)
    nan = np.isnan(state.values)
    for step in range(500):
        if step % 5 == 0:
            mass = read(state, levels, Mass)[:, :1]
            push = rng.uniform(-2, 2, (len(mass), 2)) / np.maximum(mass, 0.1)
            read(state, levels, Velocity)[:, 0] += push * (mass > 0)
        before = state.unresolved_contacts.copy()
        simulator.step(state, levels)
        resolved = state.unresolved_contacts == before
        overlap, outside = depths(state, levels)
        assert overlap[resolved].max() < OVERLAP and outside.max() < OVERLAP
    assert state.contacts.sum() > 500 * (name == "objectsx3-hard") and np.array_equal(np.isnan(state.values), nan)


@pytest.mark.parametrize("crowding", [1.0, 0.3, 0.05])
@pytest.mark.parametrize("speed", [0.0, 1.0, 1000.0])
def test_hostile_states_stay_finite_and_in_the_arena_with_bounded_work(sampled, crowding, speed):
    """Overlapping, pinned, immobile, bumping and very fast bodies, some of them beyond the walls."""
    simulator, levels = sampled("objectsx3-hard")
    state = random_states(levels, 300, np.random.default_rng(1), speed)
    read(state, levels, Position)[:] *= crowding
    nan = np.isnan(state.values)
    for _ in range(20):
        before = state.contacts.copy()
        simulator.step(state, levels)
        assert (state.contacts - before).max() <= 64
        assert depths(state, levels)[1].max() < OVERLAP
        assert np.array_equal(np.isnan(state.values), nan)


def test_a_ball_between_two_walls_of_balls_gives_up_its_time_and_not_its_sanity(table):
    """A fast ball that fits exactly between immobile balls bounces more often than a sub-step resolves."""
    simulator, levels = table
    state = start(levels)
    set_factor(state, levels, Charge, 0.0)
    x, v = read(state, levels, Position), read(state, levels, Velocity)
    x[0, [2, 3]] = (-0.2005, 0.0), (0.2005, 0.0)
    read(state, levels, Mobile)[0, [2, 3]] = 0.0
    v[0, 0] = (9.0, 0.0)
    simulator.step(state, levels)
    assert state.contacts[0] == 64 and state.unresolved_contacts[0] == 1
    assert depths(state, levels)[0][0] < OVERLAP and np.isfinite(v[0, 0]).all()


def test_dead_and_done_bodies_collide_with_walls_alone(table):
    simulator, levels = table
    for flag, value in ((Alive, 0.0), (Done, 1.0)):
        state = start(levels)
        set_factor(state, levels, Charge, 0.0)
        x, v = read(state, levels, Position), read(state, levels, Velocity)
        read(state, levels, flag)[0, 2] = value
        x[0, 0], v[0, 0], x[0, 2] = (0.3, 0.0), (4.0, 0.0), (0.45, 0.0)
        simulator.step(state, levels, 3)
        assert state.contacts[0] == 0 and depths(state, levels)[0][0] < 0
        v[0, 2] = (0.0, 0.0)
        x[0, 2] = (0.95, 0.0)
        simulator.step(state, levels)
        assert depths(state, levels)[1][0] < OVERLAP


def test_a_damper_that_takes_all_speed_leaves_the_ball_at_rest_in_contact(table):
    """In 2022 the next push from such a rest raised 'rollback is out of bounds'."""
    simulator, levels = table
    state = start(levels)
    set_factor(state, levels, Charge, 0.0)
    x, v = read(state, levels, Position), read(state, levels, Velocity)
    read(state, levels, StoredEnergy)[0, 2] = -1.0
    read(state, levels, Mobile)[0, 2] = 0.0
    for angle in np.linspace(-1.5, 1.5, 31):
        v[0, 0] = 1e-3 * np.array([np.cos(angle), np.sin(angle)])
        x[0, 0] = (0.3, 0.0)
        simulator.step(state, levels)
        v[0, 0] = 2.0 * np.array([np.cos(angle), np.sin(angle)])
        simulator.step(state, levels)
        assert depths(state, levels)[0][0] < OVERLAP and np.isfinite(v[0, 0]).all()


@pytest.mark.parametrize("engine", ["interpreter", "source"])
def test_a_world_may_have_no_contact_rules(engine):
    near = GolfBall({Position: (-0.15, 0.0), Velocity: (5.0, 0.0)})
    far = Ball({Position: (0.88, 0.0), Velocity: (5.0, 1.0), ID: "far"})
    levels = Levels.from_entities([[near, GoalTile({Position: (-0.8, -0.8)}), Ball({Position: (0.06, 0.0)}), far]])
    through = after(engine, [move], levels, pair_contact=None)
    assert read(through, levels, Position)[0, 0] == pytest.approx([-0.1, 0.0])
    stopped = after(engine, [move], levels, wall_contact=None)
    assert list(read(stopped, levels, Velocity)[0, 3]) == [0.0, 1.0]
    assert read(stopped, levels, Position)[0, 3] == pytest.approx([0.9, 0.01], abs=3e-7)


@pytest.mark.parametrize("engine", ["interpreter", "source"])
def test_a_body_with_a_hull_collides_as_its_circumscribed_disc(engine):
    square = Ball({Position: (0.0, 0.0), Shape: Square(0.2), Mobile: False, ID: "square"})
    ball = GolfBall({Position: (-0.25, 0.0), Velocity: (1.0, 0.0), Size: 0.2})
    levels = Levels.from_entities([[ball, GoalTile({Position: (0.8, 0.8)}), square]])
    state = after(engine, [move], levels)
    assert state.contacts[0] == 1 and np.abs(read(state, levels, Velocity)[0, 2]).max() < 1e-7
    reach = 0.1 + 0.1 * 2**0.5
    assert read(state, levels, Velocity)[0, 0] == pytest.approx([-1.0, 0.0], abs=1e-7)
    assert read(state, levels, Position)[0, 0, 0] == pytest.approx(-2 * reach + 0.24, abs=5e-7)


TOUCH = 1e-7  # [m] of docs/reference/rules.md, "Where contacts happen"


@pytest.mark.parametrize("engine", ["interpreter", "source"])
@pytest.mark.parametrize(("damping", "walls"), [(0.0, 1.0), (0.025, 1.0), (0.5, 2.5), (1.0, 1.0)])
def test_a_bounce_ends_where_the_reference_says_and_not_in_the_wall_by_a_ten_millionth_of_a_metre(
    engine, damping, walls
):
    velocities = np.array([(5.0, 0.0), (4.0, 3.0), (1.0, -2.0), (0.3, 0.4), (-4.0, 3.0)])
    wall = walls - 0.1  # [m] what the centre of the ball can reach
    begin = np.column_stack([np.sign(velocities[:, 0]) * (wall - 0.001), np.full(len(velocities), 0.2)])
    balls = (GolfBall({Position: x, Velocity: v, Size: 0.2}) for x, v in zip(begin, velocities, strict=True))
    goal = GoalTile({Position: (0.0, -0.8)})
    levels = Levels.from_entities([[ball, goal] for ball in balls], parameters={segar.language.WallDamping: damping})
    state = after(engine, [move], levels, walls=walls)
    x, v = read(state, levels, Position)[:, 0], read(state, levels, Velocity)[:, 0]
    assert (state.contacts == 1).all()

    way = velocities * 0.01
    end, side = begin + way, np.sign(velocities[:, 0])
    too_far, share = np.abs(end[:, 0]) - wall, np.abs(velocities.T) / np.linalg.norm(velocities, axis=1)
    exact_x = side * (wall - (1 - damping) * too_far)
    exact_y = end[:, 1] - damping * velocities[:, 1] * too_far / np.abs(velocities[:, 0])
    np.testing.assert_allclose(v, (1 - damping) * velocities * (-1, 1), rtol=1e-15)
    np.testing.assert_allclose(x[:, 0], exact_x - side * (2 - damping) * TOUCH * share[0], rtol=0, atol=1e-14)
    along = np.sign(velocities[:, 1]) * damping * TOUCH * share[1]
    np.testing.assert_allclose(x[:, 1], exact_y - along, rtol=0, atol=1e-14)


@pytest.mark.parametrize("engine", ["interpreter", "source"])
def test_balls_that_meet_head_on_stop_two_ten_millionths_of_a_metre_apart(engine):
    goal = GoalTile({Position: (0.0, -0.8)})
    left = GolfBall({Position: (-0.101, 0.0), Velocity: (1.0, 0.0), Size: 0.2})
    right = Ball({Position: (0.101, 0.0), Velocity: (-1.0, 0.0), Size: 0.2, ID: "right"})
    levels = Levels.from_entities([[left, goal, right]])
    state = after(engine, [move], levels)
    x = read(state, levels, Position)[0, :, 0]
    # They are 2 mm apart and come 20 mm nearer: 18 mm of the way are left, which lead apart; each 1e-7 m counts twice.
    assert x[2] - x[0] - 0.2 == pytest.approx(0.018 + 2 * 2 * TOUCH, abs=1e-14)


@pytest.mark.parametrize("walls", [0.0, -1.0, np.inf, np.nan])
def test_walls_stand_at_a_distance(walls):
    with pytest.raises(RuleError, match="the distance of the walls must be a finite number above 0"):
        World(walls=walls)


def test_pixels_show_the_arena_from_wall_to_wall():
    levels = Levels.from_entities([[GolfBall({Position: [1.5, 0.0]}), GoalTile({Position: [-1.5, 0.0]})]])
    frame, _ = segar.envs.VectorEnv(levels, 1, observation="rgb", world=World(walls=2.0)).reset()
    assert frame[0, 32, 56].tolist() == [255, 255, 255] and frame[0, 32, 8].tolist() == [0, 0, 255]
