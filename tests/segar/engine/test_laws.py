"""Laws of mechanics and symmetries of the world, on compiled kernels."""

import dataclasses

import numpy as np
import pytest

from segar import DEFAULT_RULES, Acceleration, Levels, Magnetism, Position, Velocity, World, apply_friction, lorentz_law
from segar.engine.simulator import State
from segar.language import Charge, Drag, FloorFriction, InfiniteEnergy, Mass, MaxVelocity, StoredEnergy
from segar.language import Friction as Mu
from segar.language.factors import Size
from tests.agreement import rules_of_2022
from tests.segar.engine.worlds import random_states, read, set_factor, start, uncompiled

BALLS = [0, 2, 3, 4]  # slots of the table's balls


def with_parameters(levels: Levels, count: int = 1, **values: object) -> Levels:
    """``count`` copies of the first level with other world parameters: numbers or arrays of that length."""
    many = levels[np.zeros(count, int)]
    parameters, state = many.parameters.copy(), many.values.copy()
    for column, parameter in enumerate(levels.layout.parameters):
        if parameter.__name__ in values:
            parameters[:, column] = values[parameter.__name__]
    state[:, -1, levels.layout.columns[Mu]] = parameters[:, levels.layout.parameters.index(FloorFriction)]
    return dataclasses.replace(many, parameters=parameters, values=state)


def momentum(state: State, levels: Levels) -> np.ndarray:
    return (read(state, levels, Mass)[:, BALLS, None] * read(state, levels, Velocity)[:, BALLS]).sum(axis=1)


def energy(state: State, levels: Levels) -> np.ndarray:
    v2 = (read(state, levels, Velocity)[:, BALLS] ** 2).sum(axis=-1)
    return (0.5 * read(state, levels, Mass)[:, BALLS] * v2).sum(axis=1)


def test_collisions_keep_momentum_and_energy_and_part_bodies(table):
    """Four balls of random masses that run into each other near the middle, 400 times; no friction, no charges."""
    simulator, levels = table
    levels = with_parameters(levels, 400, FloorFriction=0.0)
    rng, state = np.random.default_rng(0), start(levels)
    spots = np.array([(-0.12, -0.12), (0.12, -0.12), (-0.12, 0.12), (0.12, 0.12)])
    read(state, levels, Position)[:, BALLS] = spots + rng.uniform(-0.01, 0.01, (400, 4, 2))
    inward = -spots * rng.uniform(5, 20, (400, 4, 1))
    read(state, levels, Velocity)[:, BALLS] = inward + rng.normal(0, 0.3, (400, 4, 2))
    set_factor(state, levels, Charge, 0.0)
    set_factor(state, levels, Mass, rng.uniform(0.2, 5, (400, 5 + 1)))
    before = momentum(state, levels), energy(state, levels)
    for _ in range(5):
        simulator.step(state, levels)
        x, r = read(state, levels, Position)[:, BALLS], read(state, levels, Size)[:, BALLS] / 2
        apart = np.linalg.norm(x[:, :, None] - x[:, None], axis=-1) - (r[:, :, None] + r[:, None])
        apart[:, range(4), range(4)] = np.inf
        assert apart.min() > 0
    assert (state.contacts > 1).mean() > 0.8 and not state.unresolved_contacts.any()
    np.testing.assert_allclose(momentum(state, levels), before[0], atol=1e-11)
    np.testing.assert_allclose(energy(state, levels), before[1], rtol=1e-12)


def test_friction_stops_a_ball_at_half_mass_speed_squared_over_mu_g_and_for_good(table):
    """The paper's force is mu g, not mu m g: the distance is m v^2 / (2 mu g)."""
    simulator, levels = table
    rng, n = np.random.default_rng(1), 30
    mu, g = rng.uniform(0.02, 0.5, n), rng.uniform(2, 20, n)
    levels = with_parameters(levels, n, FloorFriction=mu, Gravity=g)
    mass, way = rng.uniform(0.3, 4, n), rng.uniform(0.05, 0.7, n)
    speed = np.minimum(np.sqrt(2 * way * mu * g / mass), 9.0)
    way = mass * speed**2 / (2 * mu * g)
    state = start(levels)
    x, v = read(state, levels, Position), read(state, levels, Velocity)
    set_factor(state, levels, Charge, 0.0)
    read(state, levels, Mass)[:, 0] = mass
    x[:, 2:5] = [(0.9, -0.9), (0.7, -0.9), (0.5, -0.9)]  # out of the way
    x[:, 0], angle = 0.0, rng.uniform(0.75 * np.pi, np.pi, n)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    v[:, 0] = speed[:, None] * direction
    simulator.step(state, levels, int(100 * (mass * speed / (mu * g)).max()) + 2)
    assert not v[:, 0].any(), "at rest means velocity zero"
    travelled = np.linalg.norm(x[:, 0], axis=1)
    assert np.all(np.abs(travelled - way) <= speed / 100), "to the order of the time step"
    rest = x[:, 0].copy()
    simulator.step(state, levels, 50)
    assert np.array_equal(x[:, 0], rest)


def test_nothing_is_faster_than_the_largest_speed(table):
    simulator, levels = table
    levels = with_parameters(levels, 100, MaxVelocity=np.linspace(0.1, 20, 100))
    limit = levels.parameters[:, levels.layout.parameters.index(MaxVelocity)]
    state = random_states(levels, 300, np.random.default_rng(2), speed=30.0)
    set_factor(state, levels, StoredEnergy, 0.0)
    set_factor(state, levels, Mass, 1.0)
    before = read(state, levels, Velocity)[:, BALLS].copy()
    simulator.step(state, levels)
    untouched = state.contacts == 0
    assert untouched.sum() > 50
    after = read(state, levels, Velocity)[untouched][:, BALLS]
    speed = np.linalg.norm(after, axis=-1)
    assert np.all(speed <= limit[state.level[untouched], None] * (1 + 1e-12))
    assert np.any(np.linalg.norm(before, axis=-1) > 20)


def test_a_corner_turns_both_components(table):
    simulator, levels = table
    levels = with_parameters(levels, FloorFriction=0.0, WallDamping=0.0)
    state = start(levels)
    set_factor(state, levels, Charge, 0.0)
    x, v = read(state, levels, Position), read(state, levels, Velocity)
    x[0, 0], v[0, 0] = (-0.895, -0.895), (-1.0, -1.0)
    simulator.step(state, levels)
    assert list(v[0, 0]) == [1.0, 1.0] and list(read(state, levels, Velocity)[0, 2]) == [0.0, 0.0]


VECTORS = (Position, Velocity, Acceleration, Drag)


def moved(state: State, levels: Levels, matrix: np.ndarray, flips_magnets: bool) -> State:
    """The state seen in a turned or mirrored frame. Magnetism is a pseudo-scalar: a mirror changes its sign."""
    image = state.copy()
    for factor in VECTORS:
        read(image, levels, factor)[:] = read(state, levels, factor) @ matrix.T
    if flips_magnets:
        read(image, levels, Magnetism)[:] *= -1
    return image


@pytest.mark.parametrize("family", ["objectsx3-hard", "tilesx3-hard"])
@pytest.mark.parametrize(
    "matrix",
    [[[0, -1], [1, 0]], [[-1, 0], [0, -1]], [[-1, 0], [0, 1]], [[0, 1], [1, 0]]],
    ids=["turned by 90 degrees", "turned by 180 degrees", "mirrored", "mirrored on the diagonal"],
)
def test_the_world_is_the_same_turned_and_mirrored(sampled, family, matrix):
    simulator, levels = sampled(family)
    frame = np.array(matrix, float)
    mirrors = bool(np.linalg.det(frame) < 0)
    vertices = levels.vertices @ frame.T
    if mirrors:  # counter-clockwise stays counter-clockwise
        for index in np.ndindex(*levels.vertex_count.shape):
            n = levels.vertex_count[index]
            vertices[index][:n] = vertices[index][:n][::-1]
    image_levels = dataclasses.replace(levels, vertices=vertices)
    state = random_states(levels, 300, np.random.default_rng(3))
    image = moved(state, levels, frame, mirrors)
    simulator.step(state, levels)
    simulator.step(image, image_levels)
    expected = moved(state, levels, frame, mirrors)
    assert np.array_equal(image.contacts, expected.contacts)
    few = expected.contacts <= 4
    for factor, found in ((f, read(image, levels, f)[few]) for f in (*VECTORS, Mass, StoredEnergy)):
        np.testing.assert_allclose(found, read(expected, levels, factor)[few], rtol=1e-11, atol=1e-11)


def test_the_order_of_objects_does_not_matter(sampled):
    simulator, levels = sampled("objectsx3-hard")
    order = [0, 1, 4, 2, 3, 5]
    turned = dataclasses.replace(
        levels, types=levels.types[:, order], values=levels.values[:, order], shape_kind=levels.shape_kind[:, order]
    )
    state = random_states(levels, 300, np.random.default_rng(4))
    # Only the body that hits first spends its energy; with equal flags it does not matter which one that is.
    set_factor(state, levels, InfiniteEnergy, 1.0)
    other = state.copy()
    other.values[:] = state.values[:, order]
    simulator.step(state, levels)
    simulator.step(other, turned)
    few = state.contacts <= 4
    np.testing.assert_allclose(other.values[few], state.values[few][:, order], rtol=1e-11, atol=1e-11)
    assert state.contacts.sum() > 10


@pytest.mark.parametrize("family", ["objectsx3-hard", "tilesx3-hard"])
def test_the_friction_and_lorentz_law_of_2022_are_ours_where_ours_are_not_mended(sampled, family):
    simulator, levels = sampled(family)
    printed = {apply_friction: rules_of_2022.apply_friction, lorentz_law: rules_of_2022.lorentz_law}
    theirs = uncompiled(World([printed.get(r, r) for r in DEFAULT_RULES]), levels.layout)
    state = random_states(levels, 40, np.random.default_rng(5), speed=2.0)
    listed = state.copy()
    simulator.step(state, levels)
    theirs.step(listed, levels)
    np.testing.assert_allclose(listed.values, state.values, rtol=1e-10, atol=1e-10)


def test_smaller_time_steps_converge_to_the_stopping_distance(table):
    simulator, levels = table
    rates = np.array([50.0, 100.0, 200.0, 400.0])
    levels = with_parameters(levels, 4, Framerate=rates)
    state = start(levels)
    set_factor(state, levels, Charge, 0.0)
    x, v = read(state, levels, Position), read(state, levels, Velocity)
    v[:, 0] = (-0.55, -0.55)
    read(state, levels, Position)[:, 2:5] += (0.0, 0.3)
    for e, rate in enumerate(rates):
        one = State(**{name: array[e : e + 1] for name, array in vars(state).items()})
        simulator.step(one, levels, int(2 * rate))
    errors = np.abs(np.linalg.norm(x[:, 0], axis=1) - 0.605 / (2 * 0.05 * 10))
    assert np.all(errors[1:] < 0.6 * errors[:-1])
