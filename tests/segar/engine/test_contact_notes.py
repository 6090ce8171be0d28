"""Rules of ``on_contact``: they see bodies as they meet, in both orders, and what they set outlasts the exchange."""

from typing import Tuple  # as the paper writes rules

import numpy as np
import pytest

from segar import Aggregate, ConflictError, GoalTile, GolfBall, Interpreter, Levels, RuleError, SetFactor, World, move
from segar.engine.simulator import Simulator
from segar.language import ZERO, Ball, Bumper, Mobile, Object, Position, Velocity, Wall, WallDamping, is_equal, rule
from segar.language.factors import ID, Count, Label, Mass, Scalar, Size, StoredEnergy, Vector
from tests.segar.engine.worlds import after, compare, random_states, read, start, uncompiled

both_engines = pytest.mark.parametrize("engine", ["interpreter", "source"])


class Hits(Count): ...


class Bounces(Count): ...


class Impact(Scalar): ...


class HardestImpact(Impact): ...


class Normal(Vector): ...


class Drum(Ball):
    hits: Hits
    bounces: Bounces
    impact: Impact
    normal: Normal
    label: Label = "drum"


class HeavyDrum(Drum):
    mass: Mass = 3.0


class Club(GolfBall):
    hits: Hits
    bounces: Bounces
    normal: Normal


class Gong(Ball):
    hits: Hits
    hardest: HardestImpact
    label: Label = "gong"


@rule
def count(drum: Tuple[Hits], other: Object) -> SetFactor[Hits]:
    return SetFactor[Hits](drum[0], drum[0] + 1)


@rule
def count_walls(n: Bounces, normal: Normal, wall: Wall) -> Tuple[SetFactor[Bounces], SetFactor[Normal]]:
    return SetFactor[Bounces](n, n + 1), SetFactor[Normal](normal, wall.normal)


@rule
def feel(drum: Tuple[Impact, Velocity, Position], other: Tuple[Velocity, Position]) -> SetFactor[Impact]:
    impact, v, x = drum
    w, y = other
    return SetFactor[Impact](impact, (v - w).dot((y - x).unit_vector()))


@rule
def ring_a_gong(gong: Gong, other: Object) -> SetFactor[Hits]:
    """No level but that of a gong has a body for it."""
    return SetFactor[Hits](gong[Hits], 7.0)


def level(*bodies: Ball, **parameters: float) -> Levels:
    goal = GoalTile({Position: (0.8, 0.8), Size: 0.1})
    return Levels.from_entities([[GolfBall({Position: (-0.9, -0.9), Size: 0.1}), goal, *bodies]])


def head_on(left: type = Drum, right: type = Ball, speed: float = 2.0) -> Levels:
    """Two bodies about to meet at the relative speed of twice ``speed``, in slots 2 and 3."""
    moves = [{Position: (-0.105, 0.0), Velocity: (speed, 0.0)}, {Position: (0.105, 0.0), Velocity: (-speed, 0.0)}]
    return level(*(kind({**at, ID: f"body{n}"}) for n, (kind, at) in enumerate(zip((left, right), moves, strict=True))))


@both_engines
@pytest.mark.parametrize("kinds", [(Drum, Ball), (Ball, Drum), (Drum, Drum)])
def test_a_rule_on_two_bodies_applies_to_each_that_matches_whichever_of_them_stands_first(engine, kinds):
    levels = head_on(*kinds)
    hits = read(after(engine, [move], levels, 5, on_contact=[count, ring_a_gong]), levels, Hits)[0]
    np.testing.assert_array_equal(hits[2:4], [1.0 if kind is Drum else np.nan for kind in kinds])


@both_engines
@pytest.mark.parametrize(("kind", "impact"), [(Drum, Impact), (Gong, HardestImpact)])
def test_notes_see_the_bodies_as_they_meet_and_outlast_the_exchange(engine, kind, impact):
    @rule
    def stick(drum: kind, other: Object) -> SetFactor[Velocity]:
        return SetFactor[Velocity](drum[Velocity], ZERO)

    levels = head_on(kind)
    state = after(engine, [move], levels, 3, on_contact=[feel, stick])
    assert read(state, levels, impact)[0, 2] == pytest.approx(4.0), "rules of a factor note contacts of its sub-classes"
    assert list(read(state, levels, Velocity)[0, 2]) == [0.0, 0.0]
    assert list(read(state, levels, Velocity)[0, 3]) == pytest.approx([2.0, 0.0]), "the exchange came all the same"


@both_engines
def test_a_note_sees_nothing_of_what_another_note_sets(engine):
    @rule
    def swap(a: Tuple[Mass, Mobile], b: Tuple[Mass, Mobile]) -> SetFactor[Mass]:
        return SetFactor[Mass](a[0], b[0])

    @rule
    def weigh(drum: Tuple[Hits, Mass], other: Tuple[Mass]) -> SetFactor[Hits]:
        return SetFactor[Hits](drum[0], 10 * drum[1] + other[0])

    levels = head_on(HeavyDrum)
    state = after(engine, [move], levels, 3, on_contact=[swap, weigh])
    assert list(read(state, levels, Mass)[0, 2:4]) == [1.0, 3.0]
    assert read(state, levels, Hits)[0, 2] == 31.0


@both_engines
def test_a_rule_on_one_body_and_the_wall_notes_walls_alone(engine):
    drum = Drum({Position: (0.85, 0.0), Velocity: (5.0, 0.0), ID: "drum"})
    other = Ball({Position: (-0.85, 0.5), Velocity: (0.0, 0.0), ID: "other"})
    levels = level(drum, other)
    state = after(engine, [move], levels, 5, on_contact=[count_walls, count])
    assert [read(state, levels, f)[0, 2] for f in (Bounces, Hits)] == [1.0, 0.0]
    assert list(read(state, levels, Normal)[0, 2]) == [1.0, 0.0]
    stopped = after(engine, [move], levels, 5, on_contact=[count_walls], wall_contact=None)
    assert read(stopped, levels, Bounces)[0, 2] == 1.0


def ten_for_a_bumper(drum: Drum, bumper: Bumper) -> SetFactor[Hits]:
    return SetFactor[Hits](drum[Hits], drum[Hits] + 10)


def ten_for_speed(drum: Tuple[Hits, Velocity], other: Tuple[StoredEnergy]) -> SetFactor[Hits]:
    return SetFactor[Hits](drum[0], drum[0] + 100) if drum[1].norm() > 1 else None


@both_engines
@pytest.mark.parametrize("turned", [False, True])
def test_the_more_specific_note_wins_whatever_the_order(engine, turned):
    notes = [count, ten_for_a_bumper, ten_for_speed]
    levels = head_on(Drum, Bumper)
    state = after(engine, [move], levels, 3, on_contact=notes[::-1] if turned else notes)
    assert read(state, levels, Hits)[0, 2] == 10.0


def test_notes_that_disagree_are_an_error_that_names_environment_entity_factor_and_rules():
    notes = [rule(priority=0)(count.function), ten_for_speed]
    alone = [GolfBall({Position: (-0.9, -0.9)}), GoalTile({Position: (0.8, 0.8)}), Ball({Position: (0.205, 0.0)})]
    levels = Levels.from_entities([[*alone, Drum({Velocity: (speed, 0.0)})] for speed in (0.5, 2.0)])
    words = (
        r"count \(test_contact_notes.py:\d+\) and ten_for_speed \(test_contact_notes.py:\d+\) set Hits of 'drum' to"
        " different values.*neither is more specific"
    )
    world = World([move], on_contact=notes)
    with pytest.raises(ConflictError, match=f"^environment 1: {words}"):
        uncompiled(world, levels.layout).step(start(levels), levels, 3)
    interpreter = Interpreter(world, levels.layout)
    assert interpreter.step(levels, 0, n=3).contacts == 1
    with pytest.raises(ConflictError, match=words):
        interpreter.step(levels, 1, n=3)


def note_walls_and_bodies(drum: Drum, other: Object, wall: Wall) -> SetFactor[Hits]: ...
def note_without_a_wall(n: Hits) -> SetFactor[Hits]: ...


def note_a_rate(drum: Drum, other: Object) -> Aggregate[Hits]:
    return Aggregate[Hits](drum[Hits], 1.0)


def test_what_is_no_note_is_refused_when_the_world_is_made():
    for function in (note_walls_and_bodies, note_without_a_wall):
        with pytest.raises(RuleError, match="takes two entities that touch, or one and the Wall that it touches"):
            World(on_contact=[function])
    with pytest.raises(RuleError, match=r"note_a_rate .* a contact happens at an instant, so it can only return SetF"):
        World(on_contact=[note_a_rate])
    with pytest.raises(RuleError, match="a contact rule cannot have a relation; test inside the rule"):
        World(on_contact=[rule(relation=is_equal(Mobile, True))(count.function)])
    with pytest.raises(RuleError, match=r"count .* bodies pass through each other"):
        World(on_contact=[count], pair_contact=None)
    with pytest.raises(RuleError, match="on_contact must be a sequence of rules"):
        World(on_contact=count)  # type: ignore[arg-type]
    with pytest.raises(RuleError, match="stands in on_contact twice"):
        World(on_contact=[count, count])


def test_bodies_that_keep_one_factor_in_different_places_are_refused_by_rules_on_both():
    levels = head_on(Drum, Gong)
    with pytest.raises(RuleError, match=r"Drum, Gong, which hold different factors \(HardestImpact, Impact\)"):
        uncompiled(World([move], on_contact=[feel]), levels.layout)


@rule
def mark(a: Tuple[Mass, Velocity, Hits], b: Tuple[Mass, Position]) -> Tuple[SetFactor[Mass], SetFactor[Velocity]]:
    """A note with branches, on two bodies and of two kinds: what a kernel could get wrong."""
    m, v, hits = a
    if hits > 1 and b[0] > 1:
        return SetFactor[Mass](m, m * 0.99)
    return SetFactor[Velocity](v, 0.9 * v) if v.norm() > 0.5 else None


def test_kernel_and_interpreter_agree_about_notes():
    bodies = [Drum({Position: (0.3, 0.0), ID: "a"}), Drum({Position: (-0.3, 0.0), ID: "b"}), Ball({ID: "c"})]
    levels = level(*bodies)
    rng = np.random.default_rng(0)
    state = random_states(levels, 60, rng, speed=3.0)
    read(state, levels, Hits)[:, 2:4] = rng.integers(4, size=(60, 2))
    simulator = Simulator(World([move], on_contact=[count, count_walls, feel, mark]), levels.layout)
    found = compare(simulator, levels, state, n=8)
    assert found.worst <= 1e-12 and found.worst_crowded <= 1e-6 and found.contacts > 60


@rule
def swell(drum: Drum, other: Object) -> SetFactor[Size]:
    return SetFactor[Size](drum[Size], drum[Size] * 1.3)


@rule
def leap(drum: Drum, other: Object) -> SetFactor[Position]:
    return SetFactor[Position](drum[Position], -drum[Position])


@pytest.mark.parametrize("note", [swell, leap], ids=lambda note: note.name)
def test_bodies_that_a_note_enlarges_or_puts_elsewhere_meet_others_there_in_the_same_sub_step(note):
    """The list of near bodies and their radii, which a kernel keeps for a sub-step, must not be old ones."""
    levels = level(Drum({Position: (0.3, 0.0), ID: "a"}), Drum({Position: (-0.3, 0.0), ID: "b"}), Ball({ID: "c"}))
    state = random_states(levels, 80, np.random.default_rng(0), speed=3.0)
    found = compare(uncompiled(World([move], on_contact=[note, count]), levels.layout), levels, state, n=4)
    assert found.worst <= 1e-12 and found.worst_crowded <= 1e-6 and found.contacts > 40


@both_engines
def test_every_contact_of_free_balls_is_noted_once(engine):
    """In a box without friction or damping, contacts are the bounces off walls and half of what the balls count."""
    balls = [Drum({Position: (0.3, 0.1), Velocity: (3.0, 1.7), ID: "a"}), Drum({Position: (-0.3, 0.0), ID: "b"})]
    goal = GoalTile({Position: (0.8, 0.8)})
    levels = Levels.from_entities([[Club({Position: (-0.2, 0.4)}), goal, *balls]], {WallDamping: 0.0})
    world = World([move], on_contact=[count, count_walls])
    if engine == "interpreter":
        result = Interpreter(world, levels.layout).step(levels, n=300)
        values, contacts = result.values, result.contacts
    else:
        state = start(levels)
        uncompiled(world, levels.layout).step(state, levels, 300)
        values, contacts = state.values[0], state.contacts[0]
    hits, bounces = (np.nansum(values[:, levels.layout.columns[f]]) for f in (Hits, Bounces))
    assert hits > 4 and bounces > 4 and hits / 2 + bounces == contacts
