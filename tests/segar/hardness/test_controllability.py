"""What actions can change: analytic gains, and the split of factors in worlds where the truth is known."""

import numpy as np
import pytest

import segar
from segar import Ball, GoalTile, GolfBall, Levels, Mass, Position, SegarError, Velocity, World
from segar.hardness import influence
from segar.language import Framerate

FREE = World(rules=[segar.move])  # no friction: a push lasts


def test_the_gain_of_velocity_is_the_impulse_over_the_mass_and_that_of_position_grows_with_time():
    levels = Levels.from_entities(
        [[GolfBall({Position: [0, 0], Mass: 50.0}), GoalTile({Position: [0.9, 0.9]})]], world=FREE
    )
    found = influence(levels, rng=np.random.default_rng(0), horizon=10)
    assert found.of("golfball", "Velocity").gain == pytest.approx(2.0 / 50.0, rel=1e-3)
    seconds = 10 * 5 / float(Framerate.default)
    assert found.of("golfball", "Position").gain == pytest.approx(2.0 / 50.0 * seconds, rel=1e-3)


class Drifter(segar.language.Thing):
    """It moves, and has nothing that anything could touch or push: no mass, no charge, no collisions."""

    velocity: Velocity = (0.4, 0.1)
    id: segar.language.ID = "drifter"


@pytest.mark.slow
def test_a_thing_that_nothing_can_touch_is_exogenous_and_a_ball_in_the_way_is_endogenous():
    golfball, goal = GolfBall({Position: [-0.5, 0.5]}), GoalTile({Position: [0.9, 0.9]})
    drifter = Drifter({Position: [0.0, -0.5]})
    near, far = (Ball({Position: place}) for place in ([-0.2, 0.5], [0.8, -0.8]))
    levels = Levels.from_entities([[golfball, goal, drifter, near], [golfball, goal, drifter, far]])
    found = influence(levels, rng=np.random.default_rng(0), horizon=3)
    assert set(found.of_kind("exogenous")) == {("drifter", "Position")}
    assert found.of("drifter", "Position").gain == found.of("drifter", "Position").reach == 0
    assert {("golfball", "Position"), ("golfball", "Velocity")} < set(found.of_kind("endogenous"))
    assert {("ball", "Position"), ("ball", "Velocity")} < set(found.of_kind("endogenous"))
    assert ("goal", "Position") in found.of_kind("constant")
    assert found.of("golfball", "Position").share == 1.0
    assert found.of("ball", "Position").share == 0.5  # the far one is out of reach in three steps


def test_kinds_part_all_factors_that_there_are():
    levels = segar.family("objectsx1-hard").sample(10, seed=0)
    found = influence(levels, rng=np.random.default_rng(0), plays=2)
    kinds = [found.of_kind(kind) for kind in ("endogenous", "exogenous", "constant")]
    assert sum(map(len, kinds)) == len(found.factors) == len({(f.entity, f.factor) for f in found.factors})
    assert ("golfball", "Velocity") in kinds[0] and ("golfball", "Size") in kinds[2]
    assert [f.share for f in found.factors] == sorted((f.share for f in found.factors), reverse=True)


def test_what_makes_no_sense_is_refused():
    levels = segar.family("empty-hard").sample(1, seed=0)
    with pytest.raises(SegarError, match="a horizon of 1 to 100 steps, at least 1 play"):
        influence(levels, rng=np.random.default_rng(0), horizon=101)
    found = influence(levels, rng=np.random.default_rng(0), horizon=2, tolerance=1e9)
    assert not found.of_kind("endogenous")  # no difference is above the tolerance
    with pytest.raises(SegarError, match="none of these levels has 'ball' with Mass"):
        found.of("ball", "Mass")
