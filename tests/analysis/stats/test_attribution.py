"""What makes the gap: mixed levels, and shares that add up to what is to be explained."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

import segar
from segar.analysis.stats.attribution import full_factorial, shapley_of_pairs
from segar.errors import LevelError, SegarError
from segar.hardness import make_situations
from segar.language import FloorFriction, Gravity, Mass, Position, Size
from segar.levels import REST, mixed_levels, shared_rule_sets
from segar.metrics import rule_set_distances
from segar.rules import DEFAULT_RULES, World, apply_friction, record_drag
from segar.rules.templates import dynamics_space

GROUPS = {"position": [Position], "size": ["Size"]}
FRICTIONLESS = [rule for rule in DEFAULT_RULES if rule not in (apply_friction, record_drag)]
NAMES = ["position", "size", REST]


@pytest.fixture(scope="module")
def sets():
    hard = segar.family("objectsx1-hard")
    return hard.sample(30, seed=0, split="train"), hard.sample(30, seed=0, split="test")


def column(levels, slot, factor):
    return levels.values[:, levels.layout.slot_index(slot), levels.layout.columns[factor]]


def test_all_groups_make_the_test_levels_and_none_the_training_levels(sets):
    train, test = sets
    for chosen, expected in (({}, train), (dict.fromkeys(NAMES, True), test)):
        made = mixed_levels(train, test, GROUPS, chosen)
        for name in ("types", "values", "shape_kind", "vertices", "parameters"):
            assert np.array_equal(getattr(made, name), getattr(expected, name), equal_nan=True), name


def test_levels_in_between_stand_for_themselves_wherever_the_others_come_from(sets, tmp_path):
    """Their distance has the units of both sets, as in memory, not of the law that training levels are drawn from."""
    sets[0].save(tmp_path / "train.npz")
    distances = []
    for train in (sets[0], segar.Levels.load(tmp_path / "train.npz")):
        values = train.values.copy()
        values[:, train.layout.slot_index("golfball"), train.layout.columns[Mass]] += 5.0
        made = mixed_levels(train, dataclasses.replace(train, values=values), {"mass": [Mass]}, {"mass": True})
        distances.append(segar.metrics.w2(train, made))
    assert distances[0] == pytest.approx(distances[1], rel=1e-9) and 1.0 < distances[0] <= 2.0


def test_the_group_of_rules_has_the_rule_sets_of_test_levels_and_the_reverse_all_else():
    dist, space = segar.family("objectsx1-hard"), dynamics_space()
    train, test = (dist.with_rules(space.split(part)).sample(12, seed=0, split=part) for part in ("train", "test"))
    groups = {"rules": ["World"]}
    ruled, rest = (mixed_levels(train, test, groups, {name: True}) for name in ("rules", REST))
    for made, of_rules, of_rest in ((ruled, test, train), (rest, train, test)):
        assert np.array_equal(shared_rule_sets(made, of_rules)[:, 0], np.arange(12)) and made.world is of_rules.world
        assert np.array_equal(made.values, of_rest.values, equal_nan=True)
    assert not len(shared_rule_sets(ruled, train))
    # What the group does to the dynamics is the distance of the rule sets; the rest does nothing to them.
    there = make_situations(dist.sample(3, seed=1), rng=np.random.default_rng(0), horizons=[5])
    apart = [np.diag(rule_set_distances(made, test, there)) for made in (ruled, rest)]
    assert apart[0].max() == 0 and np.median(apart[1]) > 0.1
    with pytest.raises(LevelError, match="slope_x is in the groups 'rules' and 'slope'; it can be in one alone"):
        mixed_levels(train, test, {**groups, "slope": ["slope_x"]}, {})


def test_rules_without_a_group_are_those_of_the_rest(sets):
    train, test = sets
    changed = dataclasses.replace(test, world=World(FRICTIONLESS))
    for groups, chosen, expected in (
        (GROUPS, {"position": True}, train),
        (GROUPS, {REST: True}, changed),
        ({**GROUPS, "rules": [World]}, {REST: True}, train),
        ({**GROUPS, "rules": [World]}, {"rules": True}, changed),
    ):
        assert mixed_levels(train, changed, groups, chosen).world is expected.world


def test_a_parameter_can_be_a_group_and_the_floor_follows_it():
    dist = segar.family("empty-easy")
    train, test = (dist.sample(4, seed=0, split=split) for split in ("train", "test"))
    parameters = test.parameters.copy()
    parameters[:, test.layout.parameters.index(FloorFriction)] = 0.3
    test = dataclasses.replace(test, parameters=parameters)
    groups = {"physics": [Gravity, FloorFriction]}
    made = mixed_levels(train, test, groups, {"physics": True})
    assert (made.parameters[:, made.layout.parameters.index(FloorFriction)] == 0.3).all()
    assert (made.values[:, -1, made.layout.columns[segar.Friction]] == 0.3).all()


def additive(levels):
    """A score that is a sum of a part for the goal's place and a part for the ball's size."""
    return -3 * column(levels, "goal", Position) + 10 * column(levels, "golfball", Size)


def played(play, train, test, groups=GROUPS):
    """What ``play`` scores on every combination of the groups of pairs of levels, the first with the first and so on."""
    parts = []
    for chosen in full_factorial([*groups, REST]).to_dict("records"):
        value = play(mixed_levels(train, test, groups, chosen))
        parts.append(pd.DataFrame({"pair": np.arange(len(train)), **chosen, "value": value}))
    return pd.concat(parts, ignore_index=True)


def test_shapley_gives_each_part_of_a_sum_to_its_group(sets):
    train, test = sets
    found = shapley_of_pairs(played(additive, train, test), NAMES)
    moved = column(test, "goal", Position) - column(train, "goal", Position)
    assert found["position"].to_numpy() == pytest.approx(-3 * moved)
    assert found[REST].to_numpy() == pytest.approx(0, abs=1e-12)
    assert found[NAMES].sum(axis=1).to_numpy() == pytest.approx(found["total"].to_numpy())


def test_shapley_divides_an_interaction_evenly(sets):
    train, test = sets[0][:10], sets[1][np.zeros(10, int)]

    def both(levels):
        new = [column(levels, "goal", Position) == column(test, "goal", Position)[:1],
               column(levels, "golfball", Size) == column(test, "golfball", Size)[:1]]  # fmt: skip
        return (new[0] & new[1]).astype(float)

    found = shapley_of_pairs(played(both, train, test), NAMES)
    assert (found["position"] == 0.5).all() and (found["size"] == 0.5).all() and (found[REST] == 0).all()


def test_groups_that_overlap_or_name_nothing_and_a_design_with_a_hole_are_refused(sets):
    with pytest.raises(LevelError, match="groups 'a' and 'b'"):
        mixed_levels(*sets, {"a": [Size], "b": ["Size"]}, {})
    with pytest.raises(LevelError, match="no factor or parameter 'Sise'"):
        mixed_levels(*sets, {"a": ["Sise"]}, {})
    for names in (["a", "a"], ["a", "total"]):
        with pytest.raises(SegarError, match="groups must have names of their own"):
            full_factorial(names)
    with pytest.raises(SegarError, match="all 8 combinations"):
        shapley_of_pairs(played(additive, *sets)[1:], NAMES)
