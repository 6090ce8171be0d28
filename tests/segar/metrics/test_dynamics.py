"""Distances between worlds: laws of a metric, what can be derived on paper, and the statistics of their errors."""

import math

import numpy as np
import pytest

import segar
from segar import Ball, Differential, GoalTile, GolfBall, Gravity, Levels, Mass, Position, Velocity
from segar.errors import LevelError, SegarError
from segar.hardness import Situations, make_situations
from segar.language import Acceleration, Alive, FloorFriction, MinVelocity
from segar.metrics import dynamics_distance, dynamics_w2, rule_set_distances
from segar.rules import RuleOption, RuleSpace, World, accelerate, kill_condition, move, stop_condition
from segar.rules.templates import drag, dynamics_space, uniform_field
from segar.rules.templates.dynamics import free_motion

DT, SUB_STEPS = 0.01, 5  # [s] of a sub-step, and sub-steps of a step
OWN_UNITS = {(GolfBall, Mass): 1.0}  # no factor that is asked for has a unit here, so each counts in its own


class Noisy(segar.Parameter, default=1.0, unit="m/s^2"): ...


@segar.rule
def jolt(ball: GolfBall, size: Noisy) -> segar.Aggregate[Acceleration]:
    """A random force in every sub-step."""
    return segar.Aggregate[Acceleration](ball[Acceleration], (size * segar.random.normal(), 0.0))


@segar.rule
def wither(ball: GolfBall) -> segar.SetFactor[Mass]:
    """The ball loses its mass, of which it dies."""
    return segar.SetFactor[Mass](ball[Mass], 0.0)


# Nothing moves bodies but these options; each is a world.
OPTIONS = [
    uniform_field("pull", Mass, x=0.1, y=0.0),
    uniform_field("double", Mass, x=0.2, y=0.0),
    uniform_field("mirrored", Mass, x=-0.1, y=0.0),
    drag("thick", coefficient=1.0),
    drag("thicker", coefficient=2.0),
    RuleOption("jolt", jolt, {Noisy: 1.0}),
    RuleOption("wither", wither),
]
SPACE = RuleSpace(OPTIONS, active=1, always=[free_motion, accelerate, move, kill_condition, stop_condition])
# What becomes of the first factor under a constant acceleration a, from rest: velocity, then position by the new velocity.
VELOCITY = {h: DT * SUB_STEPS * h for h in (1, 5, 20)}
PLACE = {h: DT**2 * (SUB_STEPS * h) * (SUB_STEPS * h + 1) / 2 for h in (1, 5, 20)}


def starting(velocities: np.ndarray, world: World | None = None, parameters: dict | None = None) -> Levels:
    """A golf ball in the middle with each of the velocities."""
    goal = GoalTile({Position: [0.9, 0.9]})
    entities = [[GolfBall({Position: [0.0, 0.0], Velocity: v.tolist()}), goal] for v in velocities]
    return Levels.from_entities(entities, {MinVelocity: 0.0} | (parameters or {}), world=world)


def worlds(*options: str, **constants: list[float]) -> Levels:
    """A level for each option of the space, in which it holds; "" for none. Constants by name have a number for each level."""
    activity = {o.active: [float(o.name == name) for name in options] for o in SPACE.options}
    values = {p: constants.get(p.__name__, float(law.mean)) for p, law in SPACE.laws.items()}
    return starting(np.zeros((len(options), 2)), World(SPACE), activity | values)


def situations(velocities: np.ndarray, **options) -> Situations:
    given = {"rng": np.random.default_rng(0), "scale": OWN_UNITS, "factors": [Position]} | options
    return make_situations(starting(velocities), **given)


def small(n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(0.0, 0.05, (n, 2))


def test_a_constant_force_doubled_adds_its_own_path_however_bodies_start():
    still, pull, double, mirrored = worlds("", "pull", "double", "mirrored")
    there = situations(small(8), plays=1)
    for world, times in ((pull, 1), (double, 2), (mirrored, 1)):
        found = dynamics_distance(still, world, there)
        for h, place in PLACE.items():
            assert found.by_horizon[h] == pytest.approx((times * 0.1 * place, 0.0), abs=1e-12)
    one, again, two = (dynamics_distance(pull, other, there).value for other in (still, double, mirrored))
    assert again == pytest.approx(one) and two == pytest.approx(2 * one)


def test_viscous_drag_takes_a_power_of_the_velocity():
    """v_n = v_0 (1 - c dt)^n, so the difference to free motion is |v_0| (1 - (1 - c dt)^n)."""
    still, thick, thicker = worlds("", "thick", "thicker")
    velocities = small(8)
    there = situations(velocities, plays=1, factors=[Velocity])
    size = math.sqrt((velocities**2).sum(axis=1).mean())
    for a, b, c, d in ((still, thick, 0.0, 1.0), (still, thicker, 0.0, 2.0), (thick, thicker, 1.0, 2.0)):
        found = dynamics_distance(a, b, there)
        for h, estimate in found.by_horizon.items():
            n = SUB_STEPS * h
            assert estimate.value == pytest.approx(size * abs((1 - c * DT) ** n - (1 - d * DT) ** n))


@pytest.mark.slow
def test_the_error_says_how_far_an_estimate_is_from_its_expectation():
    """With Gaussian velocities of known spread, the drag's expected distance is known; about 95 % of estimates are within two
    standard errors of it."""
    still, thick = worlds("", "thick")
    truth = 0.05 * math.sqrt(2) * (1 - (1 - DT) ** SUB_STEPS)
    found = [
        dynamics_distance(still, thick, situations(small(200, k), plays=1, horizons=[1], factors=[Velocity]))
        for k in range(25)
    ]
    apart = np.array([(one.value - truth) / one.error for one in found])
    assert np.mean(np.abs(apart) < 2) >= 0.84 and abs(apart.mean()) < 0.5


def test_twice_the_gravity_doubles_what_friction_takes():
    """Friction is mu g / m against the velocity, so after n sub-steps the speeds differ by mu g dt n / m until a body rests."""
    angles = np.linspace(0.0, math.tau, 8, endpoint=False)
    fast = 0.9 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    here, there = (starting(fast[:1], parameters={Gravity: g, FloorFriction: 0.05}) for g in (1.0, 2.0))
    found = dynamics_distance(here, there, situations(fast, plays=1, horizons=[1, 5]))
    for h, estimate in found.by_horizon.items():
        assert estimate == pytest.approx((0.05 * PLACE[h], 0.0), abs=1e-9)


def test_distances_of_rule_sets_keep_the_laws_of_a_metric():
    dist = segar.family("empty-hard").with_rules(dynamics_space())
    levels = dist.sample(12, seed=0)
    there = make_situations(dist.sample(4, seed=0, split="situations"), rng=np.random.default_rng(0))
    d = rule_set_distances(levels, levels, there)
    assert np.array_equal(d, d.T) and (np.diag(d) == 0).all() and np.median(d) > 0.1
    assert (d[:, None, :] <= d[:, :, None] + d[None] + 1e-12).all()
    assert rule_set_distances(levels[:5], levels[5:], there) == pytest.approx(d[:5, 5:], rel=1e-12)
    for i, j in ((0, 1), (2, 3), (4, 4)):
        one, back = (dynamics_distance(*pair, there) for pair in ((levels[i], levels[j]), (levels[j], levels[i])))
        assert one == back and one.value == pytest.approx(d[i, j], rel=1e-12) and one.floor == 0


def test_the_parts_of_a_distance_add_up():
    dist = segar.family("empty-hard").with_rules(dynamics_space())
    levels = dist.sample(2, seed=1)
    there = make_situations(dist.sample(6, seed=0, split="situations"), rng=np.random.default_rng(0), horizons=[1, 3])
    found = dynamics_distance(levels[0], levels[1], there)
    square = found.value**2
    assert sum(e.value**2 for e in found.by_factor.values()) == pytest.approx(square)
    assert np.mean([e.value**2 for e in found.by_horizon.values()]) == pytest.approx(square)
    assert sum(e.value**2 for e in found.parts.values()) / 2 == pytest.approx(square)
    assert str(found).splitlines()[0].split() == ["after", "steps", "1", "3", "all"]


def test_outcomes_do_not_depend_on_the_batch_or_on_threads():
    dist = segar.family("empty-hard").with_rules(dynamics_space())
    levels, states = dist.sample(9, seed=0), dist.sample(4, seed=0, split="situations")
    one, two = (make_situations(states, rng=np.random.default_rng(0), num_threads=k) for k in (1, 2))
    together, alone = two.outcomes(levels), one.outcomes(levels[4])
    assert np.array_equal(together.values[together.of_level[4]], alone.values[0])


def test_rules_that_draw_are_compared_under_equal_draws_and_the_floor_is_what_chance_does():
    """After n sub-steps the velocity is a sum of n normal numbers; two random paths differ by sqrt(2) of the spread of one."""
    calm, wild, wilder = worlds("", "jolt", "jolt", Noisy=[1.0, 1.0, 2.0])
    there = situations(np.zeros((200, 2)), plays=1, horizons=[4], factors=[Velocity])
    assert dynamics_distance(wild, wild, there).value == 0
    spread = DT * math.sqrt(4 * SUB_STEPS)
    one, two = dynamics_distance(calm, wild, there), dynamics_distance(wild, wilder, there)
    assert abs(one.value - spread) < 2 * one.error and two.value == pytest.approx(one.value)
    assert one.floor == pytest.approx(math.sqrt(2) * spread / math.sqrt(2), rel=0.1)  # one of the two worlds draws
    assert two.floor == pytest.approx(math.sqrt(2) * spread * math.sqrt((1 + 4) / 2), rel=0.1)


class Turn(segar.Scalar, unit="rad", period=math.tau): ...


class Speed(segar.Parameter, default=0.0, unit="rad/s"): ...


class Dial(Ball):
    turn: Turn = 0.0


@segar.rule
def rotate(turn: Turn, speed: Speed) -> Differential[Turn]:
    return Differential[Turn](turn, speed)


def test_a_factor_with_a_period_takes_the_shorter_way():
    world = World([rotate])
    entities = [[GolfBall({Position: [-0.5, 0.0]}), GoalTile({Position: [0.5, 0.5]}), Dial({Position: [0.5, 0.0]})]]
    speeds = [0.0, 3.0, 4.0, math.tau]
    levels = Levels.from_entities(entities * 4, {Speed: speeds}, world=world)
    there = make_situations(
        levels, rng=np.random.default_rng(0), horizons=[20], factors=[Turn], scale={(Dial, Turn): 2}
    )
    d = rule_set_distances(levels, levels, there)
    assert d[0] == pytest.approx([0.0, 3.0 / 2, (math.tau - 4.0) / 2, 0.0], abs=1e-9)
    pairs = [[dynamics_distance(a, b, there).value for b in levels] for a in levels]
    assert d == pytest.approx(np.array(pairs), abs=1e-12)


def test_a_factor_counts_in_units_of_its_spread_and_else_in_its_own():
    still, pull = worlds("", "pull")
    states = starting(small(8))
    own, scaled = (
        dynamics_distance(still, pull, make_situations(states, rng=np.random.default_rng(0), plays=1, scale=scale))
        for scale in ({}, None)
    )
    unit = segar.metrics.spread(states)[GolfBall, Velocity]
    velocity, place = "GolfBall.Velocity", "GolfBall.Position"
    assert own.by_factor[velocity].value == pytest.approx(unit * scaled.by_factor[velocity].value)
    assert own.by_factor[place].value == pytest.approx(scaled.by_factor[place].value)  # all start in the middle


def test_the_end_of_an_episode_does_not_end_a_roll_out():
    ball, goal = GolfBall({Position: [0.0, 0.0]}), GoalTile({Position: [0.0, 0.0]})
    states = Levels.from_entities([[ball, goal]] * 2, {MinVelocity: 0.0})
    there = make_situations(states, rng=np.random.default_rng(0), plays=1, factors=[Position], scale=OWN_UNITS)
    found = dynamics_distance(*worlds("", "pull"), there)
    assert found.by_horizon[20].value == pytest.approx(0.1 * PLACE[20])


def test_a_body_that_has_died_stays_and_its_death_counts():
    alive, dead = worlds("", "wither")
    there = situations(np.array([[0.1, 0.0], [0.0, 0.1]]), plays=1, factors=[Position, Alive], horizons=[1, 5])
    found = dynamics_distance(alive, dead, there)
    assert found.parts["GolfBall.Alive", 5] == (1.0, 0.0)
    assert found.parts["GolfBall.Position", 5].value == pytest.approx(0.1 * VELOCITY[5], abs=2 * 0.1 * DT)


def test_the_transport_of_constant_forces_is_that_of_their_strengths():
    """The distance of two constant forces is proportional to the difference of their strengths, so W2 is that of numbers."""
    rng = np.random.default_rng(0)
    x, y = np.sort(rng.choice([0.0, 0.02, 0.04], 30)), np.sort(rng.choice([0.06, 0.1], 30))
    a, b = (worlds(*["pull"] * 30, pull_x=rng.permutation(strengths).tolist()) for strengths in (x, y))
    there = situations(small(12), plays=1, horizons=[20])
    found = dynamics_w2(a, b, there, rng=np.random.default_rng(0))
    assert found.value == pytest.approx(PLACE[20] * math.sqrt(((x - y) ** 2).mean()))
    assert found.low <= found.value <= found.high and found.floor < found.value and found.p_value < 0.05
    assert found.error < 1e-9 and found.rule_sets == (3, 2)
    same = dynamics_w2(a, a[::-1], there, rng=np.random.default_rng(0))
    assert same.value == 0 and same.p_value == 1 and same.floor > 0


def test_what_cannot_be_compared_is_refused():
    still = worlds("")
    there = situations(small(4))
    with pytest.raises(LevelError, match=r"have 2 rule sets; take one level, as levels\[0\], or compare all"):
        dynamics_distance(worlds("", "pull"), still, there)
    with pytest.raises(LevelError, match=r"needs situations; a Levels is none. Make them of levels"):
        dynamics_distance(still, still, starting(small(2)))  # type: ignore[arg-type]
    other = segar.family("objectsx1-hard").sample(2)
    with pytest.raises(LevelError, match="the levels have the entities golfball, goal, object1"):
        rule_set_distances(other, still, there)
    with pytest.raises(LevelError, match="make_situations needs at least 2 states"):
        situations(small(1))
    with pytest.raises(SegarError, match=r"horizons that are increasing whole numbers from 1 up, not 2 and \[5, 1\]"):
        situations(small(2), horizons=[5, 1])
    for wrong in (
        {"horizons": 5},
        {"horizons": [1.5]},
        {"horizons": []},
        {"plays": 0},
        {"plays": 1.5},
        {"plays": True},
    ):
        with pytest.raises(SegarError, match="at least one play, and horizons that are increasing whole numbers"):
            situations(small(2), **wrong)
    for wrong in ("puttputt", segar.puttputt):
        with pytest.raises(SegarError, match=r"task must be a task such as segar.puttputt\(\), not"):
            situations(small(2), task=wrong)
    with pytest.raises(SegarError, match="the seed must be a whole number, not 'a'"):
        situations(small(2), seed="a")
    for wrong in (1, 2.5):
        with pytest.raises(LevelError, match=f"dynamics_w2 needs at least 2 resamples, not {wrong}"):
            dynamics_w2(still, still, there, rng=np.random.default_rng(0), resamples=wrong)
