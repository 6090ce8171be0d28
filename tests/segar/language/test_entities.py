"""Entity types: what they inherit."""

import segar
from segar.language import ID, Ball, Charge, Circle, GolfBall, Label, Mass, Object, Shape, Size, entity_name


class Glow(segar.Scalar, default=1.0): ...


class Lamp(Ball):
    glow: Glow = 3.0
    mass: Mass = 2.0
    label: Label = "lamp"


class BigLamp(Lamp):
    size: Size = 0.5


class LampToHit(GolfBall, Lamp): ...


class Kite(GolfBall):
    label: Label = "kite"


class NamedKite(GolfBall):
    id: ID = "kite"


class BigLampToHit(GolfBall, BigLamp): ...


def test_an_entity_with_two_parents_has_the_factors_of_both_and_defaults_in_python_s_order():
    declared = LampToHit.declared
    assert declared[Glow] == 3.0
    assert declared[Charge] == GolfBall.declared[Charge] == 1.0 and declared[Label] == "golfball", "the first parent's"
    assert declared[Mass] == 2.0, "Lamp says so, and GolfBall only inherits its own from Object"
    assert issubclass(LampToHit, Object) and set(declared) == set(GolfBall.declared) | set(Lamp.declared)


def test_a_size_brings_its_circle_along_also_through_two_parents():
    assert BigLamp.declared[Shape] == BigLampToHit.declared[Shape] == Circle(0.5)
    assert Lamp.declared[Shape] == Circle(0.2)


def test_an_entity_is_named_by_its_id_which_it_may_inherit_and_else_by_its_label():
    assert [entity_name(one) for one in (Lamp, BigLamp, Kite, NamedKite)] == ["lamp", "lamp", "golfball", "kite"]
