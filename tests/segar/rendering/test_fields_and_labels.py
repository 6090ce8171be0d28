"""Arrows of fields point where charges push; labels hide neither things nor each other."""

import itertools

import numpy as np
import pytest

import segar
from segar import Charger, GolfBall, Position, puttputt
from segar.rendering import Stage
from segar.rendering.labels import Request, overlap, place_labels
from segar.rendering.scene import charge_sources, electric_field, hint_strength


def charges(*of: tuple[float, tuple[float, float]]):
    level = [GolfBall({Position: (0.9, 0.9)}), *(Charger({segar.Charge: q, Position: at}) for q, at in of)]
    levels = segar.Levels.from_entities([level])
    return charge_sources(Stage(levels, segar.World(), puttputt()).scene(levels.values[0], 0).figures)


def test_the_field_of_a_charge_is_one_over_the_square_of_the_distance_and_points_away():
    (source,) = charges((2.0, (0.0, 0.0)))
    field = electric_field([source], np.array([[0.5, 0.0], [0.0, -0.25]]))
    np.testing.assert_allclose(field, [[2 / 0.5**2, 0], [0, -2 / 0.25**2]])


def test_fields_add_up_and_opposite_charges_cancel_in_the_middle():
    sources = charges((1.0, (-0.5, 0.0)), (1.0, (0.5, 0.0)))
    np.testing.assert_allclose(electric_field(sources, np.zeros((1, 2))), 0, atol=1e-12)
    points = np.random.default_rng(0).uniform(-1, 1, (20, 2))
    alone = sum(electric_field([source], points) for source in sources)
    np.testing.assert_allclose(electric_field(sources, points), alone)


def test_the_agent_s_own_charge_is_not_hinted_at():
    assert charges() == []


def test_hints_grow_with_the_field_from_nothing_to_all():
    strength = hint_strength(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 3.0], [1e9, 0.0]]))
    assert strength[0] == 0 < strength[1] < strength[2] < strength[3] == 1


def test_labels_with_room_enough_overlap_nothing():
    rng = np.random.default_rng(3)
    frame = (0.0, 0.0, 512.0, 512.0)
    for _ in range(20):
        cells = rng.permutation(16)[:6]  # of a grid of 4 x 4, so that there is room
        middles = np.stack([64 + 128 * (cells % 4), 64 + 128 * (cells // 4)], axis=1) + rng.uniform(-15, 15, (6, 2))
        things = [(x - 25.0, y - 25.0, x + 25.0, y + 25.0) for x, y in middles]
        boxes = place_labels([Request(thing, 80.0, 14.0) for thing in things], things, frame)
        assert all(overlap(a, b) == 0 for a, b in itertools.combinations(boxes, 2))
        assert all(overlap(box, thing) == pytest.approx(0, abs=1e-6) for box in boxes for thing in things)


def test_labels_stay_inside_the_picture():
    frame = (0.0, 0.0, 200.0, 200.0)
    for corner in itertools.product((0.0, 180.0), repeat=2):
        thing = (*corner, corner[0] + 20, corner[1] + 20)
        (box,) = place_labels([Request(thing, 120.0, 14.0)], [thing], frame)
        assert overlap(box, frame) == pytest.approx(120 * 14)


def test_a_label_with_room_inside_its_thing_stays_there():
    thing = (50.0, 50.0, 150.0, 150.0)
    (box,) = place_labels([Request(thing, 60.0, 14.0, inside=True)], [thing], (0.0, 0.0, 200.0, 200.0))
    assert box == (70.0, 93.0, 130.0, 107.0)
