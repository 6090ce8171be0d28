"""What makes the gap: mixed levels, and shares that add up to what is to be explained."""

import dataclasses

import numpy as np
import pandas as pd
import pytest
import statsmodels.formula.api as smf
from statsmodels.stats.anova import anova_lm

import segar
from analysis.stats.attribution import (
    REST,
    anova,
    full_factorial,
    half_factorial,
    main_effects,
    mixed_levels,
    play_design,
    shapley,
)
from experiments.evaluation.baselines import IdleAgent
from experiments.evaluation.episodes import play_episodes
from segar import Charge, Position, Size
from segar.errors import LevelError, SegarError
from segar.hardness import make_situations
from segar.language.parameters import FloorFriction, Gravity
from segar.levels import shared_rule_sets
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


def test_one_group_changes_and_the_rest_stays(sets):
    train, test = sets
    made = mixed_levels(train, test, GROUPS, {"position": True})
    assert np.array_equal(column(made, "goal", Position), column(test, "goal", Position))
    assert np.array_equal(column(made, "golfball", Size), column(train, "golfball", Size))
    assert np.array_equal(made.types, train.types)


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
    test.parameters[:, test.layout.parameters.index(FloorFriction)] = 0.3
    groups = {"physics": [Gravity, FloorFriction]}
    made = mixed_levels(train, test, groups, {"physics": True})
    assert (made.parameters[:, made.layout.parameters.index(FloorFriction)] == 0.3).all()
    assert (made.values[:, -1, made.layout.columns[segar.Friction]] == 0.3).all()


def additive(levels):
    """A score that is a sum of a part for the goal's place and a part for the ball's size."""
    return -3 * column(levels, "goal", Position) + 10 * column(levels, "golfball", Size)


def test_shapley_gives_each_part_of_a_sum_to_its_group(sets):
    train, test = sets
    played = play_design(additive, train, test, GROUPS, full_factorial(NAMES), 40, np.random.default_rng(0))
    found = shapley(played, NAMES).set_index("group")
    pairs = played.drop_duplicates("pair")
    moved = column(test, "goal", Position)[pairs.test_level] - column(train, "goal", Position)[pairs.train_level]
    assert found.loc["position", "estimate"] == pytest.approx(-3 * moved.mean())
    assert found.loc[REST, "estimate"] == pytest.approx(0, abs=1e-12)
    assert found.loc[NAMES, "estimate"].sum() == pytest.approx(found.loc["total", "estimate"])
    assert found.loc[NAMES, "share"].sum() == pytest.approx(1)


def test_shapley_divides_an_interaction_evenly(sets):
    train, test = sets

    def both(levels):
        new = [column(levels, "goal", Position) == column(test, "goal", Position)[:1],
               column(levels, "golfball", Size) == column(test, "golfball", Size)[:1]]  # fmt: skip
        return (new[0] & new[1]).astype(float)

    played = play_design(both, train, test[[0]], GROUPS, full_factorial(NAMES), 10, np.random.default_rng(1))
    found = shapley(played, NAMES).set_index("group")["estimate"]
    assert found["position"] == pytest.approx(0.5) and found["size"] == pytest.approx(0.5)
    terms = anova(played, NAMES).set_index("term")
    assert terms.loc["position x size", "estimate"] == pytest.approx(0.5)  # 1 - 0 - 0 + 0, halved
    assert terms.loc[REST, "sum_of_squares"] == pytest.approx(0)


def test_sums_of_squares_are_statsmodels(sets):
    train, test = sets
    noise = np.random.default_rng(2)
    played = play_design(
        lambda levels: additive(levels) * column(levels, "golfball", Position) + noise.normal(size=len(levels)),
        train, test, GROUPS, full_factorial(NAMES), 12, np.random.default_rng(3),
    )  # fmt: skip
    theirs = anova_lm(smf.ols("value ~ C(pair) + C(position) * C(size) * C(rest)", played).fit())
    ours = anova(played, NAMES).set_index("term")["sum_of_squares"]
    assert ours["position"] == pytest.approx(theirs.loc["C(position)", "sum_sq"])
    assert ours["position x size"] == pytest.approx(theirs.loc["C(position):C(size)", "sum_sq"])
    assert ours["position x size x rest"] == pytest.approx(theirs.loc["C(position):C(size):C(rest)", "sum_sq"])


def test_half_a_design_finds_the_same_main_effects_of_a_sum(sets):
    train, test = sets
    full, half = (
        play_design(additive, train, test, GROUPS, design(NAMES), 20, np.random.default_rng(4))
        for design in (full_factorial, half_factorial)
    )
    assert len(half) == len(full) / 2
    a, b = (main_effects(table, NAMES)["estimate"].to_numpy() for table in (full, half))
    assert a == pytest.approx(b)


def test_noise_is_called_an_effect_five_times_in_a_hundred():
    rng = np.random.default_rng(5)
    table = full_factorial(["a", "b"]).merge(pd.DataFrame({"pair": np.arange(20)}), how="cross")
    p = [shapley(table.assign(value=rng.normal(size=len(table))), ["a", "b"])["p"].iloc[0] for _ in range(200)]
    assert np.mean(np.array(p) < 0.05) == pytest.approx(0.05, abs=0.045)


def test_the_gap_of_a_player_is_attributed(sets):
    """No-op returns: the ball stays where it is put, so the way to the goal is all that counts."""
    train, test = (segar.family("empty-hard").sample(6, seed=1, split=split) for split in ("train", "test"))

    def returns(levels):
        rows = play_episodes(IdleAgent(), levels, np.arange(len(levels)), {"observation": "state"}, rng=None, seed=0)
        return np.array([row["return"] for row in rows])

    groups = {"position": [Position], "charge": [Charge]}
    names = [*groups, REST]
    played = play_design(returns, train, test, groups, full_factorial(names), 8, np.random.default_rng(6))
    found = shapley(played, names).set_index("group")["estimate"]
    assert found["position"] == pytest.approx(found["total"]) and found["total"] != 0
    assert found["charge"] == found[REST] == 0


def test_groups_that_overlap_or_name_nothing_are_refused(sets):
    with pytest.raises(LevelError, match="groups 'a' and 'b'"):
        mixed_levels(*sets, {"a": [Size], "b": ["Size"]}, {})
    with pytest.raises(LevelError, match="no factor or parameter 'Sise'"):
        mixed_levels(*sets, {"a": ["Sise"]}, {})


def test_a_design_with_a_hole_is_refused(sets):
    played = play_design(additive, *sets, GROUPS, half_factorial(NAMES), 3, np.random.default_rng(0))
    with pytest.raises(SegarError, match="all 8 combinations"):
        shapley(played, NAMES)
