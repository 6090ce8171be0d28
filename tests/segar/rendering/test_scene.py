"""What people are shown is what the state holds, for things of one's own as well."""

from types import SimpleNamespace
from typing import Tuple

import numpy as np
import pytest

import segar
from segar import Ball, Charge, GoalTile, GolfBall, Mass, Position, SandTile, Shape, puttputt
from segar.language import NO_LIMIT, Heat
from segar.rendering import Stage, status_line


class Temperature(segar.Scalar, default=20.0, unit="degC"): ...


class HeavyCharge(Charge): ...


class Ember(segar.Tile):
    temperature: Temperature = 300.0
    heat: Heat = 0.25


class Ion(segar.language.Thing):
    special: HeavyCharge = -0.5


def scene_of(*entities: segar.Entity, world: segar.World | None = None, task: segar.Task | None = None):
    levels = segar.Levels.from_entities([entities], world=world)
    return Stage(levels, world or segar.World(), task or puttputt()).scene(levels.values[0], 0)


def test_figures_have_the_places_and_factors_of_the_state():
    scene = scene_of(GolfBall({Position: (0.25, -0.5)}), GoalTile(), SandTile({segar.Friction: 0.75}))
    found = {figure.name: figure for figure in scene.figures}
    assert set(found) == {"golfball", "goal", "sand"}  # not the floor, which has no place
    assert found["golfball"].place.tolist() == [0.25, -0.5] and found["golfball"].radius == 0.1
    assert found["golfball"].charge == 1.0 and found["sand"].friction == 0.75
    assert found["golfball"].corners.shape == (0, 2) and found["sand"].corners.shape == (4, 2)
    assert found["sand"].is_tile and not found["golfball"].is_tile


def test_objects_lie_on_tiles_the_highest_order_on_top_and_of_tiles_the_lowest():
    order = [
        Ball({segar.language.Order: 2, segar.language.ID: "high"}),
        Ball({segar.language.Order: 1, segar.language.ID: "low"}),
        SandTile({segar.language.Order: 1, segar.language.ID: "below"}),
        SandTile({segar.language.Order: 0, segar.language.ID: "above"}),
    ]
    assert [figure.name for figure in scene_of(*order).figures] == ["below", "above", "low", "high"]


def test_entities_and_factors_of_one_s_own_are_seen():
    scene = scene_of(GolfBall(), Ember(), Ion({Position: (0.5, 0.5)}))
    found = {figure.entity: figure for figure in scene.figures}
    assert found[Ember].heat == 0.25 and "Temperature 300" in found[Ember].note
    assert found[Ion].charge == -0.5  # a sub-class of a factor counts as the factor
    assert "q −0.50" in found[Ion].note


def test_a_note_says_what_is_not_as_usual():
    light = scene_of(GolfBall({Mass: 0.25})).figures[0].note
    assert "m 0.25" in light and "q +1.00" in light
    assert scene_of(Ball()).figures[0].note == ""


def test_the_agent_is_what_actions_move():
    scene = scene_of(GolfBall(), GoalTile(), Ball({Position: (0.5, 0.5)}))
    assert [figure.name for figure in scene.figures if figure.is_agent] == ["golfball"]

    def push_all(o: Tuple[segar.Mass, segar.Velocity], action: segar.Action) -> segar.SetFactor[segar.Velocity]:
        return segar.SetFactor[segar.Velocity](o[1], o[1] + segar.language.VectorValue(action[0], action[1]))

    scene = scene_of(GolfBall(), GoalTile(), Ball({Position: (0.5, 0.5)}), task=segar.Task("push all", push_all))
    assert {figure.name for figure in scene.figures if figure.is_agent} == {"golfball", "ball"}


def test_fields_are_hinted_at_where_rules_listen_to_them():
    scene = scene_of(GolfBall())
    assert scene.has_charges and scene.has_magnets
    quiet = scene_of(GolfBall(), world=segar.World(rules=(segar.move,)))
    assert not quiet.has_charges and not quiet.has_magnets


def test_what_has_no_finite_place_is_not_drawn():
    levels = segar.Levels.from_entities([[GolfBall(), Ball()]])
    values = levels.values[0].copy()
    values[1, levels.layout.columns[Position]] = np.nan
    scene = Stage(levels, segar.World(), puttputt()).scene(values, 0)
    assert [figure.name for figure in scene.figures] == ["golfball"]


def test_a_hull_is_where_its_vertices_are():
    triangle = segar.language.ConvexHull([(0, 0), (0.4, 0), (0, 0.3)])
    figure = scene_of(SandTile({Position: (0.1, 0.2), Shape: triangle})).figures[0]
    assert sorted(map(tuple, figure.corners.round(9).tolist())) == [(0.1, 0.2), (0.1, 0.5), (0.5, 0.2)]
    assert figure.radius == pytest.approx(0.4)


def test_the_line_below_the_arena_names_the_limit_of_steps_where_there_is_one():
    now = SimpleNamespace(lengths=[3], returns=[-0.0001], state=SimpleNamespace(level=[7]))
    rest = "return 0.000    level 7    putt"
    assert status_line(SimpleNamespace(name="putt", max_steps=100), now, 0) == f"step 3 / 100    {rest}"
    assert status_line(SimpleNamespace(name="putt", max_steps=NO_LIMIT), now, 0, "DEAD") == f"step 3    {rest}    DEAD"
