"""Nothing passes another thing unseen in levels that are accepted, and the numbers that a refusal names are enough."""

import re

import numpy as np
import pytest

import segar
from segar.engine.simulator import Simulator, StepResult
from segar.envs.vector import VectorEnv
from segar.errors import LevelError
from segar.language import ConvexHull, Framerate, Hexagon, MaxVelocity, Mobile, Square, Triangle
from segar.levels import Levels, check_crossings
from segar.levels.crossings import _ways_through
from segar.reference.interpreter import Interpreter
from tests.segar.engine.worlds import read, start

PHASES = 21  # places at which a sub-step may end before the encounter


def level(sizes, speed, rate=100.0, tile=None, mobile=True):
    """Two balls of these sizes, and a goal or another tile, in a world of this largest speed."""
    balls = [
        segar.GolfBall({segar.Size: sizes[0], segar.Position: (0.0, 0.0), segar.Charge: 0.0}),
        segar.Ball({segar.Size: sizes[1], segar.Position: (0.0, 0.9), Mobile: mobile}),
    ]
    tile = tile or segar.GoalTile({segar.Size: 0.3, segar.Position: (0.0, -0.9)})
    return Levels.from_entities([[*balls, tile]], {MaxVelocity: speed, Framerate: rate})


def push(v: segar.Velocity, action: segar.Action) -> segar.Differential[segar.Velocity]:
    return segar.Differential[segar.Velocity](v, (action[0], action[1]))


def reached(ball: segar.GolfBall, goal: segar.GoalTile) -> bool:
    return segar.is_on(ball, goal)


@pytest.fixture(scope="module")
def simulator():
    """Compiled once for all levels; its task ends where the ball is on the goal."""
    task = segar.Task("touch", act=push, terminated=reached)
    return Simulator(segar.World((segar.move,)), level((0.2, 0.2), 10.0).layout, task)


def rate_of(levels):
    return levels.parameters[0, levels.layout.parameters.index(Framerate)]


def way_of(levels):
    return levels.parameters[0, levels.layout.parameters.index(MaxVelocity)] / rate_of(levels)


def meetings(simulator, levels, moving):
    """Contacts when a ball flies at the other one from all phases, and whether it was beyond it unseen."""
    way, reach = way_of(levels), read(start(levels), levels, segar.Size)[0, :2].sum() / 2
    state = start(levels, PHASES)
    gaps = 1e-6 + np.arange(PHASES) / PHASES * way * (1 + moving)
    x, v = read(state, levels, segar.Position), read(state, levels, segar.Velocity)
    x[:, 0], x[:, 1] = (0.0, 0.0), np.stack([reach + gaps, np.zeros(PHASES)], axis=1)
    v[:, 0] = (way * rate_of(levels), 0.0)
    v[:, 1] = (-way * rate_of(levels) * moving, 0.0)
    simulator.step(state, levels, 3)
    return state.contacts, x[:, 0, 0] > x[:, 1, 0]


def test_no_head_on_pair_passes_unseen_in_levels_that_are_accepted(simulator):
    rng, accepted, refused = np.random.default_rng(0), 0, 0
    for _ in range(120):
        sizes, speed = rng.uniform(0.02, 0.3, 2), 10.0 ** rng.uniform(0.0, 2.0)
        rate, mobile = 10.0 ** rng.uniform(1.5, 3.0), bool(rng.integers(2))
        levels = level(sizes, speed, rate, mobile=mobile)
        try:
            simulator.arrays_of(levels)
        except LevelError:
            refused += 1
            continue
        accepted += 1
        contacts, beyond = meetings(simulator, levels, float(mobile))
        assert (contacts > 0).all(), (sizes, speed, rate)
        assert not beyond.any(), (sizes, speed, rate)
    assert accepted > 20 and refused > 20


@pytest.mark.parametrize(("sizes", "speed", "needed"), [((0.04, 0.04), 10.0, 13), ((0.2, 0.2), 50.0, 13)])
def test_a_refusal_names_the_pair_and_sub_steps_that_are_enough(simulator, sizes, speed, needed):
    levels = level(sizes, speed)
    with pytest.raises(LevelError, match="level 0: 'golfball' and 'ball' can pass each other unseen") as refusal:
        simulator.arrays_of(levels)
    rate = float(re.search(r"Framerate of ([\d.]+) with a task of sub_steps=(\d+)", str(refusal.value))[1])
    assert f"sub_steps={needed}," in str(refusal.value)
    assert rate == pytest.approx(100.0 * needed / 5)
    slower = float(re.search(r"MaxVelocity of at most ([\d.e-]+),", str(refusal.value))[1])
    for enough in (level(sizes, speed, rate), level(sizes, slower)):
        contacts, beyond = meetings(simulator, enough, 1.0)
        assert (contacts > 0).all()
        assert not beyond.any()
    with pytest.raises(LevelError, match="can pass each other unseen"):
        VectorEnv(levels, num_envs=2)


def test_a_goal_and_walls_are_never_passed_unseen(simulator):
    rng, accepted = np.random.default_rng(1), 0
    for _ in range(60):
        size, goal = rng.uniform(0.02, 0.3, 2)
        levels = level(
            (size, 0.3), 10.0 ** rng.uniform(0.5, 1.7), tile=segar.GoalTile({segar.Shape: segar.Circle(goal)})
        )
        try:
            simulator.arrays_of(levels)
        except LevelError:
            continue
        accepted += 1
        way = way_of(levels)
        state, result = start(levels, PHASES), StepResult.empty(PHASES)
        x, v = read(state, levels, segar.Position), read(state, levels, segar.Velocity)
        x[:, 0, 0] = -(size + goal) / 2 - 1e-6 - np.arange(PHASES) / PHASES * way
        x[:, 0, 1], v[:, 0] = 0.0, (way * rate_of(levels), 0.0)
        x[:, 1] = (0.8, 0.8)
        told = Interpreter(simulator.world, levels.layout, simulator.task).step(levels, 0, state.values[0], (0.0, 0.0))
        seen = np.zeros(PHASES, bool)
        for step in range(10):
            simulator.act(state, levels, np.zeros((PHASES, 2), np.float32), result)
            assert step or result.terminated[0] == told.terminated
            seen |= result.terminated
        assert seen.all(), (size, goal, way)
        assert (np.abs(x[:, 0]) <= 1.0 - size / 2 + 1e-6).all()
    assert accepted > 20


def test_narrow_hulls_need_slow_things_and_worlds_without_contacts_or_bounded_speed_are_not_asked():
    bar = segar.Tile({segar.Shape: ConvexHull([(-0.5, -0.02), (0.5, -0.02), (0.5, 0.02), (-0.5, 0.02)])})
    narrow = level((0.2, 0.2), 10.0, tile=bar)
    with pytest.raises(LevelError, match=r"'golfball' and 'tile' .* may come 0.04 m"):
        check_crossings(narrow, segar.World(), 5)
    check_crossings(level((0.2, 0.2), 4.0, tile=bar), segar.World(), 5)
    check_crossings(narrow, segar.World(limit=None), 5)
    check_crossings(level((0.02, 0.02), 10.0), segar.World(pair_contact=None), 5)
    pegs = level((0.2, 0.02), 20.0, mobile=False)
    check_crossings(pegs, segar.World(), 5)


def test_the_speed_that_is_advised_is_near_the_highest_that_is_accepted_however_small_things_are():
    for size in (1e-6, 1e-3, 0.04):
        with pytest.raises(LevelError) as refusal:
            check_crossings(level((size, size), 10.0), segar.World(), 5)
        speed = float(re.search(r"MaxVelocity of at most ([\d.e-]+),", str(refusal.value))[1])
        check_crossings(level((size, size), speed), segar.World(), 5)
        with pytest.raises(LevelError, match="can pass each other unseen"):
            check_crossings(level((size, size), 1.02 * speed), segar.World(), 5)


@pytest.mark.parametrize(("shape", "middle"), [(Triangle(0.2), 0.0), (ConvexHull([(0, 0), (0.3, 0), (0, 0.3)]), 0.1)])
def test_a_tile_that_is_a_hull_is_never_crossed_unseen_through_its_middle(simulator, shape, middle):
    tile = segar.GoalTile({segar.Shape: shape})
    with pytest.raises(LevelError) as refusal:
        simulator.arrays_of(level((0.02, 0.5), 40.0, tile=tile, mobile=False))
    speed = float(re.search(r"MaxVelocity of at most ([\d.e-]+),", str(refusal.value))[1])
    levels, turns = level((0.02, 0.5), speed, tile=tile, mobile=False), np.linspace(0, 2 * np.pi, 60)
    for direction in np.stack([np.cos(turns), np.sin(turns)], axis=1):
        state, result, seen = start(levels, PHASES), StepResult.empty(PHASES), np.zeros(PHASES, bool)
        x, v = read(state, levels, segar.Position), read(state, levels, segar.Velocity)
        behind = 0.25 + np.arange(PHASES) / PHASES * way_of(levels)
        x[:, 2], x[:, 1], x[:, 0] = 0.0, (0.7, 0.7), middle - behind[:, None] * direction
        v[:, 0] = speed * direction
        simulator.act(state, levels, np.zeros((PHASES, 2), np.float32), result)
        seen |= result.terminated
        simulator.act(state, levels, np.zeros((PHASES, 2), np.float32), result)
        assert (seen | result.terminated).all(), (direction, speed)


def test_the_way_through_a_hull_is_the_shortest_chord_of_its_middle():
    ways = {
        Square(1.0): 1.0,
        Triangle(1.0): 0.5,
        Hexagon(1.0): 0.75**0.5,
        ConvexHull([(3, 3), (4, 3), (4, 4), (3, 4)]): 1.0,
    }
    for shape, way in ways.items():
        padded = np.concatenate([shape.vertices, np.zeros((2, 2))])[None]
        np.testing.assert_allclose(_ways_through(padded, np.array([len(shape.vertices)])), way, rtol=2e-3)
