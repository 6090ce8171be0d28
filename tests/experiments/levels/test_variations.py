"""Variations change what they say and nothing else; conditions make the goal count later; designs pick training levels."""

import dataclasses

import numpy as np
import pytest

import segar
from segar import GoalTile, GolfBall, Gravity, Mass, Position, SandTile, apply_friction, lorentz_law
from segar.errors import LevelError
from segar.experiments.levels import rule_sets
from segar.experiments.levels.builders import distribution_of, make_levels
from segar.experiments.levels.rule_sets import situations_of
from segar.experiments.levels.variations import VARIATIONS, vary
from segar.experiments.settings import ConfigError, LevelsConfig
from segar.language import FloorFriction, Order
from segar.levels import share_rule_sets, shared_rule_sets, source_moments
from segar.metrics import rule_set_distances, w2
from segar.support import emd
from segar.tasks import Contender, conditional_puttputt


def levels_of(**settings):
    return make_levels(LevelsConfig(**{"train": "empty-hard", "count": 30, "test_count": 5, **settings}))


def values_of(levels, entity, factor):
    return levels.values[:, levels.layout.slot_index(entity), levels.layout.columns[factor]]


def test_the_mass_of_the_ball_varies_tenfold_in_training_and_test():
    for levels in levels_of(variation="ball_mass", test_count=30):
        mass = values_of(levels, "golfball", Mass)
        assert 0.3 <= mass.min() < 0.6 and 2.4 < mass.max() <= 3.0


def test_a_test_variation_leaves_the_training_levels_alone():
    plain, varied = levels_of(), levels_of(test_variation="gravity_40")
    assert plain[0] == varied[0]
    gravity = varied[1].layout.parameters.index(Gravity)
    assert (varied[1].parameters[:, gravity] == 40).all() and (varied[0].parameters[:, gravity] == 10).all()
    np.testing.assert_array_equal(plain[1].types, varied[1].types)


def test_friction_is_that_of_the_name():
    _, test = levels_of(test_variation="friction_0.8")
    assert (test.parameters[:, test.layout.parameters.index(FloorFriction)] == 0.8).all()


@pytest.mark.parametrize(("name", "missing"), [("frictionless", apply_friction), ("without_fields", lorentz_law)])
def test_rule_sets_lack_what_they_say(name, missing):
    rules = vary(segar.family("empty-hard"), name, "here").world.rules
    assert missing not in rules and len(rules) < len(segar.DEFAULT_RULES)
    assert missing in segar.DEFAULT_RULES


@pytest.mark.parametrize("family", ["empty-easy", "objectsx1-hard", "tilesx1-medium"])
@pytest.mark.parametrize("name", sorted(VARIATIONS))
def test_every_variation_suits_every_family(name, family):
    dist = vary(segar.family(family), name, "here")
    assert len(dist.sample(2, seed=0)) == 2
    assert dist.name == f"{family}+{name}"


def test_an_unknown_variation_is_told_with_its_place():
    with pytest.raises(ConfigError, match="no variation is called 'bal_mass'"):
        distribution_of(LevelsConfig(variation="bal_mass"), "train")


def test_a_design_picks_other_levels_of_the_same_number():
    iid, near = levels_of(count=10)[0], levels_of(count=10, design="clustered")[0]
    assert len(iid) == len(near) == 10
    assert values_of(near, "golfball", Position).std() < values_of(iid, "golfball", Position).std()


def test_nuisance_sets_differ_in_the_order_of_drawing_alone():
    levels = levels_of(count=10, design="nuisance_only")[0]
    assert len(np.unique(values_of(levels, "golfball", Order))) > 1
    assert len(np.unique(values_of(levels, "golfball", Position))) == 1


def test_a_design_may_say_how_far_training_is_from_test():
    train, test = levels_of(count=10, test_count=50, design="w2_1.9")
    assert w2(train, test) == pytest.approx(1.9, rel=0.01) and len(train) == 10
    far, test = levels_of(count=10, test_count=50, design="w2_x1.2")
    pool = segar.family("empty-hard").sample(50, seed=0, split="train")
    independent = np.mean([w2(pool[range(k, k + 10)], test) for k in range(0, 50, 10)])
    assert w2(far, test) == pytest.approx(1.2 * independent, rel=0.01)


def test_a_distance_out_of_reach_names_the_range():
    wanted = (
        r"levels.design: w2_x9 cannot be had, which is 9 times the \d\.\d+ of independent levels.*reach from \d.*to \d"
    )
    with pytest.raises(ConfigError, match=wanted):
        levels_of(count=10, test_count=50, design="w2_x9")


SHIFTED = {"variation": "moderate", "test_variation": "heavy_smooth", "train": "objectsx1-medium"}


def drawn_by(levels):
    """What each of three mechanisms gave the levels: masses, frictions, and how high the goal is."""
    friction = levels.parameters[:, [levels.layout.parameters.index(FloorFriction)]]
    height = levels.layout.columns[Position] + 1
    return {
        "Mass": values_of(levels, "golfball", Mass),
        "FloorFriction": friction,
        "Position": levels.values[:, levels.layout.slot_index("goal"), height],
    }


@pytest.mark.parametrize("name", ["Mass", "FloorFriction", "Position"])
def test_some_training_levels_have_one_mechanism_of_the_test_and_all_else_as_in_training(name):
    plain, chosen = (levels_of(**SHIFTED, design=design)[0] for design in ("iid", f"{name}_of_test_30"))
    assert plain[9:] == dataclasses.replace(chosen[9:], provenance=plain[9:].provenance)
    many = {"train": "objectsx1-medium", "count": 500}
    mean, _ = source_moments(chosen)[GolfBall, Mass]
    assert mean == pytest.approx(0.7 * 1.0 + 0.3 * 1.75 if name == "Mass" else 1.0, abs=0.02)
    of_train, of_test = (drawn_by(levels_of(**many, variation=law)[0]) for law in ("moderate", "heavy_smooth"))
    for mechanism, values in drawn_by(chosen[:9]).items():
        inside_train, inside_test = (
            ((law[mechanism].min(axis=0) - 0.05 <= values) & (values <= law[mechanism].max(axis=0) + 0.05)).all()
            for law in (of_train, of_test)
        )
        assert (inside_train, inside_test)[mechanism == name] and inside_train == (mechanism != name)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({**SHIFTED, "design": "Mas_of_test_30"}, "no mechanism 'Mas'. Did you mean 'Mass'"),
        ({**SHIFTED, "design": "Charge_of_test_30"}, "have the same Charge; levels.test_variation"),
        ({"train": "property-heavy-v1", "design": "Mass_of_test_30"}, "property-heavy-v1 draws its training levels"),
        ({"test_variation": "frictionless", "design": "World_of_test_30"}, "no mechanism 'World'"),
        ({"train": "empty-hard", "test": "objectsx1-hard", "design": "Entities_of_test_30"}, "other slots, types"),
    ],
)
def test_a_mechanism_that_no_part_of_the_levels_can_have_is_told(settings, message):
    with pytest.raises(ConfigError, match=f"levels.design: .*{message}"):
        levels_of(**settings)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("w2_far", "'w2_far' says no distance; w2_4.2 does, and w2_x1.2"),
        ("w2_x0", "'w2_x0' is not allowed; it must be a distance above 0"),
        ("clustred", "'clustred' is unknown. Did you mean 'clustered'"),
    ],
)
def test_a_wrong_design_is_told_with_its_place(name, message):
    with pytest.raises(ConfigError, match=f"levels.design: {message}"):
        LevelsConfig(design=name)


def course():
    ball = Contender({Position: (0.9, 0.0), segar.Velocity: (3.0, 0.0)})
    things = [ball, GoalTile({Position: (0.6, 0.0)}), SandTile({Position: (-0.8, -0.8)})]
    return segar.Levels.from_entities([things])


def steps_until_success(conditions, **start):
    """Steps that a ball takes to the goal when it is steered straight at it; -1 if 60 are not enough."""
    world = vary(segar.family("empty-hard"), "conditions", "here").world
    levels = course()
    interpreter = segar.Interpreter(world, levels.layout, conditional_puttputt(conditions))
    values = None
    for step in range(60):
        action = [0.0, 0.0]
        if values is not None:
            ball, goal = (values[levels.layout.slot_index(name)] for name in ("golfball", "goal"))
            x, v = (levels.layout.columns[f] for f in (Position, segar.Velocity))
            action = list(np.clip((4 * (goal[x : x + 2] - ball[x : x + 2]) - ball[v : v + 2]) / 2, -1, 1))
        result = interpreter.step(levels, values=values, action=action)
        values = result.values
        if result.success:
            return step + 1
    return -1


def test_more_conditions_need_more_steps_and_sand_needs_a_detour():
    none, slow, wall, sand = (steps_until_success(k) for k in range(4))
    assert 0 < none <= slow <= wall
    assert sand == -1  # the steered ball never rolls over sand


def test_there_are_three_conditions():
    with pytest.raises(segar.SegarError, match="there are 0 to 3 of them, not 4"):
        conditional_puttputt(4)


def rule_sets_of(design, count=40, **settings):
    rule_space = {"variation": "rule_space", "test_variation": "rule_space_unseen"}
    return levels_of(count=count, test_count=20, design=design, **rule_space, **settings)


def test_training_levels_take_turns_with_as_many_rule_sets_as_the_design_says():
    train, test = rule_sets_of("rule_sets_7")
    all_of_own = rule_sets_of("rule_sets_40")[0]
    pairs = shared_rule_sets(train, all_of_own)
    np.testing.assert_array_equal(pairs[:, 1], np.arange(40) % 7)
    assert not len(shared_rule_sets(test, train))


def test_near_rule_sets_are_nearer_and_far_ones_farther_than_any_of_others(monkeypatch):
    monkeypatch.setattr(rule_sets, "SETS", 50)
    (near, test), (far, _) = (rule_sets_of(f"rule_sets_5{what}") for what in ("_near", "_far"))
    situations, every = situations_of(test), rule_sets_of("rule_sets_40")[0]
    fives = [near[:5], far[:5], *(every[first : first + 5] for first in range(0, 40, 5))]
    apart = [np.sqrt(emd(rule_set_distances(one, test, situations) ** 2)) for one in fives]
    assert apart[0] < np.mean(apart[2:]) < apart[1] and apart[0] < np.sort(apart[2:])[1]
    for picked in (near, far):
        assert len(set(shared_rule_sets(picked, every)[:, 1])) == 5
        assert picked == rule_sets_of(f"rule_sets_5_{'near' if picked is near else 'far'}")[0]


def test_rule_sets_that_cannot_be_picked_are_told():
    with pytest.raises(ConfigError, match="rule_sets_41_near: 41 rule sets cannot be picked among 40 levels"):
        rule_sets_of("rule_sets_41_near")
    with pytest.raises(ConfigError, match="rule_sets_41: rule sets: there must be 1 to 40"):
        rule_sets_of("rule_sets_41")
    with pytest.raises(ConfigError, match="one world for all"):
        levels_of(count=4, design="rule_sets_2_far")


@pytest.mark.parametrize("wrong", [0, 9, True, 1.5, [], [8], [-1], [0.5], [[1]], "two"])
def test_rule_sets_that_are_no_number_or_indices_are_refused(wrong):
    levels = rule_sets_of("iid", count=8)[0]
    with pytest.raises(LevelError, match="rule sets: "):
        share_rule_sets(levels, wrong)
