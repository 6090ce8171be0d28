"""The law of each template: what it conserves, how it scales, or the exact sum that its integrator makes."""

import numpy as np
import pytest

from segar import Ball, Charge, Charger, GoalTile, GolfBall, Magnetism, Mobile, Position, RuleError, SandTile, Velocity
from segar.engine import State
from segar.language import Framerate, Mass, Visible
from segar.levels import Levels, rules_in_words
from segar.noise import Choice, Deterministic, UniformNoise
from segar.rules import RuleOption, RuleSpace, World, accelerate, move, templates
from segar.rules.templates.dynamics import free_motion
from tests.segar.engine.worlds import read, start, uncompiled

DT = 0.01
FRICTIONLESS = (free_motion, move, accelerate)


def run(
    option: RuleOption, entities: list, n: int = 1, framerate: float = 100.0
) -> tuple[Levels, State, list[np.ndarray]]:
    """The level of these entities, and of a goal, after ``n`` sub-steps with the option alone, and the values after each."""
    assert all(isinstance(law, Deterministic) for law in option.constants.values()), "a test states the constants"
    values = {parameter: float(law.mean) for parameter, law in option.constants.items()}
    world = World(RuleSpace([option], 1, always=FRICTIONLESS))
    if not any(isinstance(entity, GoalTile) for entity in entities):
        entities = [*entities, GoalTile({Position: [0.8, 0.8]})]
    levels = Levels.from_entities([entities], {Framerate: framerate, option.active: 1.0, **values}, world=world)
    simulator, state, seen = uncompiled(world, levels.layout), start(levels), []
    for _ in range(n):
        simulator.step(state, levels, 1)
        seen.append(state.values[0].copy())
    return levels, state, seen


def ball(x=0.0, y=0.0, vx=0.0, vy=0.0, kind=GolfBall, **factors) -> GolfBall:
    named = {"charge": Charge, "mass": Mass, "magnetism": Magnetism, "mobile": Mobile}
    return kind({Position: [x, y], Velocity: [vx, vy], **{named[name]: value for name, value in factors.items()}})


def of_body(levels: Levels, state: State, factor: type, entity: int = 0) -> np.ndarray:
    return read(state, levels, factor)[0, entity]


@pytest.mark.parametrize("as_constant", [False, True])
@pytest.mark.parametrize("exponent", [-1, 0, 1, 1.5, 2, 3])
def test_a_central_force_falls_with_its_exponent(exponent, as_constant):
    pushes = []
    for distance in (0.3, 0.6):
        option = templates.central_force(
            "force", exponent=Deterministic(exponent) if as_constant else exponent, strength=0.7
        )
        bodies = [ball(0, 0, charge=1.0, mass=2.0), ball(distance, 0, charge=1.5, mass=4.0, kind=Ball)]
        levels, state, _ = run(option, bodies)
        near, far = read(state, levels, Velocity)[0, :2]
        assert 2.0 * near + 4.0 * far == pytest.approx([0, 0], abs=1e-15)  # momentum stays
        assert near[0] < 0 < far[0] and far[1] == 0  # like charges repel, along the line
        pushes.append(far[0])
    assert pushes[0] / DT == pytest.approx(0.7 * 1.5 / 0.3**exponent / 4.0)
    assert pushes[0] / pushes[1] == pytest.approx(2.0**exponent)


@pytest.mark.parametrize(("source", "target"), [(Magnetism, Charge), (Mass, Mass), (Charge, Magnetism)])
def test_a_central_force_takes_any_pair_of_factors(source, target):
    option = templates.central_force("force", source, target, exponent=1, strength=-0.5)
    factors = {Charge: 0.3, Mass: 2.0, Magnetism: -0.7}
    both = {"charge": 0.3, "mass": 2.0, "magnetism": -0.7}
    bodies = [ball(0, 0, **both), ball(0, 0.5, kind=Ball, **both)]
    levels, state, _ = run(option, bodies)
    assert of_body(levels, state, Velocity, 1)[1] / DT == pytest.approx(
        -0.5 * factors[source] * factors[target] / 0.5 / 2.0
    )


def test_springs_between_bodies_keep_momentum_and_rest_at_their_length():
    option = templates.pair_spring("spring", stiffness=3.0, length=0.4)
    levels, state, _ = run(option, [ball(0, 0, mass=1.0), ball(0, 0.4, mass=3.0, kind=Ball)])
    assert np.abs(read(state, levels, Velocity)[0, :2]).max() < 1e-15
    levels, state, _ = run(option, [ball(0, 0, mass=1.0), ball(0.3, 0.5, mass=3.0, kind=Ball)], 40)
    assert of_body(levels, state, Velocity, 0) + 3.0 * of_body(levels, state, Velocity, 1) == pytest.approx(
        [0, 0], abs=1e-13
    )
    assert np.abs(of_body(levels, state, Velocity, 0)).max() > 0.01


def test_an_anchor_spring_oscillates_as_its_integrator_does():
    k, m, x, v, n = 2.0, 0.5, 0.3, 0.1, 150
    option = templates.anchor_spring("anchor", stiffness=k, x=-0.1, y=0.0)
    levels, state, _ = run(option, [ball(x, 0, v, 0, mass=m)], n)
    for _ in range(n):
        v += k * (-0.1 - x) / m * DT
        x += v * DT
    assert of_body(levels, state, Position) == pytest.approx([x, 0], abs=1e-12)
    assert of_body(levels, state, Velocity) == pytest.approx([v, 0], abs=1e-12)


def test_viscous_drag_takes_a_constant_share_of_the_speed():
    levels, state, _ = run(templates.drag("drag", 1, coefficient=0.8), [ball(-0.5, 0, 0.6, 0.3, mass=2.0)], 60)
    assert of_body(levels, state, Velocity) == pytest.approx(
        np.array([0.6, 0.3]) * (1 - 0.8 / 2.0 * DT) ** 60, rel=1e-12
    )


@pytest.mark.parametrize("power", [2, 2.5, 3])
def test_other_drags_follow_their_power(power):
    for speed in (1.0, 2.0):
        begin = np.array([0.6, 0.8]) * speed
        levels, state, _ = run(templates.drag("drag", power, coefficient=0.8), [ball(0, 0, *begin)])
        share = 0.8 * DT * speed ** (power - 1)
        assert of_body(levels, state, Velocity) == pytest.approx(begin * (1 - share), rel=1e-12)


@pytest.mark.parametrize(("factor", "size"), [(Charge, 0.4), (Mass, 2.0)])
def test_a_uniform_field_accelerates_evenly(factor, size):
    option = templates.uniform_field("field", factor, x=0.5, y=-0.25)
    levels, state, _ = run(option, [ball(0, 0, charge=0.4, mass=2.0)], 50)
    acceleration = np.array([0.5, -0.25]) * size / 2.0
    assert of_body(levels, state, Velocity) == pytest.approx(acceleration * 50 * DT)
    assert of_body(levels, state, Position) == pytest.approx(acceleration * DT**2 * 50 * 51 / 2)


def test_a_rotating_field_pushes_around_the_middle():
    levels, state, _ = run(templates.rotating_field("vortex", Mass, strength=0.5), [ball(0.3, 0.4, mass=3.0)])
    gained = of_body(levels, state, Velocity) / DT
    assert gained @ [0.3, 0.4] == pytest.approx(0, abs=1e-15)
    assert gained == pytest.approx([-0.4 * 0.5, 0.3 * 0.5])


def test_a_magnetic_field_turns_the_velocity_and_does_no_work():
    strength, n = 2.0, 80
    levels, state, _ = run(
        templates.magnetic_field("field", Charge, strength), [ball(0, 0, 0.3, 0, charge=0.5, mass=2.0)], n
    )
    omega = strength * 0.5 / 2.0
    turned = 0.3 * (1 + 1j * omega * DT) ** n  # the integrator's step in the plane of complex numbers
    assert of_body(levels, state, Velocity) == pytest.approx([turned.real, turned.imag], rel=1e-12)
    assert np.linalg.norm(of_body(levels, state, Velocity)) == pytest.approx(0.3, rel=omega**2 * DT * n * DT)


def test_a_portal_lets_nobody_stay_inside_and_keeps_velocities():
    option = templates.portal("portal", x=0.2, y=0.0, to_x=-0.6, to_y=0.6, radius=0.1)
    levels, state, seen = run(option, [ball(-0.3, 0, 1.0, 0.0), GoalTile({Position: [0.2, 0.0]})], 60)
    column = levels.layout.columns[Position]
    path = np.array([values[0, column : column + 2] for values in seen])
    jumps = np.flatnonzero(np.abs(np.diff(path[:, 0])) > 0.1)
    assert len(jumps) == 1 and path[jumps[0] + 1] == pytest.approx([-0.6, 0.6])
    assert np.hypot(path[jumps[0], 0] - 0.2, path[jumps[0], 1]) < 0.1
    assert (np.abs(np.diff(path[:, 0])[np.arange(59) != jumps[0]]) <= 0.0101).all()
    assert of_body(levels, state, Velocity) == pytest.approx([1.0, 0.0])
    assert of_body(levels, state, Position, 1) == pytest.approx([0.2, 0.0])  # tiles are not sent


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("forward", [1.0, -1.0])
@pytest.mark.parametrize("speed", [0.3, 3.0, 9.9])
def test_a_one_way_wall_is_passed_in_one_direction_only(axis, forward, speed):
    option = templates.one_way_wall("wall", axis, at=0.1, forward=forward)

    def after(side: float) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities on the axis of a body that comes from one side, until it would reach a wall."""
        x, v = [0.0, 0.0], [0.0, 0.0]
        x[axis], v[axis] = 0.1 + 0.4 * side, -speed * side
        levels, _, seen = run(option, [ball(*x, *v)], int(0.7 / speed / DT))
        columns = [levels.layout.columns[factor] + axis for factor in (Position, Velocity)]
        return tuple(np.array([values[0, column] for values in seen]) for column in columns)  # type: ignore[return-value]

    places, speeds = after(forward)  # against the direction of the wall
    assert ((places - 0.1) * forward > 0).all() and speeds[-1] * forward > 0
    assert np.abs(speeds) == pytest.approx(np.full(len(speeds), speed))
    places, speeds = after(-forward)
    assert (places[-1] - 0.1) * forward > 0 and speeds == pytest.approx(np.full(len(speeds), speed * forward))


def test_a_switch_sets_the_factor_of_bodies_on_its_tile_alone():
    tile = SandTile({Position: [0.5, 0.0]})
    option = templates.switch("switch", SandTile, Charge, value=-2.0)
    for x, expected in ((0.5, -2.0), (-0.5, 0.7)):
        levels, state, _ = run(option, [ball(x, 0, charge=0.7), tile])
        assert read(state, levels, Charge)[0, 0] == expected


def test_what_drifts_stays_in_the_arena_on_its_line():
    option, strayed = templates.drifting("drift", GoalTile, speed=0.4), []
    for framerate in (100, 400):
        things = [ball(-0.9, -0.9), GoalTile({Position: [0.7, 0.6]})]
        levels, state, seen = run(option, things, 10 * framerate, framerate)
        column = levels.layout.columns[Position]
        path = np.array([values[1, column : column + 2] for values in seen])
        line = (1 - path[:, 0] ** 2) * (1 - path[:, 1] ** 2)
        strayed.append(np.abs(line - line[0]).max())
        assert np.abs(path).max() < 1 and np.ptp(path[:, 0]) > 1.2 and np.ptp(path[:, 1]) > 1.2  # it went round
        assert of_body(levels, state, Position) == pytest.approx([-0.9, -0.9])
    assert strayed[0] < 0.05 and strayed[0] / strayed[1] == pytest.approx(4, rel=0.2)  # an error of the first order


@pytest.mark.parametrize("rate", [-0.7, 0.4])
def test_growth_is_geometric(rate):
    levels, state, _ = run(templates.growth("growth", Charge, rate), [ball(charge=0.8)], 50)
    assert read(state, levels, Charge)[0, 0] == pytest.approx(0.8 * (1 + rate * DT) ** 50, rel=1e-12)


def meet(option: RuleOption, one: dict, other: dict) -> tuple[Levels, State]:
    """Two bodies that run into each other."""
    levels, state, _ = run(option, [ball(-0.15, 0, 1.0, 0, **one), ball(0.15, 0, -1.0, 0, kind=Charger, **other)], 12)
    assert state.contacts[0] > 0
    return levels, state


@pytest.mark.parametrize(("one", "other"), [(0.5, -2.0), (3.0, 1.0), (0.0, 0.4)])
def test_contagion_gives_both_the_greater_and_sharing_keeps_the_sum(one, other):
    levels, state = meet(templates.contagion("contagion", Charge), {"charge": one}, {"charge": other, "mobile": True})
    assert read(state, levels, Charge)[0, :2].tolist() == [max(one, other, key=abs)] * 2
    levels, state = meet(templates.sharing("sharing", Charge), {"charge": one}, {"charge": other, "mobile": True})
    assert read(state, levels, Charge)[0, :2].tolist() == [(one + other) / 2] * 2


def test_a_touch_sets_what_is_immobile_free_and_what_hides_is_never_seen():
    levels, state = meet(templates.unlocking("lock"), {}, {"mobile": False})
    assert read(state, levels, Mobile)[0, :2].tolist() == [1.0, 1.0]
    levels, state, _ = run(templates.hiding("hidden"), [ball(0, 0), GoalTile({Position: [0.5, 0.5]})])
    assert read(state, levels, Visible)[0, :2].tolist() == [1.0, 0.0]


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: templates.drag("drag", 0), "power must be 1 or more"),
        (lambda: templates.drag("drag", "2"), "the power must be a finite number, not '2'"),
        (lambda: templates.central_force("force", exponent=np.nan), "the exponent must be a finite number, not nan"),
        (lambda: templates.drag(None), "needs a name such as"),
        (lambda: templates.one_way_wall("wall", forward=0), "forward must be 1 or -1, or a Choice of both, not 0"),
        (lambda: templates.one_way_wall("wall", forward=UniformNoise(-1, 1)), "forward must be 1 or -1"),
        (lambda: templates.switch("switch", SandTile, Position, 1.0), "takes factors that are numbers"),
        (lambda: templates.switch("switch", SandTile, Mass, -1.0), "sets Mass to numbers from -1 to -1; it must be"),
        (
            lambda: templates.switch("switch", SandTile, Mobile, Choice([0.0, 0.5])),
            "sets Mobile to numbers from 0 to 0.5",
        ),
        (lambda: templates.sharing("sharing", Mobile), "takes factors that are real numbers"),
        (lambda: templates.drifting("drift", Ball), "is no type of tiles"),
        (lambda: templates.hiding("hidden", "GoalTile"), "'GoalTile' is no type of tiles"),
        (lambda: templates.one_way_wall("wall", 2), "axis must be 0 or 1"),
        (lambda: templates.switch("switch", Ball, Charge, 1.0), "is no type of tiles"),
        (lambda: templates.growth("growth", Velocity), "takes factors that are real numbers"),
        (lambda: templates.uniform_field("field", Position), "takes factors that are numbers"),
    ],
)
def test_bad_input_is_told(make, said):
    with pytest.raises(RuleError, match=said):
        make()


def test_words_hold_the_constants_of_the_level():
    levels, _, _ = run(templates.uniform_field("field", Mass, x=0.5, y=-0.25), [ball()])
    assert rules_in_words(levels, 0) == ("a uniform force (0.5, -0.25) N x Mass",)
