"""State observations: the numbers of the state in fixed places, missing ones marked, in units of the prior on request."""

from typing import Any

import numpy as np
import pytest

import segar
from segar import Charge, GoalTile, GolfBall, Magnet, Mass, Position, Prior, Velocity
from segar.language import Heat
from segar.observations import AllObjects, AllState, AllTiles, ObjectState, StateVector, TileState, empty_batch
from segar.observations.state.state_options import HIDDEN, MISSING_2022

# One to three things of four types, so that slots can be empty and can hold what has the factor or lacks it.
DIST = segar.LevelDistribution(
    numbers=[
        (GolfBall, 1),
        (GoalTile, 1),
        (segar.ThingFactory([segar.Charger, Magnet, segar.SandTile]), segar.DiscreteRangeNoise(1, 3)),
    ],
    priors=[
        Prior(Position, segar.RandomUniformLocation()),
        Prior(Charge, segar.GaussianNoise(-1.0, 0.4), entity_type=segar.Charger),
        Prior(Mass, segar.GaussianNoise(3.0, 0.5, clip=(1.0, 5.0)), entity_type=GolfBall),
    ],
)
LEVELS = DIST.sample(40, seed=0)


def observe(observation: Any, levels: segar.Levels = LEVELS) -> Any:
    """What is seen at the start of each level."""
    n = len(levels)
    bound = observation.bind(levels, n)
    out = empty_batch(bound.space, n)
    bound.begin(levels.values, np.arange(n), np.ones(n, np.bool_))
    bound.write(levels.values, np.arange(n), out, np.arange(n))
    return out


def test_every_number_is_the_factor_that_its_name_says():
    bound, seen, layout = StateVector().bind(LEVELS, 1), observe(StateVector()), LEVELS.layout
    assert seen.shape == (len(LEVELS), len(bound.names)) == (len(LEVELS), *bound.space.shape)
    for k, name in enumerate(bound.names):
        slot, what, *component = name.split(".")
        index = layout.slot_index(slot)
        if what.startswith("is_"):
            kinds = np.array([t.__name__ for t in layout.types] + ["absent"])
            expected = kinds[LEVELS.types[:, index]] == what.removeprefix("is_")
        else:
            column = layout.columns[layout.factor(what)] + (component == ["y"])
            expected = np.nan_to_num(LEVELS.values[:, index, column])
        np.testing.assert_array_equal(seen[:, k], expected.astype(np.float32), err_msg=name)
    assert not {f.__name__ for f in HIDDEN} & {name.split(".")[1] for name in bound.names}


def test_factors_and_entities_are_shown_in_the_order_in_which_they_are_chosen():
    chosen = StateVector(entities=[GoalTile, "golfball"], factors=[Mass, "Position"])
    names = chosen.bind(LEVELS, 1).names
    assert names == [
        "goal.Position.x", "goal.Position.y", "golfball.Mass", "golfball.Position.x", "golfball.Position.y",
    ]  # fmt: skip
    by_default = StateVector().bind(LEVELS, 1).names
    np.testing.assert_array_equal(observe(chosen), observe(StateVector())[:, [by_default.index(n) for n in names]])


def test_a_chosen_type_includes_its_sub_classes_and_hides_other_types_in_the_same_slot():
    magnets = StateVector(entities=[Magnet], factors=[Position], types=True, mask="dict")
    seen, names = observe(magnets), magnets.bind(LEVELS, 1).names
    slots = [k for k, slot in enumerate(LEVELS.layout.slots) if Magnet in slot.types]
    assert len(names) == 3 * len(slots)
    is_magnet = LEVELS.types[:, slots] == LEVELS.layout.types.index(Magnet)
    assert 0 < is_magnet.mean() < 1
    np.testing.assert_array_equal(seen["mask"].reshape(-1, len(slots), 3), np.repeat(is_magnet[..., None], 3, axis=2))
    np.testing.assert_array_equal(seen["state"][:, 2::3], is_magnet)
    x = LEVELS.values[:, slots, LEVELS.layout.columns[Position]]
    np.testing.assert_array_equal(seen["state"][:, 0::3], np.where(is_magnet, x, 0).astype(np.float32))
    objects = StateVector(entities=["Object"], factors=[Mass]).bind(LEVELS, 1).names
    assert {n.split(".")[0] for n in objects} == {"golfball", *(LEVELS.layout.names[k] for k in slots)}


def test_a_factor_is_shown_and_hidden_with_its_sub_classes():
    class Weight(Mass): ...

    class Stone(segar.Ball):
        weight: Weight = 7.0

    levels = segar.Levels.from_entities([[GolfBall(), Stone()]])
    assert "ball.Weight" in StateVector(factors=[Mass]).bind(levels, 1).names
    assert StateVector(factors=[Mass]).shows(Weight) and not StateVector(factors=[Weight]).shows(Mass)
    assert not StateVector(hidden=[Mass]).shows(Weight)
    assert not any("Weight" in name or "Mass" in name for name in StateVector(hidden=["Mass"]).bind(levels, 1).names)


@pytest.mark.parametrize("form", ["vector", "table"])
@pytest.mark.parametrize("missing", [0.0, MISSING_2022])
def test_what_is_absent_or_lacks_the_factor_is_missing_and_marked(form, missing):
    options: dict[str, Any] = {"form": form, "factors": [Charge, Heat, Velocity], "types": False, "missing": missing}
    by_dict = observe(StateVector(mask="dict", **options))
    state, mask = by_dict["state"], by_dict["mask"]
    assert state.shape == mask.shape and set(np.unique(mask)) == {0.0, 1.0}
    assert (state[mask == 0] == missing).all() and (state[mask == 1] != MISSING_2022).all()
    np.testing.assert_array_equal(observe(StateVector(**options)), state)
    np.testing.assert_array_equal(observe(StateVector(mask="numbers", **options)), np.concatenate([state, mask], -1))
    names = StateVector(mask="numbers", **options).bind(LEVELS, 1).names
    assert len(names) == 2 * state[0].size and sum(name.endswith(".mask") for name in names) == state[0].size
    if form == "table":  # [slots, (Charge, Heat, Velocity.x, Velocity.y)]
        present = [~np.isnan(LEVELS.values[:, : state.shape[1], LEVELS.layout.columns[f]]) for f in (Charge, Heat)]
        np.testing.assert_array_equal(mask[..., 0], present[0])
        np.testing.assert_array_equal(mask[..., 1], present[1])


def test_a_table_has_a_row_for_each_slot_and_rows_to_spare_are_missing():
    table = observe(StateVector(form="table", factors=[Position], slots=9, types=True, mask="dict"))
    kinds = len([t for t in LEVELS.layout.types if issubclass(t, segar.language.Thing)])
    assert table["state"].shape == (len(LEVELS), 9, 2 + kinds)
    assert not table["state"][:, 5:].any() and not table["mask"][:, 5:].any()
    np.testing.assert_array_equal(table["state"][..., 2:].sum(-1)[:, :5], LEVELS.types[:, :5] >= 0)
    np.testing.assert_array_equal(table["state"][:, 0, :2], LEVELS.values[:, 0, :2].astype(np.float32))


def test_a_table_of_given_factors_and_slots_has_one_shape_for_all_distributions():
    families = ("empty-hard", "objectsx3-hard", "tilesx2-hard", "puttputt")
    spaces = [AllState().bind(segar.family(name).sample(1, seed=0), 1).space for name in families]
    assert all(space == spaces[0] for space in spaces) and spaces[0].shape[0] == 20


def test_the_presets_of_2022_show_what_they_showed():
    levels = segar.family("tilesx1-hard").sample(2, seed=0)
    ball, goal = ObjectState().bind(levels, 1).names, TileState("goal").bind(levels, 1).names
    assert len(ball) == 12 and [n.split(".")[1] for n in ball[:4]] == ["Charge", "Mass", "Magnetism", "StoredEnergy"]
    assert goal == ["goal.Heat", "goal.Friction", "goal.Position.x", "goal.Position.y"]
    first = AllState(unique_ids=("goal",), missing=MISSING_2022).bind(levels, 1).names[0]
    assert first == "goal.Position.x"
    assert {n.split(".")[0] for n in AllObjects().bind(levels, 1).names} == {"golfball", "empty"}
    assert {n.split(".")[0] for n in AllTiles(5).bind(levels, 1).names} == {"goal", "tile1", "empty"}


def test_normalised_numbers_have_mean_0_and_spread_1_over_levels_of_the_prior():
    many = DIST.sample(4000, seed=3, split="test")
    state = StateVector(
        entities=["golfball", segar.Charger], factors=[Mass, Charge, Position], mask="dict", types=False
    )
    seen = observe(segar.observations.StateVector(**{**vars(state), "normalise": True}), many)
    names = state.bind(many, 1).names
    of = {n: seen["state"][seen["mask"][:, k] == 1, k] for k, n in enumerate(names)}
    plain = observe(state, many)
    for name in ("golfball.Mass", "golfball.Position.x", "golfball.Position.y"):
        assert abs(of[name].mean()) < 0.1 and abs(of[name].std() - 1) < 0.1, name
    x, y = names.index("golfball.Position.x"), names.index("golfball.Position.y")
    scale = plain["state"][:, [x, y]].std(0) / seen["state"][:, [x, y]].std(0)
    assert scale[0] == pytest.approx(scale[1], rel=1e-5), "a vector has one unit"
    constant = seen["state"][:, names.index("golfball.Charge")]
    np.testing.assert_array_equal(constant, 0.0)  # the prior does not vary it: 0, in its own unit
    assert (seen["state"][seen["mask"] == 0] == 0).all()


def test_equal_states_look_equal_in_training_and_test_levels_and_from_a_file(tmp_path):
    levels = DIST.sample(5, seed=9, split="test")
    levels.save(tmp_path / "levels.npz")
    normalised = StateVector(normalise=True)
    from_file = observe(normalised, segar.Levels.load(tmp_path / "levels.npz"))
    np.testing.assert_array_equal(observe(normalised, levels), from_file)
    np.testing.assert_array_equal(observe(normalised, levels[2]), from_file[2:3])


def heavier(by):
    """Levels of golf balls whose mass is uniform, ``by`` more than elsewhere."""
    ball = (GolfBall, 1)
    return segar.LevelDistribution(
        numbers=[ball, (GoalTile, 1)],
        priors=[
            segar.Prior(Position, segar.RandomUniformLocation()),
            segar.Prior(Mass, segar.UniformNoise(1 + by, 2 + by), entity_type=GolfBall),
        ],
    )


MASS = StateVector(entities=["golfball"], factors=[Mass], normalise=True)


@pytest.mark.parametrize(
    ("described", "read"),
    [
        (MASS, lambda seen: seen),
        (segar.observations.Stack(MASS, 2), lambda seen: seen[:, :1]),
        ({"mass": MASS, "all": "state"}, lambda seen: seen["mass"]),
        ((MASS,), lambda seen: seen[0]),
        (segar.observations.OneOf([MASS, MASS]), lambda seen: seen),
    ],
)
def test_a_shift_of_the_test_distribution_is_seen_in_the_units_of_training(described, read):
    train, test = (heavier(by).sample(50, seed=0) for by in (0.0, 3.0))
    described = segar.observations.make_observation(described)
    assert abs(float(read(observe(described, test)).mean())) < 1, "in its own units, the shift is not to be seen"
    trained = segar.observations.trained_on(described, train)
    seen, there = (read(observe(trained, levels))[:, 0] for levels in (train, test))
    np.testing.assert_array_equal(seen, read(observe(described, train))[:, 0])
    mass, more = (levels.values[:, 0, levels.layout.columns[Mass]] for levels in (train, test))
    np.testing.assert_allclose(there - seen, (more - mass) * 12**0.5, rtol=0.05)  # 1/√12: the spread over one unit
    again = segar.observations.trained_on(trained, test)
    np.testing.assert_array_equal(read(observe(again, test))[:, 0], there)


def test_levels_by_hand_have_the_units_of_training():
    train, by_hand = heavier(0.0).sample(3, seed=0), segar.Levels.from_entities([[GolfBall({Mass: 1.5}), GoalTile()]])
    seen = observe(MASS.trained_on(train), by_hand)
    assert abs(float(seen[0, 0])) < 0.2
    with pytest.raises(segar.errors.SegarError, match="measured_on must be a level set"):
        StateVector(normalise=True, measured_on=heavier(0.0))


def test_levels_that_know_no_prior_are_not_normalised():
    by_hand = segar.Levels.from_entities([[GolfBall(), GoalTile()]])
    with pytest.raises(segar.errors.LevelError, match=r"measures by the prior, and these levels know none"):
        StateVector(normalise=True).bind(by_hand, 1)


def test_what_may_not_be_seen_is_missing_while_it_is_invisible():
    levels = segar.Levels.from_entities(
        [[GolfBall({segar.language.Visible: v, Mass: 2.0}), GoalTile()] for v in (True, False)]
    )
    seen = observe(StateVector(entities=["golfball"], factors=[Mass], sees_invisible=False, mask="numbers"), levels)
    np.testing.assert_array_equal(seen, [[2, 1], [0, 0]])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"form": "tabel"}, "no form 'tabel'. Did you mean 'table'"),
        ({"mask": "dic"}, "no mask 'dic'. Did you mean 'dict'"),
        ({"slots": 3}, "slots are the rows of a table, at least 1; not 3 of a vector"),
        ({"missing": float("nan")}, "missing must be a finite number"),
        ({"factors": ["Mas"]}, "factors: no factor is called 'Mas'. Did you mean 'Mass'"),
        ({"hidden": [GolfBall]}, "hidden: <class 'segar.language.entities.GolfBall'> is not a factor"),
        ({"factors": [segar.language.Label]}, "Label is not a number"),
    ],
)
def test_wrong_options_are_errors_where_they_are_written(options, words):
    with pytest.raises(segar.SegarError, match=words):
        StateVector(**options)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"entities": ["golfbal"]}, "no entity is called 'golfbal'. Did you mean 'golfball'"),
        ({"entities": [segar.FireTile]}, "none of these levels' entities, .*, can be a FireTile"),
        ({"entities": [3]}, "entities are names or entity types, not 3"),
        ({"entities": ["goal"], "factors": [Mass]}, "none of the entities shown, goal, has a factor 'Mass'"),
        ({"factors": [Mass], "hidden": [Mass], "types": False}, "nothing is left to show"),
        ({"form": "table", "slots": 2}, "5 entities do not fit into slots=2: golfball, goal, "),
    ],
)
def test_what_the_levels_do_not_have_is_an_error_that_names_it(options, words):
    with pytest.raises(segar.errors.LevelError, match=words):
        StateVector(**options).bind(LEVELS, 1)
