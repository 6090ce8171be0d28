"""Causal twins differ from their level in one group of factors alone, and a failure is attributed to what made it."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

import segar
from segar import GolfBall, Gravity, Mass, Position, Prior, UniformNoise
from segar.analysis.causes import causes_plot, profile_of_causes, read_causes
from segar.errors import LevelError, SegarError, SuiteError
from segar.levels import hash_of_levels, mechanisms, set_as, with_mechanisms
from segar.rules import DEFAULT_RULES, apply_friction, record_drag
from segar.suites import find_causes, freeze, own_suite, suite, suites, twins
from segar.suites.causal_twins import ALL_THAT_DIFFERS, KINDS, LOOK, OTHERS, PLACE, RULES_GROUP
from tests import raft

LEVELS = 12
EASY = {
    "axis": "property",
    "shift": "extrapolation",
    "says": "The ball is heavier.",
    "training_levels": 5,
    "test_levels": LEVELS,
}
HARD = segar.family("objectsx1-hard")


def with_mass(low, high, **changed):
    priors = [*HARD.priors, Prior(Mass, UniformNoise(low, high), entity_type=GolfBall)]
    return dataclasses.replace(HARD, priors=priors, **changed)


@pytest.fixture(scope="module")
def heavy(tmp_path_factory):
    """A suite of one's own in which mass and gravity differ."""
    path = tmp_path_factory.mktemp("twins") / "property-own-v1.toml"
    options = {**EASY, "options": {"max_steps": 50}, "samples": 32, "iterations": 3}
    test = with_mass(2.0, 3.0, parameters={Gravity: 12.0})
    return freeze(path, train=with_mass(0.3, 1.0), test=test, **options)


@pytest.fixture(scope="module")
def made(heavy):
    return twins(heavy)


def changed_columns(twin, levels):
    """Names of factors and parameters in which some twin differs from its level."""
    layout, found = levels.layout, set()
    for factor, at in layout.columns.items():
        ours, theirs = (np.nan_to_num(one.values[:, :-1, at : at + factor.width]) for one in (levels, twin.levels))
        found |= {factor.__name__} if (ours != theirs).any() else set()
    for k, parameter in enumerate(layout.parameters):
        found |= {parameter.__name__} if (levels.parameters[:, k] != twin.levels.parameters[:, k]).any() else set()
    return found


def unlike(twin, levels):
    """Whether a twin is another level than its own, bool ``(n,)``."""
    same = [(np.nan_to_num(getattr(levels, name)) == np.nan_to_num(getattr(twin.levels, name))) for name in
            ("types", "values", "parameters", "shape_kind")]  # fmt: skip
    return ~np.all([one.reshape(len(levels), -1).all(axis=1) for one in same], axis=0)


def test_groups_are_what_differs_and_controls_that_do_not(made):
    assert [(one.group, one.differs) for one in made.groups] == [
        ("Mass", True), ("Gravity", True), (ALL_THAT_DIFFERS, True), (PLACE, False), (KINDS, False), (OTHERS, False),
    ]  # fmt: skip
    assert made.differing == ("Mass", "Gravity", ALL_THAT_DIFFERS) and made.note == ""
    assert made["Mass"].says == "the factor Mass" and made["Gravity"].says == "the world parameter Gravity"


def test_a_twin_differs_from_its_level_in_its_group_only(made):
    of_group = {
        "Mass": {"Mass"}, "Gravity": {"Gravity"}, ALL_THAT_DIFFERS: {"Mass", "Gravity"}, PLACE: {"Position"},
        OTHERS: {"Size", "Charge", "Magnetism", "StoredEnergy"},
    }  # fmt: skip
    for one in made.groups:
        levels = made.test_levels
        if one.group in of_group:
            assert changed_columns(one, levels) <= of_group[one.group], one.group
            assert (one.levels.types == levels.types).all()
        assert (unlike(one, levels) == one.found).all(), one.group
        assert one.levels.world is levels.world and len(one.levels) == LEVELS


def test_entities_come_and_go_and_what_stays_is_as_it_was(made):
    one, levels = made[KINDS], made.test_levels
    stayed = one.levels.types == levels.types
    ours, theirs = (np.nan_to_num(each.values)[stayed] for each in (levels, one.levels))
    assert (ours == theirs).all() and (~stayed).any(axis=1)[one.found].all()
    x = levels.layout.columns[Position]
    replaced = (~stayed) & (levels.types >= 0) & (one.levels.types >= 0)
    assert (levels.values[replaced, x : x + 2] == one.levels.values[replaced, x : x + 2]).all()


def test_what_is_set_is_as_in_training(made):
    column = made.test_levels.layout.columns[Mass]
    ball = made["Mass"].levels.values[made["Mass"].found, 0, column]
    assert (ball >= 0.3).all() and (ball <= 1.0).all()
    assert (made.test_levels.values[:, 0, column] >= 2.0).all()
    gravity = made["Gravity"].levels
    assert (gravity.parameters[:, gravity.layout.parameters.index(Gravity)] == Gravity.default).all()


def test_twins_are_solved_by_plans_that_replay(made):
    for one in made.groups:
        assert (made.replayed(one.group) | ~one.found).all() and one.found.mean() > 0.5
        assert one.plans.solved[one.found].all()


def test_twins_follow_from_suite_and_seed_and_fewer_are_the_first_of_more(heavy, made):
    again = twins(heavy, n=5, groups=["Mass", PLACE])
    assert [one.group for one in again.groups] == ["Mass", PLACE]
    for one in again.groups:
        assert hash_of_levels(one.levels) == hash_of_levels(made[one.group].levels[:5])
    assert twins(heavy, n=5, groups=["Mass"]).hash == twins(heavy, n=5, groups=["Mass"]).hash
    assert twins(heavy, seed=1, n=5, groups=["Mass"]).hash != twins(heavy, n=5, groups=["Mass"]).hash


class FailsWhere:
    """Plays the stored plans, but does nothing on levels for which a condition holds."""

    def __init__(self, made, condition):
        sets = [(made.test_levels, made.suite.plans)]
        sets += [(one.levels[np.flatnonzero(one.found)], self._rows(one)) for one in made.groups]
        self.known = {}
        for levels, plans in sets:
            fails = condition(levels)
            for i in range(len(levels)):
                key = levels.values[i].tobytes() + levels.parameters[i].tobytes()
                self.known[key] = np.zeros_like(plans.actions[i]) if fails[i] else plans.actions[i]

    @staticmethod
    def _rows(one):
        return dataclasses.replace(one.plans, actions=one.plans.actions[one.found])

    def begin(self, env):
        levels, self.time = env.levels, -1
        rows = range(env.num_envs)  # one episode on each level, in order
        self.actions = np.stack([self.known[levels.values[i].tobytes() + levels.parameters[i].tobytes()] for i in rows])

    def __call__(self, observations):
        self.time += 1
        return self.actions[:, min(self.time, self.actions.shape[1] - 1)]


def heavier_than(limit):
    return lambda levels: levels.values[:, 0, levels.layout.columns[Mass]] > limit


def test_a_policy_that_fails_where_the_mass_is_large_is_attributed_to_mass_and_to_nothing_else(made):
    found = find_causes(FailsWhere(made, heavier_than(1.5)), made)
    assert found.on_levels.mean() == 0
    for cause in found.causes():
        if cause.group in ("Mass", ALL_THAT_DIFFERS):
            assert cause.attributed.value == 1 == cause.effect.value
        else:
            assert cause.attributed.value == 0 == cause.effect.value
    assert "Mass" in str(found) and len(found.rows()) == len(made.groups)


def test_a_policy_that_never_fails_has_no_causes(made, tmp_path):
    found = find_causes(FailsWhere(made, lambda levels: np.zeros(len(levels), np.bool_)), made)
    for cause in found.causes():
        assert cause.failures == 0 == cause.effect.value and np.isnan(cause.attributed.value)
    found.save(tmp_path / "causes.csv")
    assert list(pd.read_csv(tmp_path / "causes.csv")["group"]) == [one.group for one in made.groups]


def test_a_suite_without_any_twin_says_why(made):
    """As where the results of a task do not say what success is, so that no planner solves anything."""
    none = tuple(dataclasses.replace(one, found=np.zeros_like(one.found)) for one in made.groups)
    without = dataclasses.replace(made, groups=none)
    assert "no level of" in without.note and "the task says of none 'success'" in without.note
    assert without.note in str(find_causes(FailsWhere(made, lambda levels: np.ones(len(levels), np.bool_)), without))


def test_a_suite_in_which_nothing_differs_says_so(tmp_path):
    options = {**EASY, "test_levels": 3, "options": {"max_steps": 50}, "samples": 16, "iterations": 2}
    same = freeze(tmp_path / "place-few-v9.toml", train=HARD, test=HARD, **{**options, "axis": "place"})
    found = twins(same)
    assert found.differing == () and not any(one.differs for one in found.groups)
    assert "have one distribution: no factor differs, and all twins are controls" in found.note
    still = find_causes(lambda seen: np.zeros((len(seen), 2), np.float32), found)
    assert found.note in str(still)


def test_rules_and_textures_have_twins(tmp_path):
    options = {**EASY, "test_levels": 3, "options": {"max_steps": 50}, "samples": 16, "iterations": 2}
    bare = HARD.with_rules([rule for rule in DEFAULT_RULES if rule not in (apply_friction, record_drag)])
    path, look = (
        tmp_path / "rules-own-v1.toml",
        {"rules": ("without friction", "default"), "textures": ("baseline", "far")},
    )
    both = freeze(path, train=bare, test=HARD, **{**options, **look, "axis": "rules"})
    found = twins(both, groups=[RULES_GROUP, LOOK, PLACE])
    assert found.differing == (RULES_GROUP, LOOK)
    assert found[RULES_GROUP].levels.world is both.train.world and found[LOOK].textures == "baseline"
    assert changed_columns(found[RULES_GROUP], found.test_levels) == set() and found[PLACE].textures == "far"
    seen = find_causes(lambda frames: np.zeros((len(frames), 2), np.float32), found)
    assert set(seen.on_twins) == {RULES_GROUP, LOOK, PLACE}
    with pytest.raises(SuiteError, match=r"shows the set of textures baseline in training"):
        find_causes(lambda frames: np.zeros((len(frames), 2), np.float32), found, observation="state")


def test_unknown_groups_and_numbers_are_told(heavy, made):
    with pytest.raises(SuiteError, match=r"has no twins in 'Mas'. Did you mean 'Mass'"):
        twins(heavy, groups=["Mas"])
    with pytest.raises(SuiteError, match=r"n must be 1 to 12, the number of test levels, not 0"):
        twins(heavy, n=0)
    with pytest.raises(SuiteError, match=r"has no twins in 'plaice'. Did you mean 'place'"):
        made["plaice"]
    with pytest.raises(LevelError, match=r"have different slots"):
        set_as(made.test_levels, segar.family("empty-hard").sample(LEVELS), ["Mass"], 0.1)


@pytest.mark.parametrize("name", ["kind-swapped-v1", "rules-rules-v1", "world-gravity-v1", "number-more-v1"])
def test_mechanisms_of_training_put_into_the_test_make_the_training_distribution(name):
    one = suite(name)
    of_train, of_test = mechanisms(one.train), mechanisms(one.test)
    differing = [key for key in of_test if of_test[key] != of_train[key]]
    assert len(differing) == 1
    assert mechanisms(with_mechanisms(one.test, one.train, differing)) == of_train
    assert mechanisms(with_mechanisms(one.test, one.train, [])) == of_test


@pytest.mark.slow
@pytest.mark.parametrize("name", suites())
def test_suites_have_twins_of_nearly_all_levels(name):
    found = twins(suite(name))
    for one in found.groups:
        assert (found.replayed(one.group) | ~one.found).all()
        assert one.found.mean() > (0.9 if one.differs else 0.5)


def test_the_profile_of_causes_is_drawn(made, tmp_path):
    rows = pd.DataFrame(find_causes(FailsWhere(made, heavier_than(1.5)), made).rows())
    causes_plot(rows, tmp_path / "causes.png")
    assert (tmp_path / "causes.png").stat().st_size > 1000
    twice = pd.concat([rows, rows.assign(effect=rows["effect"] * 0.5, attributed=rows["attributed"] * 0.5)])
    profile = profile_of_causes(twice)
    (mass,) = profile[profile.group == "Mass"].to_dict("records")
    assert mass["runs"] == 2 and mass["effect"] == 0.75
    assert (mass["effect_low"], mass["effect_high"]) == (-1, 1)
    assert (mass["attributed_low"], mass["attributed_high"]) == (0, 1)
    with pytest.raises(SegarError, match=r"figure must be one of effect, attributed"):
        causes_plot(rows, figure="cause")
    with pytest.raises(SegarError, match=r"ends in none of"):
        causes_plot(rows, tmp_path / "causes.jpg")
    with pytest.raises(SegarError, match=r"there is no causes.csv below"):
        read_causes(tmp_path)


class Tired:
    """Goes to the pier where the current is weak, and does nothing elsewhere."""

    def begin(self, env):
        self.env = env

    def __call__(self, seen):
        is_weak = seen[:, -1:] < 1
        return self.env.task.scripted_actions(self.env.factors) * is_weak


def test_failures_in_a_world_of_ones_own_come_from_what_its_test_changes():
    of = own_suite(raft.calm, raft.strong, raft.strong.sample(8, split="test"))
    made = twins(of)
    assert [(one.group, one.differs) for one in made.groups] == [
        ("CurrentStrength", True), (PLACE, False), (OTHERS, False),
    ]  # fmt: skip
    twin = made["CurrentStrength"]
    assert twin.found.all() and made.replayed("CurrentStrength").all()
    assert changed_columns(twin, made.test_levels) == {"CurrentStrength"}
    at = [one.__name__ for one in twin.levels.layout.parameters].index("CurrentStrength")
    assert (twin.levels.parameters[:, at] < 0.2).all() and (made.test_levels.parameters[:, at] > 6).all()
    seen = segar.observations.StateVector(parameters=[raft.CurrentStrength])
    cause, control, _ = find_causes(Tired(), made, observation=seen).causes()
    assert cause.success_twin == 1 and cause.success_twin - cause.success_level == cause.effect.value > 0
    assert abs(control.effect.value) < cause.effect.value


def test_distributions_of_which_nobody_can_say_what_differs_are_refused():
    with pytest.raises(SuiteError, match="own: test must be a LevelDistribution, not"):
        own_suite(raft.calm, raft.strong.sample(2), raft.strong.sample(2))
