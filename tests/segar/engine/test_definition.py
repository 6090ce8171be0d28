"""Rules are read and traced where they are defined: what the tracer follows, and how it refuses the rest."""

from __future__ import annotations

import math
from typing import Tuple  # as the paper writes rules

import numpy as np
import pytest

import segar.language.random
from segar import Action, Aggregate, ConflictError, Differential, Interpreter, Levels, RuleError, SegarError, SetFactor
from segar.language import Acceleration, Friction, Leaf, Magnetism, Mass, Task, Wall, leaves_of, rule, value_rule, where
from segar.language.entities import Ball, Entity, GoalTile, GolfBall
from segar.language.factors import ID, Charge, Label, Mobile, Position, Scalar, Size, StoredEnergy, Velocity
from segar.language.parameters import Gravity, MaxVelocity, MinMass, Parameter
from segar.language.relations import is_equal, is_on, overlaps, relation
from segar.rules import World, accelerate, move
from tests.segar.engine.worlds import compare, compiled, random_states, start, uncompiled

LEVELS = Levels.from_entities([[GolfBall({Position: (0, 0)}), GoalTile({Position: (0.8, 0.8)}), Ball()]])


# --- what the tracer follows


def test_a_condition_that_is_asked_twice_forks_once():
    @rule
    def twice(m: Mass, q: Charge) -> Tuple[SetFactor[Mass], SetFactor[Charge]]:
        first = 1.0 if m > 1 else 2.0
        second = 3.0 if m > 1 else 4.0
        return SetFactor[Mass](m, first), SetFactor[Charge](q, second)

    assert len(leaves_of(twice.tree)) == 2


def test_and_or_and_not_fork_only_as_far_as_python_asks():
    @rule
    def lazy(m: Mass, q: Charge) -> SetFactor[Mass]:
        if (m > 1 and q > 1) or not m > 0.5:
            return SetFactor[Mass](m, 1.0)
        return None

    # m > 1: q > 1 decides, else m > 0.5 is asked; m <= 1: m > 0.5 is asked.
    assert len(leaves_of(lazy.tree)) == 5


def test_where_does_not_fork():
    @rule
    def soft(m: Mass) -> SetFactor[Mass]:
        return SetFactor[Mass](m, where(m > 1, 1.0, m))

    assert isinstance(soft.tree, Leaf)


def test_zero_in_one_branch_and_a_vector_in_the_other_add_up():
    @rule
    def push(v: Velocity, q: Charge, b: Magnetism, a: Acceleration) -> Aggregate[Acceleration]:
        electric = q * v if q else 0.0
        magnetic = b * v.tangent_vector() if b else 0.0
        return Aggregate[Acceleration](a, (electric + magnetic) / 2)

    simulator = uncompiled(World([push, accelerate, move]), LEVELS.layout)
    assert compare(simulator, LEVELS, random_states(LEVELS, 30, np.random.default_rng(0))).worst <= 1e-12


def test_sixty_four_paths_are_followed_and_sixty_five_are_not():
    def fork(times: int):
        def many(a: Mass, b: Charge, c: Magnetism, d: StoredEnergy, e: Size, f: Friction, g: Mobile) -> SetFactor[Mass]:
            count = 0
            for factor in (a, b, c, d, e, f, g)[:times]:
                if factor > 0:
                    count = count + 1
            return SetFactor[Mass](a, count)

        return many

    assert len(leaves_of(rule(fork(6)).tree)) == 64
    message = r"many \(test_definition.py:\d+\): more than 64 paths .* Split the rule, or use segar.language.where"
    with pytest.raises(RuleError, match=message):
        rule(fork(7))


def test_zero_times_infinity_stays_nan():
    @rule
    def silly(m: Mass, q: Charge) -> SetFactor[Mass]:
        return SetFactor[Mass](m, 0.0 * (1.0 / q))

    state = start(LEVELS)
    with pytest.raises(RuleError, match=r"is nan .changed by .*silly"):
        uncompiled(World([silly]), LEVELS.layout).step(state, LEVELS)
    column = LEVELS.layout.columns[Mass]
    assert np.isnan(state.values[0, 2, column]) and not np.isnan(state.values[0, 0, column])
    assert np.isnan(Interpreter(World([silly]), LEVELS.layout).step(LEVELS).values[2, column])


def test_a_rule_is_refused_when_a_variable_that_it_reads_has_changed_since():
    gain = 2.0

    @rule
    def grow(m: Mass) -> SetFactor[Mass]:
        return SetFactor[Mass](m, gain * m)

    world = World([grow])
    for engine in (uncompiled, Interpreter):
        gain = 2.0
        engine(world, LEVELS.layout)
        gain = 3.0
        with pytest.raises(
            RuleError, match=r"grow \(test_definition.py:\d+\): computes something else than when the rule was"
        ):
            engine(world, LEVELS.layout)


@pytest.mark.parametrize("charge", [-0.0, 0.0, -2.0])
def test_the_sign_of_a_zero_is_that_zero_in_the_interpreter_and_in_kernels(charge):
    @rule
    def signed(q: Charge, m: Mass) -> SetFactor[Mass]:
        return SetFactor[Mass](m, q.sign())

    levels = Levels.from_entities([[GolfBall({Charge: charge}), GoalTile()]])
    slow = Interpreter(World([signed]), levels.layout).step(levels).values
    for simulator in (uncompiled(World([signed]), levels.layout), compiled(World([signed]), levels.layout)):
        state = start(levels)
        simulator.step(state, levels)
        for values in (slow, state.values[0]):
            found = values[0, levels.layout.columns[Mass]]
            assert math.copysign(1.0, found) == math.copysign(1.0, charge) and abs(found) == min(abs(charge), 1.0)


# --- what it refuses, and in which words


UNTRACEABLE = [  # the first line of a rule on all of an object, and the complaint about it
    (
        "for part in v.norm():\n        pass",
        r"`for part in v.norm\(\):`\): TypeError: a factor's value is not iterable",
    ),
    ("x = pow(m, 2, 3)", r"`x = pow\(m, 2, 3\)`\): TypeError: .*takes 2 positional arguments"),
    ("while m > 1:\n        m = m / 2", "`while m > 1:`.*a rule cannot loop until a factor reaches a value"),
    ("x = math.sin(m)", r"`x = math.sin\(m\)`.*math.\* and numpy cannot use it"),
    ("x = np.clip(v, 0, 1)", r"`x = np.clip\(v, 0, 1\)`\): a rule cannot call numpy"),
    ("if v:\n        return None", r"`if v:`\): a vector is neither true nor false"),
    ("x = m == 'heavy'", "a factor cannot be combined or compared with 'heavy'"),
    ("x = v.unit()", "AttributeError: 'VectorValue' object has no attribute 'unit'"),
    (
        "return SetFactor[Mass](m * 2, 1.0)",
        "must be the factor that changes, as the rule received it .*which is computed",
    ),
    ("return SetFactor[Mass](label, 1.0)", "Label, a text, which no rule changes"),
    ("return SetFactor[Mass](m, v)", r"SetFactor\[Mass\] was given a vector for a scalar factor"),
    ("return SetFactor(m, 1.0)", r"SetFactor needs its factor: write SetFactor\[SomeFactor\]\(old, new\)"),
    ("x = where(~(q > 0), m, 1.0)", "a rule cannot use '~'; write 'not x', or 'x == 0'"),
    ("x = [*action]", r"take the numbers of an action by their index, e.g. action\[0\]"),
]


@pytest.mark.parametrize(("statement", "complaint"), UNTRACEABLE)
def test_what_cannot_be_traced_is_refused_at_the_author_s_line(tmp_path, statement, complaint):
    text = (
        "def mine(m: Mass, v: Velocity, q: Charge, label: Label, action: Action) -> SetFactor[Mass]:\n"
        f"    {statement}\n    return SetFactor[Mass](m, 1.0)\n"
    )
    (tmp_path / "mine.py").write_text(text)
    scope = {**globals(), "math": math}
    exec(compile(text, tmp_path / "mine.py", "exec"), scope)
    with pytest.raises(RuleError, match=complaint) as caught:
        rule(scope["mine"])
    assert str(caught.value).startswith("mine (mine.py:1) (line 2: ")


def no_hint(m) -> SetFactor[Mass]: ...
def no_return_hint(m: Mass): ...
def unknown_hint(m: Mas) -> SetFactor[Mass]: ...  # type: ignore[name-defined]  # noqa: F821
def unknown_return(m: Mass) -> SetFactor[Velocty]: ...  # type: ignore[name-defined]  # noqa: F821
def wrong_hint(m: int) -> SetFactor[Mass]: ...
def wrong_return_hint(m: Mass) -> float: ...
def not_held(m: Mass) -> SetFactor[Charge]: ...
def mixed(m: Mass, other: Tuple[Charge]) -> SetFactor[Mass]: ...
def variadic(*m: Mass) -> SetFactor[Mass]: ...
def not_a_factor_in_a_tuple(m: Tuple[Mass, float]) -> SetFactor[Mass]: ...
def acts_on_nothing(g: Gravity) -> SetFactor[Mass]: ...


def reads_what_a_ball_lacks(ball: Ball) -> SetFactor[Mass]:
    return SetFactor[Mass](ball[Mass], ball[Friction])


def returns_a_number(m: Mass) -> SetFactor[Mass]:
    return m * 2


def returns_something_else(m: Mass, q: Charge) -> SetFactor[Mass]:
    return SetFactor[Charge](q, 1.0)


def returns_another_kind(m: Mass) -> SetFactor[Mass]:
    return Differential[Mass](m, 1.0)


@pytest.mark.parametrize(
    ("function", "complaint"),
    [
        (no_hint, "argument 'm' has no type hint; hint a factor, e.g. m: Mass"),
        (no_return_hint, r"the return has no type hint; say what it changes, e.g. -> Aggregate\[Acceleration\]"),
        (unknown_hint, r"argument 'm': 'Mas' is not a factor. Did you mean 'Mass'\?"),
        (unknown_return, r"the return: 'Velocty' is not a factor. Did you mean 'Velocity'\?"),
        (wrong_hint, "argument 'm' has the hint int, which is not a factor, a Tuple of factors, an entity class"),
        (wrong_return_hint, r"returns float; a rule returns Aggregate\[...\], Differential\[...\], SetFactor\[...\]"),
        (not_held, r"returns SetFactor\[Charge\], but no argument holds Charge; take it as an argument"),
        (mixed, r"mixes plain factors \(Mass\) with tuples .* put the factors of each entity in its own Tuple"),
        (variadic, r"'\*m' cannot be matched; name every argument"),
        (not_a_factor_in_a_tuple, "argument 'm': float is not a factor"),
        (acts_on_nothing, "no argument holds Mass"),
        (reads_what_a_ball_lacks, "Ball has no Friction. Did you mean"),
        (returns_a_number, r"returns mul\(Mass0, 2.0\); a rule returns Aggregate"),
        (returns_something_else, r"returns SetFactor\[Charge\], but its annotation promises SetFactor\[Mass\]"),
        (returns_another_kind, r"returns Differential\[Mass\], but its annotation promises SetFactor\[Mass\]"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_a_wrong_signature_or_result_names_function_place_and_fix(function, complaint):
    place = rf"{function.__name__} \(test_definition.py:{function.__code__.co_firstlineno}\)"
    with pytest.raises(RuleError, match=f"^{place}.*{complaint}"):
        rule(function)


def test_a_relation_must_not_need_more_entities_than_the_rule_has():
    def lighten(m: Mass) -> SetFactor[Mass]:
        return SetFactor[Mass](m, 1.0)

    for condition in (is_on, is_equal(Mobile, True) & is_on, is_on | is_equal(Mobile, True)):
        with pytest.raises(RuleError, match="needs 2 entities, the rule has 1"):
            rule(relation=condition)(lighten)


def test_what_is_no_function_is_no_rule():
    with pytest.raises(RuleError, match="3 is not a plain Python function"):
        rule(3)  # type: ignore[call-overload]
    with pytest.raises(RuleError, match="rules must be a sequence of rules"):
        World(move)  # type: ignore[arg-type]
    with pytest.raises(RuleError, match="stands in the rules twice"):
        World([move, move])


# --- what a world and its layout refuse together


class Tide(Parameter, default=1.0): ...


def build(rules, levels=LEVELS, task=None, **contacts):
    return uncompiled(World(rules, **contacts), levels.layout, task)


def test_a_rule_that_asks_for_an_unknown_parameter_is_refused():
    def pull(v: Velocity, tide: Tide) -> Differential[Velocity]:
        return Differential[Velocity](v, tide)

    with pytest.raises(RuleError, match="no value is known for the world parameter Tide; give it in the distribution"):
        build([pull])


@pytest.mark.parametrize(("value", "what"), [(1.0, "a number"), ((1.0, 2.0, 3.0), "3 numbers")])
def test_a_vector_factor_takes_both_components_or_zero(value, what):
    def push(v: Velocity) -> SetFactor[Velocity]:
        return SetFactor[Velocity](v, value)

    def stop(v: Velocity) -> SetFactor[Velocity]:
        return SetFactor[Velocity](v, 0)

    with pytest.raises(RuleError, match=rf"SetFactor\[Velocity\] was given {what} for a vector factor; give both"):
        rule(push)
    assert rule(stop)


def returns_a_mass(ball: Ball) -> bool:
    return ball[Mass]


def returns_a_constant(ball: Ball) -> bool:
    return 1


def returns_a_choice(ball: Ball) -> bool:
    return where(ball[Mass] > 1, ball[Charge], ball[Mass])


def returns_a_flag(ball: Ball) -> bool:
    return ball[Mobile]


def returns_a_choice_of_truths(ball: Ball) -> bool:
    return where(ball[Mass] > 1, ball[Charge] > 0, ball[Mobile])


def returns_either(ball: Ball) -> bool:
    return ball[Mass] > 1 or not ball[Mobile]


@pytest.mark.parametrize("function", [returns_a_mass, returns_a_constant, returns_a_choice])
def test_a_number_is_no_truth(function):
    with pytest.raises(RuleError, match="returns a number, but a truth value is needed; compare it, as in 'x > 0'"):
        value_rule(function, truth=True)
    with pytest.raises(RuleError, match="returns a number, but a truth value is needed"):
        relation(function)


@pytest.mark.parametrize("function", [returns_a_flag, returns_a_choice_of_truths, returns_either])
def test_flags_comparisons_and_choices_of_these_are_truths(function):
    assert value_rule(function, truth=True)


def test_actions_walls_and_draws_stay_where_they_belong():
    def acts(v: Velocity, action: Action) -> Differential[Velocity]: ...
    def feels_walls(v: Velocity, wall: Wall) -> Differential[Velocity]: ...

    def jumps(x: Position) -> Differential[Position]:
        return Differential[Position](x, segar.random.uniform())

    @rule(relation=is_equal(Mobile, True))
    def slides(x: Position, mobile: Mobile) -> Differential[Position]:
        return Differential[Position](x, (1.0, 1.0))

    @rule(relation=is_equal(Mobile, True))
    def sticks(v: Velocity, mobile: Mobile, wall: Wall) -> SetFactor[Velocity]: ...

    def slows(v: Velocity, wall: Wall) -> Differential[Velocity]:
        return Differential[Velocity](v, 0.0)

    with pytest.raises(RuleError, match="only a task's action and reward can take Action"):
        build([acts])
    with pytest.raises(RuleError, match=r"only World\(wall_contact=...\) can take Wall"):
        build([feels_walls])
    with pytest.raises(RuleError, match="cannot draw random numbers"):
        build([jumps])
    with pytest.raises(RuleError, match="a rule that moves things cannot have a relation; test inside the rule"):
        build([slides])
    with pytest.raises(RuleError, match="a contact rule cannot have a relation; test inside the rule"):
        build([], wall_contact=sticks)
    with pytest.raises(RuleError, match="a contact happens at an instant, so it can only return SetFactor"):
        build([], wall_contact=slows)
    with pytest.raises(RuleError, match="this contact rule must take 2 entities, not 1"):
        build([], pair_contact=accelerate.function)


def test_relations_may_take_parameters_that_are_known():
    @relation
    def is_fast(body: Ball, limit: MaxVelocity) -> bool:
        return body[Velocity].norm() > limit / 2

    @relation
    def is_high(body: Ball, tide: Tide) -> bool:
        return body[Position].y > tide

    def halve_mass(m: Mass) -> SetFactor[Mass]:
        return SetFactor[Mass](m, m / 2)

    simulator = build([rule(relation=is_fast)(halve_mass)])
    assert compare(simulator, LEVELS, random_states(LEVELS, 20, np.random.default_rng(0), speed=5.0)).worst == 0
    with pytest.raises(RuleError, match="no value is known for the world parameter Tide"):
        build([rule(relation=is_fast & is_high)(halve_mass)])
    with pytest.raises(RuleError, match="a relation cannot take Action or Wall"):

        @relation
        def is_pushed(body: Ball, action: Action) -> bool:
            return action[0] > 0

    def lucky(body: Ball) -> bool:
        return segar.random.bernoulli(0.5)

    with pytest.raises(RuleError, match=r"lucky \(test_definition.py:\d+\): a relation cannot draw random numbers"):
        relation(lucky)


def test_contact_rules_see_two_bodies_and_nothing_else():
    def over(a: Ball, b: Ball) -> SetFactor[Velocity]:
        return SetFactor[Velocity](a[Velocity], 0.0) if overlaps.function(a, b) else None

    def heavy(m: Mass, least: MinMass) -> bool:
        return m > least

    with pytest.raises(RuleError, match=r"over .* cannot ask is_on, overlaps or contains"):
        build([], pair_contact=over)
    with pytest.raises(RuleError, match="what is solid cannot depend on world parameters"):
        build([], solid=value_rule(heavy, truth=True))


def test_an_action_has_as_many_numbers_as_the_task_says():
    def push(ball: GolfBall, action: Action) -> SetFactor[Velocity]:
        return SetFactor[Velocity](ball[Velocity], (action[0], action[2]))

    with pytest.raises(RuleError, match=r"takes action\[2\], but the task's action has 2 numbers"):
        build([move], task=Task("push", push))


def test_a_rule_draws_no_numbers_of_the_rule_behind_it():
    def drawing(count):
        def jitter(m: Mass) -> SetFactor[Mass]:
            return SetFactor[Mass](m, sum(segar.random.uniform() for _ in range(count)))

        return rule(jitter)

    build([drawing(256)])
    with pytest.raises(RuleError, match=r"jitter .* draws more than 256 random numbers"):
        build([drawing(257)])


def test_geometry_needs_the_factors_themselves():
    levels = Levels.from_entities([[GolfBall(), GoalTile({Position: (0.8, 0.8)}), Cloud({Place: (0.1, 0.1)})]])
    with pytest.raises(RuleError, match="entity Cloud holds Place in place of Position; let it hold Position itself"):
        build([move], levels)


class Place(Position): ...


class Cloud(Entity):
    place: Place
    label: Label = "cloud"


def test_the_limit_may_only_limit_velocity():
    def halve(m: Mass) -> SetFactor[Mass]:
        return SetFactor[Mass](m, m / 2)

    with pytest.raises(RuleError, match="the limit may only set Velocity"):
        World(limit=halve)


def test_a_task_whose_entities_are_missing_is_refused():
    levels = Levels.from_entities([[Ball({Position: (0, 0)})]])
    with pytest.raises(RuleError, match=r"push .*the task's action changes no entity .* only Ball, GlobalFriction"):
        build([move], levels)


def test_levels_of_another_distribution_are_refused():
    other = Levels.from_entities([[GolfBall(), GoalTile({Position: (0.8, 0.8)})]])
    with pytest.raises(SegarError, match="these levels belong to another distribution than the simulator"):
        build([move]).step(start(other), other)
    with pytest.raises(SegarError, match="these levels belong to another distribution than the interpreter"):
        Interpreter(World([move]), LEVELS.layout).step(other)


# --- contradictions


def halve(m: Mass) -> SetFactor[Mass]:
    return SetFactor[Mass](m, m / 2)


def double(m: Mass) -> SetFactor[Mass]:
    return SetFactor[Mass](m, m * 2)


def double_if_charged(m: Mass, q: Charge) -> SetFactor[Mass]:
    return SetFactor[Mass](m, m * 2) if q else None


def test_two_rules_that_always_contradict_are_refused_when_the_world_is_built():
    message = (
        r"halve \(test_definition.py:\d+\) and double \(test_definition.py:\d+\) both always set Mass of .*neither is"
        " more specific; remove one, add a relation, or give one a priority"
    )
    with pytest.raises(ConflictError, match=message):
        build([halve, double])
    build([halve, rule(priority=3)(double)])
    build([halve, halve])  # the same value, said twice


def test_a_contradiction_that_depends_on_the_state_names_environment_entity_factor_and_rules():
    goal = GoalTile({Position: (0.8, 0.8)})
    levels = Levels.from_entities([[GolfBall({Charge: 0.0}), goal, Ball({Charge: q})] for q in (0.0, 0.0, 1.0)])
    rules = (
        r"halve \(test_definition.py:\d+\) and double_if_charged \(test_definition.py:\d+\) set Mass of 'ball' to"
        " different values.*neither is more specific; give one a priority"
    )
    simulator, state = build([halve, double_if_charged], levels), start(levels)
    with pytest.raises(ConflictError, match=f"^environment 2: {rules}"):
        simulator.step(state, levels)
    interpreter = Interpreter(simulator.world, levels.layout)
    interpreter.step(levels, 0)
    with pytest.raises(ConflictError, match=rules):
        interpreter.step(levels, 2)


def test_one_rule_can_contradict_itself_over_its_partners():
    @rule
    def copy(ball: GolfBall, other: Tuple[Charge]) -> SetFactor[Size]:
        return SetFactor[Size](ball[Size], other[0])

    balls = [Ball({Position: (x, 0.5), Charge: q, ID: f"ball{q}"}) for x, q in ((-0.5, 1.0), (0.5, 2.0))]
    levels = Levels.from_entities([[GolfBall({Charge: 2.0}), GoalTile({Position: (0.8, 0.8)}), *balls]])
    with pytest.raises(ConflictError, match=r"copy .* and .*copy .* set Size of 'golfball'"):
        build([copy], levels).step(start(levels), levels)
    with pytest.raises(ConflictError, match=r"set Size of 'golfball' to different values, 1\.0 and 2\.0"):
        Interpreter(World([copy]), levels.layout).step(levels)


class Height(Scalar): ...


class Altitude(Height): ...


class Balloon(Ball):
    height: Height
    label: Label = "balloon"


class Zeppelin(Ball):
    altitude: Altitude
    label: Label = "balloon"


def test_a_slot_whose_types_keep_one_factor_in_different_columns_is_refused():
    def rise(h: Height) -> Differential[Height]:
        return Differential[Height](h, 1.0)

    ball, goal = GolfBall(), GoalTile({Position: (0.8, 0.8)})
    levels = Levels.from_entities([[ball, goal, Balloon({ID: "b"})], [ball, goal, Zeppelin({ID: "b"})]])
    message = r"Balloon, Zeppelin, which hold different factors \(Altitude, Height\) for Height; give them separate"
    with pytest.raises(RuleError, match=message):
        build([rise], levels)
