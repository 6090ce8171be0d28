"""Levels: nested, repeatable, placed without overlap, and the same after a file."""

import dataclasses
import errno
import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import segar
from segar import GoalTile, GolfBall, Gravity, LevelDistribution, Prior, RandomUniformLocation, SandTile, UniformNoise
from segar.errors import LevelError, PlacementError
from segar.language import Ball, Circle, ConvexHull, FloorFriction, Heat, Hole, Label, Object, Order, RandomConvexHull
from segar.language.factors import ID, Charge, Friction, Mass, Mobile, Position, Shape, Size, Velocity
from segar.levels import LEVEL_ARRAYS, Levels, family
from segar.suites import suite
from tests.crafted import description_of

ANYWHERE = Prior(Position, RandomUniformLocation())
SOME = ("empty-easy", "objectsx3-hard", "tilesx2-medium", "puttputt")
some_families = pytest.mark.parametrize("name", SOME)


class Marble(Object):
    label: Label = "marble"


def positions(levels: Levels, which: str = "values") -> np.ndarray:
    column = levels.layout.columns[Position]
    return getattr(levels, which)[:, :, column : column + 2]


@some_families
def test_ten_levels_are_the_first_ten_of_fifty_wherever_chunks_are_cut(name, monkeypatch):
    whole = family(name).sample(50, seed=3)
    assert family(name).sample(10, seed=3) == whole[:10]
    monkeypatch.setattr("segar.levels.sampling.draws.CHUNK", 7)
    assert family(name).sample(50, seed=3) == whole


@some_families
def test_train_never_meets_test_and_seeds_differ(name):
    sets = [family(name).sample(30, seed, split) for seed in (0, 1) for split in ("train", "test", "validation")]
    drawn = np.concatenate([positions(levels, "sampled_values")[:, :, 0] for levels in sets])
    goal = drawn[:, sets[0].layout.slot_index("goal")]
    assert len(np.unique(goal)) == len(goal)


def test_the_hash_follows_content_not_name_or_rules():
    dist = family("objectsx1-hard")
    assert dataclasses.replace(dist, name="other").hash == dist.hash == dist.with_rules(segar.DEFAULT_RULES[:3]).hash
    changed = [
        dataclasses.replace(dist, priors=dist.priors[:-1]),
        dataclasses.replace(dist, parameters={Gravity: 9.0}),
        dataclasses.replace(dist, min_distance=0.2),
        dataclasses.replace(dist, positions=[(GoalTile, [[0.5, 0.5]])]),
        dataclasses.replace(dist, numbers=dist.numbers[:-1]),
    ]
    assert len({d.hash for d in [dist, *changed]}) == 6


def test_other_rules_keep_the_levels():
    dist = family("objectsx1-hard")
    other = dist.with_rules([segar.move, segar.rules.accelerate])
    assert other.sample(5) == dist.sample(5)
    assert [rule.name for rule in other.sample(1).world.rules] == ["move", "accelerate"]
    assert dist.sample(1).world is None


@some_families
def test_nothing_starts_in_a_wall_and_no_two_objects_overlap(name):
    levels = family(name).sample(300)
    layout, place = levels.layout, positions(levels)
    size = levels.values[:, :, layout.columns[Size]]
    circles = levels.shape_kind == 1
    assert (np.abs(place[circles]).max(axis=-1) + size[circles] / 2 <= 1 - 0.99e-5).all()
    for level, slot in zip(*np.nonzero(levels.shape_kind == 2), strict=True):
        outline = place[level, slot] + levels.vertices[level, slot, : levels.vertex_count[level, slot]]
        assert np.abs(outline).max() <= 1 - 0.99e-5
    is_object = np.array([*(issubclass(t, Object) for t in layout.types), False])[levels.types]
    for i in range(place.shape[1]):
        for j in range(i):
            both = is_object[:, i] & is_object[:, j]
            distance = np.sqrt(((place[both, i] - place[both, j]) ** 2).sum(-1))
            assert (distance > (size[both, i] + size[both, j]) / 2).all()


def test_two_overlapping_objects_part_by_their_penetration():
    levels = Levels.from_entities(
        [[Ball({Position: [0.0, 0.0], Size: 0.2}), Ball({Position: [0.12, 0.0], Size: 0.2})]], fix_overlaps=True
    )
    assert np.allclose(positions(levels)[0, :2], [[-0.04, 0.0], [0.16, 0.0]], atol=1e-6)


def test_fixed_positions_are_kept_and_the_rest_is_drawn():
    rack = [[0.0, 0.0], [0.0, 0.3], [0.3, 0.0]]
    dist = LevelDistribution([(GolfBall, 1), (Ball, 3)], [ANYWHERE], positions=[(Ball, rack)])
    place = positions(dist.sample(20), "sampled_values")
    assert (place[:, 1:4] == rack).all() and len(np.unique(place[:, 0])) == 40


def described_anew(levels: Levels, change: Callable[[str], str], folder: Path) -> Path:
    """A file of the levels with another text as its description."""
    levels.save(folder / "x.npz")
    description, described = description_of(folder / "x.npz")
    (folder / "x.npz").write_bytes(described(change(json.dumps(description)).encode()))
    return folder / "x.npz"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: m.update(slots=[{"name": "x", "types": [99], "optional": False}]), r"the slot 'x' are not"),
        (lambda m: m.update(format_version=99), r"was written by a newer SEGAR .* install that version"),
        (lambda m: m.update(format="segar-plan"), r"its format is 'segar-plan'"),
    ],
)
def test_a_file_with_a_damaged_description_is_refused_with_what_to_do(change, message, tmp_path):
    def damaged(text: str) -> str:
        metadata = json.loads(text)
        change(metadata)
        return json.dumps(metadata)

    path = described_anew(family("puttputt").sample(1), damaged, tmp_path)
    with pytest.raises(LevelError, match=message):
        Levels.load(path)


def test_an_unknown_entity_says_what_to_import(tmp_path):
    class Meteor(Object):
        label: Label = "meteor"

    levels = Levels.from_entities([[Meteor()]])
    path = described_anew(levels, lambda text: text.replace("Meteor", "Meteorite"), tmp_path)
    with pytest.raises(LevelError, match=r"'Meteorite', which is not defined; import .*test_levels, .* 'Meteor'"):
        Levels.load(path)


def test_an_entity_that_has_changed_since_is_refused(tmp_path):
    levels = Levels.from_entities([[Marble()]])
    path = described_anew(levels, lambda text: text.replace('"name": "Mass"', '"name": "Weight"'), tmp_path)
    with pytest.raises(LevelError, match="have changed since it was written"):
        Levels.load(path)


def test_slices_keep_track_of_where_levels_come_from():
    levels = family("empty-hard").sample(10)
    assert levels[7].provenance.indices.tolist() == [7]
    assert levels[-1] == levels[9] and len(levels[2:5]) == 3
    assert levels[np.array([4, 4, 1])].provenance.indices.tolist() == [4, 4, 1]
    assert levels[np.arange(10) > 6] == levels[7:]
    assert [level.provenance.indices[0] for level in levels] == list(range(10))
    assert levels[:3][1] == levels[1]


def test_an_index_beyond_the_levels_is_an_error():
    levels = family("empty-hard").sample(3)
    with pytest.raises(IndexError, match="level 3 is not among these 3 levels"):
        levels[3]
    with pytest.raises(LevelError, match="at least one"):
        levels[[]]
    with pytest.raises(LevelError, match="at least one"):
        levels[5:]
    with pytest.raises(IndexError, match="only integers"):
        levels[1.0]


def test_parameters_of_another_shape_are_refused():
    levels = family("empty-hard").sample(3)
    with pytest.raises(LevelError, match=r"with_parameters needs \(3, 7\) numbers \(Gravity, .*\), not \(2, 7\)"):
        levels.with_parameters(levels.parameters[:2])


def test_levels_differ_when_any_bit_differs():
    levels = family("empty-hard").sample(3)
    values = levels.values.copy()
    assert dataclasses.replace(levels, values=values.copy()) == levels
    values[1, 0, 0] = np.nextafter(values[1, 0, 0], 2.0)
    assert dataclasses.replace(levels, values=values) != levels


def test_levels_by_hand_hold_exactly_what_was_given():
    hull = ConvexHull([(0, 0), (0.3, 0), (0, 0.2)])
    levels = Levels.from_entities(
        [
            [GolfBall({Position: [0.1, 0.2], Velocity: [1.0, 0.0], Order: 3}), SandTile({Shape: hull, Friction: 0.7})],
            [GolfBall({Position: [0.1, 0.2], Size: 0.3, Mobile: False}), Hole({Shape: Circle(0.4), Heat: 0.2})],
        ],
        parameters={Gravity: [9.0, 10.0], FloorFriction: 0.1},
    )
    layout = levels.layout
    assert layout.names == ("golfball", "tile1", "global_friction")
    read = lambda level, slot, factor: levels.values[level, slot, layout.columns[factor]]  # noqa: E731
    assert positions(levels)[:, 0].tolist() == [[0.1, 0.2], [0.1, 0.2]]
    assert read(0, 0, Order) == 3 and read(0, 0, Velocity) == 1.0 and read(1, 0, Mobile) == 0.0
    assert read(1, 0, Size) == 0.3 and read(1, 1, Size) == 0.4 and read(0, 1, Friction) == 0.7
    assert levels.shape_kind.tolist() == [[1, 2, 0], [1, 1, 0]]
    assert levels.vertex_count.tolist() == [[0, 3, 0], [0, 0, 0]]
    assert levels.parameters[:, layout.parameters.index(Gravity)].tolist() == [9.0, 10.0]
    assert (levels.values[:, -1, layout.columns[Friction]] == 0.1).all()


def test_levels_by_hand_may_have_different_numbers_of_entities():
    balls = [Ball({ID: f"{k}_ball", Position: [0.3 * k, 0.0]}) for k in range(3)]
    levels = Levels.from_entities([balls, balls[:1]])
    assert levels.layout.names[:3] == ("0_ball", "1_ball", "2_ball")
    assert [slot.optional for slot in levels.layout.slots] == [False, True, True, False]
    assert levels.types[1].tolist() == [0, -1, -1, 1] and np.isnan(levels.values[1, 1:3]).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Levels.from_entities([]), "at least one level"),
        (lambda: Levels.from_entities([Ball(), Ball()]), r"each a list of at least one entity: \[\[GolfBall"),  # type: ignore
        (lambda: Levels.from_entities([[Ball]]), "is not an entity"),
        (lambda: Levels.from_entities([[segar.Entity({Mass: 1.0})]]), "declare a sub-class of Entity"),
        (lambda: Levels.from_entities([[segar.language.GlobalFriction()]]), "FloorFriction"),
        (lambda: Levels.from_entities([[Ball({Label: "star"})]]), "the label belongs to the type"),
        (lambda: Levels.from_entities([[SandTile({Shape: RandomConvexHull(0.3)})]]), "a random shape needs"),
        (lambda: Levels.from_entities([[Ball()]], {"Gravity": 3.0}), "'Gravity' is not a world parameter class"),
        (lambda: Levels.from_entities([[Ball()]], {Gravity: [1.0, 2.0]}), "Gravity must be one number, or a list of 1"),
        (lambda: Levels.from_entities([[Ball({ID: "a"}), Ball({ID: "a"})]]), "several entities are called 'a'"),
    ],
)
def test_entities_that_cannot_make_levels_are_refused(make, message):
    with pytest.raises(LevelError, match=message):
        make()


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: LevelDistribution([(Ball, 1)], prior=[]), LevelError, "has no 'prior'. Did you mean 'priors'?"),
        (lambda: LevelDistribution(), LevelError, "numbers must name at least one entity"),
        (lambda: LevelDistribution({Ball: 1}), LevelError, "numbers must be a list, not dict"),
        (lambda: LevelDistribution([(Ball, 0)]), LevelError, "at least one entity"),
        (lambda: LevelDistribution([("Ball", 1)]), LevelError, "'Ball' is not an entity type"),
        (lambda: LevelDistribution([Ball]), LevelError, "each entry is a pair"),
        (lambda: LevelDistribution([(Ball, 1.5)]), LevelError, "how many Ball must be a whole number"),
        (lambda: LevelDistribution([(Ball, UniformNoise(1, 2))]), LevelError, "a distribution of whole numbers"),
        (lambda: LevelDistribution([(Ball, 1)], [(Mass, 1.0)]), LevelError, "is not a Prior"),
        (lambda: LevelDistribution([(Ball, 1)], parameters={Mass: 1.0}), LevelError, "not a world parameter"),
        (lambda: LevelDistribution([(Ball, 1)], positions=[(Ball, [[0, 0], [1, 1]])]), LevelError, "2 places for Ball"),
        (lambda: LevelDistribution([(Ball, 1)], world=[segar.move]), LevelError, "world must be a segar.World"),
        (lambda: LevelDistribution([(Ball, 1)], parameters=[segar.Gravity]), LevelError, "each entry is a pair"),
        (lambda: LevelDistribution([(Ball, 1)], min_distance=-1), LevelError, "min_distance must be"),
        (lambda: LevelDistribution([(Ball, 1)], min_distance=1e160), LevelError, "min_distance must be"),
        (
            lambda: LevelDistribution([(GolfBall, 1), (GolfBall, 1), (Marble, 0)]).sample(0),
            PlacementError,
            "always start 0",
        ),
        (lambda: family("empty-easy").sample(0), LevelError, "'empty-easy': the number of levels must be"),
        (lambda: family("empty-easy").sample(True), LevelError, "the number of levels must be"),
        (lambda: family("empty-easy").sample(5, seed=0.5), LevelError, "the seed must be a whole number"),
        (lambda: family("empty-easy").sample(5, split=1), LevelError, "the split must be a word"),
    ],
)
def test_a_configuration_that_makes_no_sense_is_refused_at_once(make, error, message):
    with pytest.raises(error) as caught:
        make()
    assert message in str(caught.value)


def test_two_entities_of_one_name_are_refused():
    class OtherBall(GolfBall): ...

    with pytest.raises(LevelError, match=r"two entities are called 'golfball' \(GolfBall, OtherBall\)"):
        LevelDistribution([(GolfBall, 1), (OtherBall, 1)], [ANYWHERE])


def test_things_that_cannot_be_placed_are_named():
    crowd = LevelDistribution([(Ball, 15)], [ANYWHERE], min_distance=0.6, name="crowd")
    message = r"'crowd', level \d+ \(seed 4, split 'test'\): after 100 tries 'ball\d+' and 'ball\d+' are 0\.\d+ apart"
    with pytest.raises(PlacementError, match=message):
        crowd.sample(1, seed=4, split="test")


@pytest.mark.parametrize(
    ("count", "size", "message"),
    [
        (2, 1.5, "the tightest are 'ball1' .* and 'ball2'"),
        (1, 2.5, r"'ball' \(size 2.5\) does not fit between the walls"),
    ],
)
def test_things_that_do_not_fit_are_named(count, size, message):
    with pytest.raises(PlacementError, match=message):
        LevelDistribution([(Ball, count)], [ANYWHERE, Prior(Size, size)]).sample(2)


def test_an_abstract_entity_without_a_place_is_not_placed():
    class Weather(segar.Entity):
        charge: Charge = 0.5
        id: ID = "weather"

    levels = LevelDistribution(
        [(Ball, 1), (Weather, 1)], [Prior(Charge, UniformNoise(1, 2), entity_type=Weather)]
    ).sample(3)
    assert np.isnan(positions(levels)[:, 1]).all()
    assert (levels.values[:, 1, levels.layout.columns[Charge]] >= 1).all()


@pytest.mark.parametrize(
    "made",
    [
        lambda: suite("place-few-v1").test_levels,
        lambda: family("empty-hard").sample(3),
        lambda: family("empty-hard").sample(3)[1:],
        lambda: family("objectsx1-hard").sample(3).without_overlaps(),
        lambda: Levels.from_entities([[segar.GolfBall()]]),
    ],
)
def test_arrays_of_levels_cannot_be_written(made):
    levels = made()
    for array in (*(getattr(levels, name) for name in LEVEL_ARRAYS), levels.provenance.indices):
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 0
    own = levels.values.copy()
    again = dataclasses.replace(levels, values=own)
    own[:] = 7.0  # as a loop over several sets would do
    assert again == levels


@pytest.mark.parametrize("name", ["levels.npz", "levels.json"])
@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_levels_that_could_not_be_loaded_are_not_saved(name, wrong, tmp_path):
    levels = family("empty-hard").sample(3)
    values = levels.values.copy()
    values[1, 0, levels.layout.columns[segar.Position]] = wrong
    levels.save(tmp_path / name)
    before = (tmp_path / name).read_bytes()
    with pytest.raises(LevelError, match="level 1"):
        dataclasses.replace(levels, values=values).save(tmp_path / name)
    assert (tmp_path / name).read_bytes() == before


def test_a_full_disk_leaves_the_old_file_and_no_debris(tmp_path, monkeypatch):
    path = tmp_path / "levels.npz"
    old = family("empty-easy").sample(2)
    old.save(path)

    def no_space(_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", no_space)
    with pytest.raises(LevelError, match=r"cannot be written to .*levels.npz: No space left on device"):
        family("empty-hard").sample(5).save(path)
    assert os.listdir(tmp_path) == ["levels.npz"] and Levels.load(path) == old
