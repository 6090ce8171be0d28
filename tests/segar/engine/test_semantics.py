"""What rules mean, by small worlds whose outcome is known: for the interpreter and for the generated source."""

from typing import Tuple  # as the paper writes rules

import numpy as np
import pytest

import segar.language.random
from segar import Charge, Friction, Interpreter, Levels, Mass, Mobile, Position, Scalar, Size, Velocity, rule
from segar.language import ZERO, Aggregate, Differential, Framerate, Parameter, SetFactor, is_equal, is_on, relation
from segar.language.entities import Ball, Bumper, Entity, GoalTile, GolfBall, Hole, SandTile, Tile
from segar.language.factors import ID, Alive, Done, Heat, InfiniteEnergy, Label, Order, Shape, StoredEnergy, Visible
from segar.language.shapes import Circle, Square, Triangle
from segar.rules import DEFAULT_RULES, World, consume, move
from tests.segar.engine.worlds import after, read

pytestmark = pytest.mark.parametrize("engine", ["interpreter", "source"])


class Temperature(Scalar, default=20.0): ...


class Fever(Temperature, default=38.0): ...


class Tally(Scalar): ...


class Wind(Parameter, default=0.3): ...


class Kettle(Ball):
    temperature: Temperature
    tally: Tally
    label: Label = "kettle"


class Patient(Ball):
    fever: Fever
    label: Label = "patient"


def level(*entities: Entity, **parameters: float) -> Levels:
    """One level of these entities beside a golf ball and a goal, far away from each other."""
    ball, goal = GolfBall({Position: (-0.9, -0.9), Size: 0.05}), GoalTile({Position: (0.9, 0.9), Size: 0.05})
    names = {Wind.__name__: Wind, Framerate.__name__: Framerate}
    return Levels.from_entities([[ball, goal, *entities]], {names[k]: v for k, v in parameters.items()})


@rule
def warm(t: Temperature) -> Aggregate[Temperature]:
    return Aggregate[Temperature](t, 5.0)


@rule
def warm_more(t: Temperature) -> Aggregate[Temperature]:
    return Aggregate[Temperature](t, t / 10)


@rule
def heat_up(t: Temperature) -> Differential[Temperature]:
    return Differential[Temperature](t, 3.0)


@rule
def heat_up_by_wind(t: Temperature, wind: Wind) -> Differential[Temperature]:
    return Differential[Temperature](t, wind)


@rule
def thermostat(t: Temperature) -> SetFactor[Temperature]:
    return SetFactor[Temperature](t, 19.0)


@rule
def nothing(t: Temperature) -> Aggregate[Temperature]:
    return None


@pytest.mark.parametrize(
    ("rules", "expected"),
    [
        ([warm, warm_more], 5.0 + 2.0),  # aggregates add up and forget the previous value
        ([heat_up, heat_up_by_wind], 20.0 + (3.0 + 2.0) / 10),  # differentials are scaled by the time step
        ([heat_up, thermostat, warm], 19.0),
        ([heat_up, warm], 5.0),
        ([nothing], 20.0),
    ],
)
def test_set_beats_aggregate_beats_differential_and_all_others_add_up(engine, rules, expected):
    levels = level(Kettle({Temperature: 20.0}), Wind=2.0, Framerate=10.0)
    assert read(after(engine, rules, levels), levels, Temperature)[0, 2] == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize("turned", [False, True])
def test_a_conflict_that_a_more_specific_rule_settles_is_none(engine, turned):
    def above(t: Temperature, tally: Tally) -> SetFactor[Temperature]:
        return SetFactor[Temperature](t, tally) if t > 0 else None

    def below(t: Temperature, tally: Tally) -> SetFactor[Temperature]:
        return SetFactor[Temperature](t, -tally) if t > 0 else None

    rules = [rule(above), rule(below), rule(priority=9)(thermostat.function)]
    levels = level(Kettle({Tally: 3.0}))
    assert read(after(engine, rules[::-1] if turned else rules, levels), levels, Temperature)[0, 2] == 19.0


def test_equal_set_values_agree(engine):
    def to_mass(t: Temperature, m: Mass) -> SetFactor[Temperature]:
        return SetFactor[Temperature](t, m * 19.0) if m > 0 else None

    levels = level(Kettle({Mass: 1.0}))
    assert read(after(engine, [thermostat, rule(priority=0)(to_mass)], levels), levels, Temperature)[0, 2] == 19.0


def test_rules_of_a_factor_apply_to_its_sub_classes_and_not_the_reverse(engine):
    @rule
    def cool_fever(f: Fever) -> SetFactor[Fever]:
        return SetFactor[Fever](f, 36.0)

    levels = level(Kettle({Temperature: 20.0}), Patient({Fever: 40.0}))
    warmed = after(engine, [warm_more], levels)
    assert read(warmed, levels, Temperature)[0, 2] == 2.0 and read(warmed, levels, Fever)[0, 3] == 4.0
    cooled = after(engine, [cool_fever], levels)
    assert read(cooled, levels, Temperature)[0, 2] == 20.0 and read(cooled, levels, Fever)[0, 3] == 36.0


def test_a_rule_on_three_entities_applies_to_every_ordered_triple_of_distinct_ones(engine):
    @rule
    def count(kettle: Tuple[Tally], second: Tuple[Mass], third: Tuple[Mass]) -> Aggregate[Tally]:
        return Aggregate[Tally](kettle[0], 1.0)

    places = [(-0.5, 0.5), (0.0, 0.5), (0.5, 0.5)]
    levels = level(*(Kettle({Position: p, ID: f"kettle{n}"}) for n, p in enumerate(places)))
    tally = read(after(engine, [count], levels), levels, Tally)[0, 2:5]
    others = 3  # the two other kettles and the golf ball
    assert list(tally) == [others * (others - 1)] * 3


def test_rules_see_the_state_from_before_their_stage(engine):
    @rule
    def swap(a: Tuple[Temperature, Velocity], b: Tuple[Temperature, Velocity]) -> SetFactor[Temperature]:
        return SetFactor[Temperature](a[0], b[0])

    levels = level(Kettle({Temperature: 1.0}), Patient({Fever: 2.0, Position: (0.5, 0.0)}))
    state = after(engine, [swap], levels)
    assert read(state, levels, Temperature)[0, 2] == 2.0 and read(state, levels, Fever)[0, 3] == 1.0


def test_relations_combine_by_and_and_or(engine):
    def count(t: Tally) -> Aggregate[Tally]:
        return Aggregate[Tally](t, 1.0)

    heavy, charged = is_equal(Mass, 2.0), is_equal(Charge, 1.0)
    kinds = [(2.0, 1.0), (2.0, 0.0), (1.0, 1.0), (1.0, 0.0)]
    levels = level(*(Kettle({Mass: m, Charge: q, Position: (m - 1.5, q - 0.5), ID: f"{m} {q}"}) for m, q in kinds))
    both = read(after(engine, [rule(relation=heavy & charged)(count)], levels), levels, Tally)[0, 2:6]
    either = read(after(engine, [rule(relation=heavy | charged)(count)], levels), levels, Tally)[0, 2:6]
    assert list(both) == [1, 0, 0, 0] and list(either) == [1, 1, 1, 0]


def test_a_relation_does_not_hold_for_entities_that_lack_what_it_asks_for(engine):
    @relation
    def is_hot(kettle: Kettle) -> bool:
        return kettle[Temperature] > 50

    def lighten(body: Tuple[Mass]) -> SetFactor[Mass]:
        return SetFactor[Mass](body[0], 0.5)

    hot = Kettle({Temperature: 90.0, Position: (0.5, 0.5)})
    levels = level(hot, Ball({Charge: 1.0}), Patient({Position: (0.0, 0.5)}))
    alone = read(after(engine, [rule(relation=is_hot)(lighten)], levels), levels, Mass)[0, 2:5]
    either = read(after(engine, [rule(relation=is_hot | is_equal(Charge, 1.0))(lighten)], levels), levels, Mass)[0, 2:5]
    assert list(alone) == [0.5, 1.0, 1.0] and list(either) == [0.5, 0.5, 1.0]


def test_the_entity_class_of_a_relation_counts_beside_that_of_the_rule(engine):
    @relation
    def is_patient(body: Patient) -> bool:
        return body[Mobile] == True  # noqa: E712 - a factor, not a truth value

    def lighten(ball: Ball) -> SetFactor[Mass]:
        return SetFactor[Mass](ball[Mass], 0.5)

    levels = level(Ball(), Patient({Position: (0.5, 0.0)}))
    assert list(read(after(engine, [rule(relation=is_patient)(lighten)], levels), levels, Mass)[0, 2:4]) == [1.0, 0.5]


def test_text_factors_are_compared_by_the_entity_s_type(engine):
    def lighten(body: Entity) -> SetFactor[Mass]:
        if body[Label] == "kettle":
            return SetFactor[Mass](body[Mass], 0.5)
        return None

    levels = level(Kettle(), Ball({Position: (0.5, 0.0)}))
    assert list(read(after(engine, [rule(lighten)], levels), levels, Mass)[0, 2:4]) == [0.5, 1.0]


def test_only_the_topmost_floor_under_a_thing_counts(engine):
    @rule(relation=is_on)
    def weigh(body: Tuple[Mass], floor: Tuple[Friction, Heat]) -> Aggregate[Mass]:
        return Aggregate[Mass](body[0], 1 + floor[0])

    def tile(friction: float, order: int) -> Tile:
        name = f"tile{friction}"
        return SandTile({Friction: friction, Order: order, Shape: Square(0.5), Position: (0.0, 0.0), ID: name})

    on = level(tile(0.1, 3), tile(0.2, 1), tile(0.3, 2), Ball({Position: (0.1, 0.1)}))
    off = level(tile(0.1, 3), tile(0.2, 1), tile(0.3, 2), Ball({Position: (0.3, 0.1)}))
    assert read(after(engine, [weigh], on), on, Mass)[0, 5] == 1.2
    assert read(after(engine, [weigh], off), off, Mass)[0, 5] == 1.0, "the centre decides on a hull"


def test_a_disc_is_on_a_round_floor_that_it_touches(engine):
    @rule(relation=is_on)
    def weigh(body: Tuple[Mass], floor: Tuple[Heat]) -> Aggregate[Mass]:
        return Aggregate[Mass](body[0], 2.0)

    floor = Hole({Shape: Circle(0.4), Position: (0.0, 0.0)})
    for distance, mass in ((0.29, 2.0), (0.31, 1.0)):
        levels = level(floor, Ball({Position: (distance, 0.0), Size: 0.2}))
        assert read(after(engine, [weigh], levels), levels, Mass)[0, 3] == mass


@pytest.mark.parametrize("shape", [Circle(0.5), Square(0.5), Triangle(0.7)])
def test_a_hole_of_any_shape_swallows_what_it_contains(engine, shape):
    for size, swallowed in ((0.2, True), (0.6, False)):
        levels = level(Hole({Shape: shape, Position: (0.0, 0.0)}), Ball({Position: (0.0, 0.0), Size: size}))
        state = after(engine, [consume], levels)
        flags = [read(state, levels, f)[0, 3] for f in (Done, Visible, Mobile)]
        assert flags == ([1, 0, 0] if swallowed else [0, 1, 1])


def test_a_position_that_is_set_does_not_move_on_in_that_sub_step(engine):
    @rule
    def send_home(x: Position, v: Velocity) -> SetFactor[Position]:
        return SetFactor[Position](x, (0.25, 0.25)) if x.x > 0.5 else None

    levels = level(Ball({Position: (0.55, 0.0), Velocity: (1.0, 0.0)}))
    assert list(read(after(engine, [move, send_home], levels), levels, Position)[0, 2]) == [0.25, 0.25]
    assert list(read(after(engine, [move, send_home], levels, 2), levels, Position)[0, 2]) == [0.26, 0.25]


def test_rules_can_move_things_that_have_no_velocity(engine):
    @rule
    def drift(tile: Tuple[Position, Heat], wind: Wind) -> Differential[Position]:
        return Differential[Position](tile[0], (wind, 0.0))

    levels = level(SandTile({Position: (0.0, 0.0)}), Wind=0.5)
    assert list(read(after(engine, [drift], levels), levels, Position)[0, 2]) == [0.005, 0.0]


def test_a_rule_that_is_checked_again_acts_before_velocities_change(engine):
    """Heat takes the mass below the least one in the first stage; death stops the ball in the same sub-step."""

    def lighten(t: Temperature, m: Mass) -> SetFactor[Mass]:
        return SetFactor[Mass](m, 0.05)

    levels = level(Kettle({Velocity: (1.0, 0.0)}))
    state = after(engine, [rule(lighten), *DEFAULT_RULES], levels)
    assert [read(state, levels, f)[0, 2] for f in (Mass, Alive, Visible)] == [0, 0, 0]
    assert list(read(state, levels, Velocity)[0, 2]) == [0.0, 0.0]

    def count(tally: Tally) -> Differential[Tally]:
        return Differential[Tally](tally, 1.0)

    again = after(engine, [rule(recheck=True)(count)], levels)
    assert read(again, levels, Tally)[0, 2] == pytest.approx(0.02), "in the stage of factors, and before velocities"


def test_vector_arithmetic_means_the_same_on_numbers_and_in_source(engine):
    @rule
    def twist(v: Velocity, m: Mass) -> SetFactor[Velocity]:
        u = v.unit_vector().tangent_vector() * 2 - [0.5, 0.25] + v.abs() * v.sign() / (1, 2)
        return SetFactor[Velocity](v, u if (v[0] > 0) & (v.dot(v) <= 25) else ZERO)

    levels = level(Ball({Velocity: (3.0, 4.0)}))
    found = read(after(engine, [twist], levels), levels, Velocity)[0, 2]
    assert found == pytest.approx([-1.6 - 0.5 + 3.0, 1.2 - 0.25 + 2.0], abs=1e-14)


def test_random_numbers_differ_by_rule_entity_draw_tick_and_key_and_by_nothing_else(engine):
    @rule
    def roll(t: Tally, v: Velocity) -> Tuple[SetFactor[Tally], SetFactor[Velocity]]:
        return SetFactor[Tally](t, segar.random.uniform()), SetFactor[Velocity](v, (segar.random.uniform(), 0.0))

    places = [(-0.5, 0.5), (0.5, 0.5)]
    levels = level(*(Kettle({Position: p, ID: f"kettle{n}"}) for n, p in enumerate(places)))
    states = [after(engine, [roll], levels, n, key) for n, key in ((1, 7), (2, 7), (1, 8))]
    again = after(engine, [roll], levels, 1, 7)
    numbers = [read(s, levels, Tally)[0, 2:4] for s in states]
    numbers += [read(s, levels, Velocity)[0, 2:4, 0] for s in states]
    assert len(np.unique(numbers)) == 12
    assert np.array_equal(states[0].values, again.values, equal_nan=True)
    other = after(engine, [heat_up, roll], levels, 1, 7)
    assert not np.isin(read(other, levels, Tally)[0, 2:4], numbers).any()


def test_random_numbers_have_the_laws_that_they_are_named_after(engine):
    @rule
    def roll(t: Tally, x: Temperature, m: Mass) -> Tuple[SetFactor[Tally], SetFactor[Temperature], SetFactor[Mass]]:
        flip = segar.random.bernoulli(0.25)
        normal = segar.random.normal(3.0, 2.0)
        return (
            SetFactor[Tally](t, segar.random.uniform(-1, 3)),
            SetFactor[Temperature](x, normal),
            SetFactor[Mass](m, flip),
        )

    levels = level(Kettle())
    state = after(engine, [roll], levels, 1, key=np.arange(400, dtype=np.uint64))
    uniform, normal, flips = (read(state, levels, f)[:, 2] for f in (Tally, Temperature, Mass))
    assert uniform.min() >= -1 and uniform.max() < 3 and abs(uniform.mean() - 1) < 4 * (4 / 12**0.5) / 20
    assert abs(normal.mean() - 3) < 4 * 2 / 20 and abs(normal.std() - 2) < 4 * 2 / 800**0.5
    assert set(flips) == {0.0, 1.0} and abs(flips.mean() - 0.25) < 4 * (0.1875**0.5) / 20
    assert abs(np.corrcoef(uniform, normal)[0, 1]) < 4 / 20


def test_a_bumper_gives_its_energy_once_unless_it_is_without_end(engine):
    for endless, energy in ((False, 0.0), (True, 1.0)):
        bumper = Bumper({Position: (0.0, 0.0), StoredEnergy: 1.0, InfiniteEnergy: endless})
        levels = level(bumper, Ball({Position: (-0.205, 0.0), Velocity: (1.0, 0.0)}))
        state = after(engine, [move], levels)
        assert read(state, levels, StoredEnergy)[0, 2] == energy
        assert read(state, levels, Velocity)[0, 3] == pytest.approx([-2.0, 0.0], abs=1e-6)


def test_the_interpreter_explains_which_rules_said_what(engine):
    levels = level(Kettle())
    world = World([heat_up, thermostat, move])
    fired = Interpreter(world, levels.layout).step(levels, explain=True).firings
    said = {str(f) for f in fired}
    assert "factors: heat_up(kettle) -> Differential[Temperature](3.0)" in said
    assert "factors: thermostat(kettle) -> SetFactor[Temperature](19.0)" in said
    assert "position: move(golfball) -> Differential[Position](Vector(0.0, 0.0))" in said
