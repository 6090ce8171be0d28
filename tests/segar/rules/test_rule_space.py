"""Rule spaces as distributions: samples against probabilities, entropy, splits, files, and what is refused."""

import dataclasses
import pickle
from itertools import combinations
from math import comb

import numpy as np
import pytest
import scipy

import segar
from segar.errors import ConflictError, FactorError, LevelError, PriorError, RuleError
from segar.language import Charge, Differential, Magnetism, Mass, Position, SetFactor, Velocity, Visible, rule
from segar.levels import Levels, active_options, family, rules_in_words, shared_rule_sets
from segar.noise import Bernoulli, Choice, DiscreteRangeNoise, GaussianNoise, LogUniform, UniformNoise
from segar.rules import RuleOption, RuleSpace, World, constant
from segar.rules.rule_option import same_options
from segar.rules.templates import central_force, dynamics_space, hiding, law_space, portal, sharing, uniform_field

PUSH = constant("push_of_tests", 0.0, "m/s^2")
PULL = constant("pull_of_tests", 1.0, "1/s", (0.0, 10.0))
EMPTY = family("empty-hard")


@rule
def push(v: Velocity, strength: PUSH) -> Differential[Velocity]:  # pyright: ignore[reportInvalidTypeForm]
    """Pushes along x."""
    return Differential[Velocity](v, (strength, 0.0 * strength))


@rule
def pull(x: Position, v: Velocity, strength: PULL) -> Differential[Velocity]:  # pyright: ignore[reportInvalidTypeForm]
    """Pulls to the middle."""
    return Differential[Velocity](v, -x * strength)


@rule
def fade(visible: Visible) -> SetFactor[Visible]:
    """Nothing can be seen."""
    return SetFactor[Visible](visible, 0.0)


@rule
def shine(visible: Visible) -> SetFactor[Visible]:
    """All can be seen."""
    return SetFactor[Visible](visible, 1.0)


def small_space(**options) -> RuleSpace:
    """Three options, one or two of them active; constants with a density, with atoms, and none."""
    return RuleSpace(
        [
            RuleOption("push", push, {PUSH: UniformNoise(-1, 3)}, weight=2.0),
            RuleOption("pull", pull, {PULL: Choice([0.5, 2.0, 4.0])}),
            fade,
        ],
        **{"active": DiscreteRangeNoise(1, 2), **options},
    )


def test_combinations_have_the_probabilities_that_counts_and_weights_say():
    table = small_space().combinations
    found = {table.in_words(k): p for k, p in enumerate(table.probability)}
    expected = {
        "push": 1 / 4,
        "pull": 1 / 8,
        "fade": 1 / 8,
        "push, pull": 1 / 5,
        "push, fade": 1 / 5,
        "pull, fade": 1 / 10,
    }
    assert found == pytest.approx(expected)


@pytest.mark.parametrize("options", [5, 12])
def test_there_are_as_many_combinations_as_there_are_subsets(options):
    space = RuleSpace([uniform_field(f"field{k}") for k in range(options)], DiscreteRangeNoise(0, 4))
    assert len(space.combinations) == sum(comb(options, k) for k in range(5))
    assert space.combinations.probability.sum() == pytest.approx(1)


def test_samples_have_the_frequencies_and_distributions_of_the_space():
    space, n = small_space(), 20_000
    levels = EMPTY.with_rules(space).sample(n, seed=3)
    active = active_options(levels)
    keys = [tuple(row) for row in space.combinations.active.tolist()]
    counts = np.array([(active == key).all(axis=1).sum() for key in keys])
    assert counts.sum() == n
    assert scipy.stats.chisquare(counts, space.combinations.probability * n).pvalue > 1e-3
    column = levels.layout.parameters.index
    for parameter, law in space.laws.items():
        owner = next(k for k, option in enumerate(space.options) if parameter in option.constants)
        values = levels.parameters[:, column(parameter)]
        assert (values[~active[:, owner]] == parameter.default).all()
        drawn = values[active[:, owner]]
        if parameter is PUSH:
            assert scipy.stats.kstest(drawn, law.cdf).pvalue > 1e-3
        else:
            seen = [int((drawn == value).sum()) for value in law.atoms[0]]
            assert scipy.stats.chisquare(seen).pvalue > 1e-3


def test_entropy_is_the_mean_of_minus_log_prob():
    distribution = EMPTY.with_rules(small_space())
    levels = distribution.sample(20_000, seed=1)
    rest = EMPTY.log_prob(EMPTY.sample(20_000, seed=1), normalised=False)
    of_rules = distribution.log_prob(levels, normalised=False) - rest
    space = distribution.rule_space
    assert space is not None
    error = of_rules.std() / np.sqrt(len(of_rules))
    assert -of_rules.mean() == pytest.approx(space.entropy(), abs=4 * error)
    assert distribution.entropy(draws=500).value == pytest.approx(
        EMPTY.entropy(draws=500).value + space.entropy(), abs=1e-9
    )


def test_log_prob_is_minus_infinity_for_what_cannot_be_drawn():
    distribution = EMPTY.with_rules(small_space(exclusive=[("push", "pull")]))
    levels = distribution.sample(50)
    space, column = distribution.rule_space, levels.layout.parameters.index
    assert space is not None and np.isfinite(distribution.log_prob(levels, normalised=False)).all()
    changes = {
        "both of an exclusive pair": [(space.options[0].active, 1.0), (space.options[1].active, 1.0)],
        "none active": [(option.active, 0.0) for option in space.options],
        "neither on nor off": [(space.options[0].active, 0.5)],
        "a constant of an idle option": [(space.options[0].active, 0.0), (PUSH, 0.7)],
        "a constant that its distribution does not give": [(space.options[1].active, 1.0), (PULL, 1.0)],
    }
    for change in changes.values():
        parameters = levels.parameters.copy()
        for parameter, value in change:
            parameters[:, column(parameter)] = value
        other = Levels(**{**vars(levels), "parameters": parameters})
        assert (distribution.log_prob(other, normalised=False) == -np.inf).all(), change


def test_marginals_are_those_of_samples():
    distribution = EMPTY.with_rules(small_space())
    levels, laws = distribution.sample(20_000, seed=5), distribution.marginals()["parameters"]
    for parameter, law in laws.items():
        values = levels.parameters[:, levels.layout.parameters.index(parameter)]
        assert values.mean() == pytest.approx(law.mean, abs=5 * np.sqrt(law.var / len(values)) + 1e-12)
    assert isinstance(laws[small_space().options[0].active], Bernoulli)


def test_all_that_the_space_does_not_draw_stays_as_it_is():
    plain, levels = EMPTY.sample(100, seed=9), EMPTY.with_rules(small_space()).sample(100, seed=9)
    assert plain.values.tobytes() == levels.values.tobytes() and plain.vertices.tobytes() == levels.vertices.tobytes()
    known = [levels.layout.parameters.index(p) for p in plain.layout.parameters]
    assert (plain.parameters == levels.parameters[:, known]).all()


def test_a_level_does_not_depend_on_how_many_are_drawn():
    distribution = EMPTY.with_rules(dynamics_space())
    many = distribution.sample(200, seed=4)
    assert distribution.sample(7, seed=4) == many[:7]


@pytest.mark.parametrize("name", ["levels.npz", "levels.json"])
def test_files_and_pickles_hold_rule_sets_to_the_bit(tmp_path, name):
    levels = EMPTY.with_rules(dynamics_space()).sample(30)
    levels.save(tmp_path / name)
    assert Levels.load(tmp_path / name, levels.world) == levels
    with pytest.raises(LevelError, match=r"must be a segar.World or None, not <rule space .*World\(...\) makes one of"):
        Levels.load(tmp_path / name, dynamics_space())  # type: ignore[arg-type]
    again = pickle.loads(pickle.dumps(levels))
    words = [rules_in_words(levels, index) for index in range(30)]
    assert again == levels and [rules_in_words(again, index) for index in range(30)] == words
    assert list(map(len, words)) == active_options(levels).sum(axis=1).tolist() and "{" not in str(words)


def test_the_hash_is_that_of_what_is_drawn():
    hashes = [
        EMPTY.hash,
        EMPTY.with_rules(small_space()).hash,
        EMPTY.with_rules(small_space(active=1)).hash,
        EMPTY.with_rules(small_space(exclusive=[("push", "fade")])).hash,
        EMPTY.with_rules(small_space().split("train")).hash,
        EMPTY.with_rules(small_space().split("test")).hash,
        EMPTY.with_rules(small_space().split("test", seed=1)).hash,
    ]
    assert len(set(hashes)) == len(hashes)
    assert EMPTY.with_rules(small_space()).hash == hashes[1]


@pytest.mark.parametrize(("by", "seed"), [("combinations", 0), ("rules", 1), ("constants", 2)])
def test_no_rule_set_of_the_test_is_in_training(by, seed):
    space = dynamics_space()
    parts = {part: EMPTY.with_rules(space.split(part, by, seed=seed)) for part in ("train", "test")}
    levels = {part: distribution.sample(2000, seed=seed) for part, distribution in parts.items()}
    assert len(shared_rule_sets(levels["train"], levels["test"])) == 0
    for part, other in (("train", "test"), ("test", "train")):
        assert np.isfinite(parts[part].log_prob(levels[part], normalised=False)).all()
        assert (parts[part].log_prob(levels[other], normalised=False) == -np.inf).all()
    assert parts["train"].layout == parts["test"].layout


def test_a_split_by_combinations_is_a_partition():
    space = dynamics_space()
    parts = [space.split(part, share=0.3) for part in ("train", "test")]
    rows = [{row.tobytes() for row in part.combinations.active} for part in parts]
    assert not rows[0] & rows[1] and len(rows[0] | rows[1]) == len(space.combinations)
    assert len(rows[1]) / len(space.combinations) == pytest.approx(0.3, abs=0.02)


def test_a_split_by_rules_keeps_the_options_of_the_test_out_of_training():
    space = dynamics_space()
    train, test = (space.split(part, by="rules", rules=["portal", "vortex"]) for part in ("train", "test"))
    held_out = [space.index("portal"), space.index("vortex")]
    assert not train.combinations.active[:, held_out].any()
    assert test.combinations.active[:, held_out].any(axis=1).all()


def test_options_that_do_the_same_cannot_be_split_apart():
    space = RuleSpace([portal("a"), portal("b"), portal("wide", radius=0.2), hiding("hidden")], 1)
    assert same_options(space.options) == [("a", "b")] and not same_options(dynamics_space().options)
    for by, rules in (("combinations", ()), ("rules", ["a"]), ("rules", ())):
        with pytest.raises(RuleError, match="the options a and b do the same under two names"):
            space.split("test", by, rules=rules)
    assert len(space.split("test", "rules", rules=["a", "b"]).combinations) == 2


def test_a_split_by_constants_cuts_every_distribution():
    space = RuleSpace(
        [RuleOption("push", push, {PUSH: UniformNoise(0, 10)}), RuleOption("pull", pull, {PULL: LogUniform(0.1, 10)})],
        2,
    )
    train, test = (space.split(part, "constants", share=0.25) for part in ("train", "test"))
    assert train.laws[PUSH].support == (0, 7.5) and test.laws[PUSH].support[0] > 7.5
    assert train.laws[PULL].support[1] < test.laws[PULL].support[0]
    assert space.laws[PULL].cdf(train.laws[PULL].support[1]) == pytest.approx(0.75)


def test_shared_rule_sets_are_found():
    levels = EMPTY.with_rules(small_space()).sample(40, seed=2)
    pairs = shared_rule_sets(levels, levels[[7, 3]])
    assert {7: 0, 3: 1}.items() <= dict(pairs.tolist()).items()


def test_levels_by_hand_choose_their_rules():
    space = small_space()
    option = space.options[0]
    levels = Levels.from_entities(
        [[segar.GolfBall()], [segar.GolfBall()]], {option.active: [1, 0], PUSH: [0.5, 0.0]}, world=World(space)
    )
    assert active_options(levels)[:, 0].tolist() == [True, False]
    with pytest.raises(LevelError, match=r"push_active must be one number, or a list of 1.*; each 0 or 1; not"):
        Levels.from_entities([[segar.GolfBall()]], {option.active: 0.5}, world=World(space))


def test_explanations_name_the_rule_space():
    distribution = EMPTY.with_rules(small_space())
    assert "drawn by the rule space" in str(distribution.explain(None, PULL))


def test_rules_that_always_conflict_are_found_for_all_pairs_that_meet():
    together = EMPTY.with_rules(RuleSpace([fade, shine], 2)).sample(1)
    with pytest.raises(ConflictError, match=r"fade .* and shine .* both always set Visible"):
        segar.envs.VectorEnv(together, 1)
    segar.envs.VectorEnv(EMPTY.with_rules(RuleSpace([fade, shine], 1)).sample(1), 1)
    pairs = [RuleOption("hidden", fade), RuleOption("shown", shine), portal("a"), portal("b")]
    excluded = RuleSpace(pairs, 2, exclusive=[("hidden", "shown")])
    segar.envs.VectorEnv(EMPTY.with_rules(excluded).sample(1), 1)


def test_a_world_keeps_its_space_when_another_field_is_replaced():
    world = World(RuleSpace([sharing("sharing", Charge), push], 1))
    wider = dataclasses.replace(world, walls=2.0)
    assert wider.space is world.space and wider.on_contact == world.on_contact
    plain = dataclasses.replace(world, rules=[push])
    assert plain.space is None and plain.on_contact == ()


class Sourness(segar.Scalar, default=0.0): ...


BAD = {
    RuleError: [
        (lambda: RuleSpace([]), "needs options"),
        (lambda: RuleSpace([push, push]), "two options of the rule space are called 'push'"),
        (lambda: RuleSpace([push], 2), "2 options cannot be active: the rule space has 1"),
        (lambda: RuleSpace([push, fade], 2, exclusive=[("push", "fade")]), "no 2 of the 2 options"),
        (lambda: RuleSpace([push], True), "active must be a whole number"),
        (lambda: RuleSpace([push], UniformNoise(0, 1)), "distribution of whole numbers"),
        (lambda: RuleSpace([push], 1, exclusive=[("pusch", "push")]), "no option 'pusch'. Did you mean 'push'"),
        (lambda: RuleOption("empty"), "has no rule"),
        (lambda: RuleOption(rules=[push, pull]), r"2 rules \(push, pull\) needs a name"),
        (lambda: RuleOption("no name", push), "needs a name such as"),
        (lambda: RuleOption("push", push, weight=0), "weight must be a positive number"),
        (lambda: RuleOption("push", push, {PULL: 1.0}), "none of its rules takes pull_of_tests"),
        (lambda: RuleOption("push", push, {Mass: 1.0}), "not a world parameter class"),
        (
            lambda: RuleSpace([RuleOption("a", push, {PUSH: 1}), RuleOption("b", push, {PUSH: 1})], 2),
            "constant of the options 'a' and 'b'",
        ),
        (lambda: RuleSpace([uniform_field(f"f{k}") for k in range(40)], 8), "combinations, and can have"),
        (lambda: RuleSpace([push], 1, exclusive=["push"]), "must list groups of two or more names"),
        (lambda: RuleSpace([push], 1, always=fade), "a list is needed, not <rule fade"),
        (lambda: RuleSpace(["push"], 1), "'push' is not a plain Python function"),
        (lambda: RuleSpace([fade], 1, always=[fade]), r"in always= and in the option 'fade', so .* count twice"),
        (
            lambda: RuleSpace([RuleOption("one", fade), RuleOption("two", [push, fade])], 2),
            "in the option 'one' and in the option 'two', so its effects would count twice where both hold",
        ),
        (lambda: RuleOption("push", push, [PUSH]), "constants must be a mapping"),
        (lambda: RuleOption("push", push, {PUSH: 1}, words="{push}"), "words name {push}, which is no constant"),
        (lambda: RuleOption("push", push, words="a push {"), "words must be a text"),
        (lambda: RuleOption("push", push, words=3), "words must be a text"),
        (lambda: RuleOption("push", push, {PUSH: 1}, words="{push_of_tests:.2f}"), "words must be a text"),
        (lambda: World({push, fade}), "rules must be a sequence of rules, or a RuleSpace, not {"),
        (lambda: World(None), "rules must be a sequence of rules, or a RuleSpace, not None"),
        (lambda: EMPTY.with_rules(RuleOption("push", push)), "must be a sequence of rules, or a RuleSpace"),
        (lambda: EMPTY.with_rules([RuleOption("push", push)]), r"options belong to a RuleSpace\(\[...\]\)"),
        (lambda: small_space().split("train", seed=1.0), "seed must be a whole number, not 1.0"),
        (
            lambda: small_space().split("train", "rules", rules=["push", "pull", "fade"]),
            "leaves nothing for training of 6 combinations; name fewer rules",
        ),
        (lambda: small_space().split("validation"), "must be 'train' or 'test'"),
        (lambda: small_space().split("train", "rule"), "no by='rule'. Did you mean 'rules'"),
        (lambda: small_space().split("train", share=1.5), "between 0 and 1"),
        (lambda: RuleSpace([fade], 1).split("test"), "leaves nothing for training of 1 combinations"),
        (lambda: small_space().split("train", rules=["push"]), "rules= names the options of a split"),
        (lambda: RuleSpace([fade], 1).split("test", "constants"), "no option has a constant of more than one"),
        (
            lambda: RuleSpace([RuleOption("push", push, {PUSH: GaussianNoise(0, 1)})], 1).split("test", "constants"),
            "cannot be cut",
        ),
        (
            lambda: EMPTY.with_rules(RuleSpace([central_force("sour", Sourness, Mass)], 1)),
            "option 'sour' .* needs an entity with Position, Sourness",
        ),
        (lambda: central_force("wrong", Position, Mass), "takes factors that are numbers"),
        (lambda: push.where_active(PUSH).where_active(PULL), "holds only where push_of_tests is not 0"),
        (lambda: World(limit=segar.rules.speed_limit.where_active(PUSH)), "limit holds in every level"),
    ],
    FactorError: [
        (lambda: segar.ThingFactory({segar.Ball, segar.GolfBall}), "ThingFactory needs a list"),
        (lambda: RuleOption("pull", pull, {PULL: 11.0}), "is 11.0, and must be .* from 0 to 10"),
        (lambda: RuleOption("pull", pull, {PULL: UniformNoise(5, 20)}), "from 5 to 20; it must be"),
    ],
    PriorError: [
        (
            lambda: segar.LevelDistribution(
                [(segar.GolfBall, 1)], [segar.Prior(PUSH, 1.0)], world=World(small_space())
            ),
            "push_of_tests is drawn by the rule space",
        ),
    ],
    LevelError: [
        (lambda: rules_in_words(EMPTY.sample(1), 0), "have one world for all"),
    ],
}


@pytest.mark.parametrize(
    ("make", "error", "said"), [(make, error, said) for error, rows in BAD.items() for make, said in rows]
)
def test_bad_input_is_told(make, error, said):
    with pytest.raises(error, match=said):
        make()


def test_a_rule_may_be_in_two_options_that_exclude_each_other():
    pair = [RuleOption("one", fade), RuleOption("two", [push, fade])]
    assert len(RuleSpace(pair, 1).combinations) == 2
    assert len(RuleSpace([*pair, pull], 2, exclusive=[("one", "two")]).combinations) == 2


def test_every_two_options_of_the_built_in_space_meet_unless_they_exclude_each_other():
    space = dynamics_space()
    apart = {frozenset(space.names[k] for k in group) for group in space.exclusive}
    meet = space.combinations.together
    found = {frozenset((a, b)) for a, b in combinations(space.names, 2) if not meet[space.index(a), space.index(b)]}
    assert found == apart


def test_laws_to_be_found_are_none_that_training_has():
    known, space = dynamics_space(), law_space()
    train, levels = known.split("train"), EMPTY.with_rules(space).sample(3000)
    active, shared = active_options(levels), len(known.options)
    is_old = ~active[:, shared:].any(axis=1)
    assert space.names[:shared] == known.names and 0 < is_old.sum() < 3000
    assert np.isinf(train.combinations.log_prob(active[is_old, :shared])).all()
    assert np.isfinite(EMPTY.with_rules(space).log_prob(levels, normalised=False)).all()
    for parameter, law in known.laws.items():
        assert space.laws[parameter].support == law.support
    with pytest.raises(RuleError, match="can draw all combinations"):
        train.unlike(known)


def test_templates_of_one_name_share_their_constants():
    one, other = (central_force("twin", Charge, Magnetism) for _ in range(2))
    assert one.active is other.active and one.constants.keys() == other.constants.keys()
    assert hiding("twin").active is one.active
