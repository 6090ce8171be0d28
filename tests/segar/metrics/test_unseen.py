"""Distances say in what level sets differ that they do not see, once and by name, and are silent elsewhere."""

import itertools
import json
import warnings

import numpy as np
import pytest

import segar
from segar import Ball, GoalTile, GolfBall, Gravity, Mass, Position, Prior
from segar.cli import main
from segar.errors import UnseenDifferenceWarning
from segar.language import Density, Drag, Order, SandTile, Tile, Visible
from segar.metrics import decompose, spread, unseen_differences, w2, w2_report
from segar.rules import RuleSpace
from segar.rules.templates import dynamics_space

RNG = np.random.default_rng


class Blow(segar.Parameter, default=0.0, unit="N"): ...


class Kite(Ball): ...


def make_wind(strength: float) -> segar.language.Rule:
    @segar.rule
    def wind(ball: GolfBall, blow: Blow) -> segar.Aggregate[segar.Acceleration]:
        return segar.Aggregate[segar.Acceleration](ball[segar.Acceleration], (strength * blow, 0.0))

    return wind


WIND = segar.World(rules=[*segar.DEFAULT_RULES, make_wind(1.0)])


def windy(
    low: float, high: float, world: segar.World | None = WIND, kind: type = Ball, **more
) -> segar.LevelDistribution:
    blow = low if low == high else segar.UniformNoise(low, high)
    return segar.LevelDistribution(
        numbers=[(GolfBall, 1), (GoalTile, 1), (kind, 1)],
        priors=[Prior(Position, segar.RandomUniformLocation()), *more.pop("priors", ())],
        parameters={Blow: blow},
        world=world,
    )


CALM, GALE = windy(0, 1).sample(10, seed=0), windy(3, 5).sample(20, seed=0, split="test")


@pytest.mark.parametrize("mode", ["reference", "paper"])
def test_a_mode_that_leaves_out_world_parameters_warns_once_and_names_them_with_their_ranges(mode):
    ranges = r"parameter Blow: 0\.\d+ to [01](\.\d+)? against 3\.?\d* to [45]"
    with pytest.warns(UnseenDifferenceWarning, match=ranges) as told:
        w2(CALM, GALE, mode)
    assert len(told) == 1 and "mode 'exact' sees it" in str(told[0].message)
    assert told[0].filename == __file__
    with pytest.warns(UnseenDifferenceWarning):
        report = w2_report(CALM, GALE, mode, rng=RNG(0), resamples=2)
    assert report.unseen == unseen_differences(CALM, GALE, mode) and len(report.unseen) == 1


def test_the_exact_mode_sees_parameters_and_is_silent():
    assert w2(CALM, GALE) > 1
    assert unseen_differences(CALM, GALE) == ()


@pytest.mark.parametrize("mode", ["exact", "reference", "paper"])
@pytest.mark.parametrize("n", [1, 10, 100])
def test_samples_of_one_distribution_and_of_equal_parameters_are_no_difference(mode, n):
    train, test = (windy(0, 1).sample(n, seed=1, split=split) for split in ("train", "test"))
    assert unseen_differences(train, test, mode) == ()
    heavier = windy(0, 1, priors=[Prior(Mass, 3.0)]).sample(100, seed=2)
    assert unseen_differences(train, heavier, mode) == ()


@pytest.mark.parametrize("mode", ["exact", "reference", "paper"])
def test_the_named_families_differ_in_nothing_that_a_mode_does_not_see(mode):
    sets = [segar.family(name).sample(10, seed=0) for name in ("empty-easy", "objectsx1-hard", "tilesx1-medium")]
    assert not any(unseen_differences(a, b, mode) for a, b in itertools.permutations(sets, 2))


def test_one_level_of_each_is_enough_where_the_distributions_differ_in_a_constant():
    a, b = (windy(x, x).sample(1, seed=0) for x in (0.0, 2.0))
    assert unseen_differences(a, b, "paper") == ("parameter Blow: 0 against 2; mode 'exact' sees it",)


def test_a_set_that_was_picked_by_a_parameter_differs_from_the_rest_of_its_distribution():
    levels = windy(0, 1).sample(100, seed=0)
    is_calm = levels.parameters[:, levels.layout.parameters.index(Blow)] < 0.5
    assert len(unseen_differences(levels[is_calm], levels[~is_calm], "reference")) == 1


def test_a_parameter_that_one_set_does_not_know_has_its_default_there():
    plain = segar.Levels.from_entities([[GolfBall()]])
    heavy = segar.Levels.from_entities([[GolfBall()]], {Gravity: 20.0, Blow: 0.0})
    assert unseen_differences(plain, heavy, "paper") == ("parameter Gravity: 10 against 20; mode 'exact' sees it",)


def test_levels_from_a_file_differ_by_the_distribution_that_they_were_saved_with(tmp_path):
    for name, levels in {"calm": CALM, "gale": GALE, "like": windy(0, 1).sample(30, seed=5)}.items():
        levels.save(tmp_path / name)
    calm, gale, like = (segar.Levels.load(tmp_path / name) for name in ("calm", "gale", "like"))
    assert len(unseen_differences(calm, gale, "reference")) == 1
    assert unseen_differences(calm, like, "reference") == ()


def measures(a, b):
    """All distances, each called once."""
    m = segar.metrics
    return {
        "w2": lambda: m.w2(a, b),
        "w2_report": lambda: m.w2_report(a, b, rng=RNG(0), resamples=2),
        "w2_debiased": lambda: m.w2_debiased(a, b, rng=RNG(0), repeats=2),
        "decompose": lambda: m.decompose(a, b),
        "cost_matrix": lambda: m.cost_matrix(a, b),
        "w2_sliced": lambda: m.w2_sliced(a, b, rng=RNG(0)),
        "mmd_test": lambda: m.mmd_test(a, b, rng=RNG(0), resamples=19),
        "ks": lambda: m.ks(a, b),
        "ks_by_factor": lambda: m.ks_by_factor(a, b),
        "ks_report": lambda: m.ks_report(a, b, rng=RNG(0), resamples=19),
    }


@pytest.mark.parametrize("name", list(measures(CALM, CALM)))
def test_no_distance_sees_rules_and_each_says_so_once(name):
    without = windy(0, 1, world=None).sample(20, seed=0, split="test")
    with pytest.warns(UnseenDifferenceWarning) as told:
        found = measures(CALM, without)[name]()
    (warning,) = told
    assert str(warning.message).startswith(f"{name} does not see") and "wind (test_unseen.py:" in str(warning.message)
    assert "only in the first set; no distance sees them" in str(warning.message)
    if not isinstance(found, float | dict | np.ndarray):
        assert found.unseen == unseen_differences(CALM, without) and len(found.unseen) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        same = measures(CALM, windy(0, 1).sample(20, seed=0, split="test"))[name]()
        assert isinstance(same, float | dict | np.ndarray) or same.unseen == ()


def test_rules_are_told_apart_by_their_numbers_and_not_by_where_they_were_made():
    again, stronger = (segar.World(rules=[*segar.DEFAULT_RULES, make_wind(s)]) for s in (1.0, 2.0))
    calm = CALM
    assert unseen_differences(calm, windy(0, 1, world=again).sample(5, seed=1)) == ()
    (text,) = unseen_differences(calm, windy(0, 1, world=stronger).sample(5, seed=1))
    assert text.startswith("rules: ") and "only in the first set and " in text


@pytest.mark.parametrize("other", [{"walls": 0.9}, {"pair_contact": None}, {"limit": None}])
def test_contacts_limits_and_walls_belong_to_the_rules(other):
    world = segar.World(rules=WIND.rules, **other)
    (text,) = unseen_differences(CALM, windy(0, 1, world=world).sample(5, seed=1))
    assert next(iter(other)) in text


def test_rules_of_levels_from_a_file_are_compared_by_name(tmp_path):
    CALM.save(tmp_path / "calm.npz")
    from_file = segar.Levels.load(tmp_path / "calm.npz")
    assert unseen_differences(from_file, CALM) == ()
    (text,) = unseen_differences(from_file, windy(0, 1, world=None).sample(5, seed=1))
    assert "wind" in text and "only in the first set" in text


def test_distributions_are_compared_too():
    with pytest.warns(UnseenDifferenceWarning, match="ks does not see"):
        segar.metrics.ks(windy(0, 1), windy(0, 1, world=None))


def test_a_type_of_the_users_own_that_the_reference_mode_takes_for_another_is_told():
    kites = windy(0, 1, kind=Kite).sample(10, seed=0)
    (text,) = unseen_differences(kites, CALM, "reference")
    assert text == "entity Kite: only in the first set; mode 'exact' tells it from others"
    assert unseen_differences(kites, CALM, "paper") == unseen_differences(kites, CALM) == ()


def test_the_exact_mode_does_not_see_what_is_invisible():
    hidden = windy(0, 1, priors=[Prior(Visible, False, entity_type=GolfBall)]).sample(10, seed=0)
    (text,) = unseen_differences(CALM, hidden)
    assert text == "factor Visible of GolfBall: 1 against 0; modes 'reference' and 'paper' see it"
    assert unseen_differences(CALM, hidden, "paper") == ()


def test_the_command_says_what_its_distance_does_not_see(tmp_path, capsys):
    for name, levels in {"a": CALM, "b": GALE}.items():
        levels.save(tmp_path / f"{name}.npz")
    files = [str(tmp_path / "a.npz"), str(tmp_path / "b.npz")]
    assert main(["distance", *files, "--mode", "paper"]) == 0
    assert "not seen by w2: parameter Blow: " in capsys.readouterr().out
    assert main(["distance", *files, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["unseen"] == []


def piled(sand: int, n: int = 3) -> segar.Levels:
    """A ball beside a sand tile of this Order and a tile of Order 1 at the same place, the middle."""
    return segar.Levels.from_entities(
        [[GolfBall({Position: (0.1 * k, 0.0)}), SandTile({Order: sand}), Tile({Order: 1})] for k in range(n)]
    )


def test_which_tile_lies_on_top_is_named_where_the_exact_mode_does_not_see_it():
    with pytest.warns(UnseenDifferenceWarning, match=r"Order: SandTile lies above Tile in 100% against 0%") as told:
        assert w2(piled(0), piled(2)) == 0
    assert len(told) == 1
    assert unseen_differences(piled(2), piled(5)) == (), "the numbers differ, and the pile does not"


@pytest.mark.parametrize("pair", [("tilesx1-easy", "tilesx3-easy"), ("hazardtilesx1-easy", "hazardtilesx3-hard")])
def test_tiles_in_random_order_are_no_difference_however_many(pair):
    a, b = (segar.family(name).sample(300, seed=0) for name in pair)
    assert unseen_differences(a, b) == ()


@pytest.mark.parametrize(
    ("factor", "here", "there"), [(Density, 1.0, 2.0), (segar.Acceleration, (0, 0), (0, 1)), (Drag, (0, 0), (0, 1))]
)
def test_all_that_the_exact_mode_leaves_out_is_named(factor, here, there):
    a, b = (segar.Levels.from_entities([[GolfBall({factor: value}), GoalTile()]]) for value in (here, there))
    with pytest.warns(UnseenDifferenceWarning, match=f"factor {factor.__name__} of GolfBall: "):
        assert w2(a, b) == 0
    assert unseen_differences(a, a) == ()


def test_what_differs_and_has_no_spread_in_the_given_scale_is_named():
    light, heavy = (segar.Levels.from_entities([[GolfBall({Mass: m}), GoalTile()]], {Gravity: m}) for m in (1.0, 2.0))
    unit = {**spread(light, heavy), (GolfBall, Mass): 0.0}
    unit.pop((segar.Parameter, Gravity))
    with pytest.warns(UnseenDifferenceWarning) as told:
        assert w2(light, heavy, scale=unit) == 0
    assert "factor Mass of GolfBall: 1 against 2; it has no spread in the given scale" in str(told[0].message)
    assert "parameter Gravity: 1 against 2; it has no spread" in str(told[0].message)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        w2(light, heavy, scale=spread(light, heavy))
        w2(light, heavy, scale=unit, factors=[Position])  # who chooses the factors is told nothing
        w2(CALM, windy(0, 1, world=None).sample(5, seed=1), factors=[Position])


def test_a_distance_stops_growing_where_two_entities_are_not_matched_any_more():
    at, unit = (lambda q: segar.Levels.from_entities([[Ball({segar.Charge: q})]])), {(Ball, segar.Charge): 1.0}
    assert w2(at(0), at(4.8), scale=unit) == pytest.approx(4.8)
    assert w2(at(0), at(6), scale=unit) == w2(at(0), at(100), scale=unit) == pytest.approx(24**0.5)
    assert decompose(at(0), at(6), scale=unit).by_factor["unmatched"] == pytest.approx(24)


def ruled(part: RuleSpace, seed: int = 0) -> segar.Levels:
    return segar.family("empty-hard").with_rules(part).sample(40, seed=seed)


def test_sets_whose_rule_sets_have_different_distributions_are_told_which_share_they_have_in_common():
    space = dynamics_space()
    train, test = (ruled(space.split(part)) for part in ("train", "test"))
    text = (
        r"rule sets: 0% of the second set's occur in the first, 0% but for their constants; their parameters count as numbers,"
        r" and segar.metrics.dynamics_w2 compares what they do"
    )
    with pytest.warns(UnseenDifferenceWarning, match=text):
        w2(train, test)
    with pytest.warns(UnseenDifferenceWarning, match=text):
        segar.metrics.ks(train, test)
    (told,) = unseen_differences(train, test, "paper")
    assert told.endswith(
        "mode 'exact' takes their parameters as numbers, and segar.metrics.dynamics_w2 compares what they do"
    )
    (told,) = unseen_differences(train, ruled(space))
    shared = len(segar.levels.shared_rule_sets(ruled(space), train)) / 40
    assert f"rule sets: {shared:.0%} of the second set's" in told


@pytest.mark.parametrize("mode", ["exact", "paper"])
def test_two_samples_of_one_rule_space_are_not_told_apart(mode):
    space = dynamics_space()
    assert unseen_differences(ruled(space), ruled(space, 1), mode) == ()
    assert unseen_differences(ruled(space), ruled(dynamics_space(), 1), mode) == ()
    assert unseen_differences(ruled(space.split("test")), ruled(space.split("test"), 1), mode) == ()


def test_levels_made_by_hand_are_told_apart_by_their_parameters():
    space = dynamics_space()
    slope, spring = (next(o.active for o in space.options if o.name == name) for name in ("slope", "anchor"))
    entities = [[GolfBall({Position: [0.0, 0.0]}), GoalTile({Position: [0.5, 0.5]})]] * 12
    one, other = (segar.Levels.from_entities(entities, {p: 1.0}, segar.World(space)) for p in (slope, spring))
    (told,) = unseen_differences(one, other)
    assert "rule sets: 0% of the second set's occur in the first, 0% but for" in told
    assert unseen_differences(one, one[:6]) == ()
