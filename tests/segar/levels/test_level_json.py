"""Level files in JSON hold the same levels as npz files, to the bit; what people write is read, or refused with its place."""

import dataclasses
import json
import re
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import segar
from segar import Ball, Circle, GoalTile, GolfBall, Gravity, Levels, Mass, Object, Position, Shape, Size, Tile
from segar.errors import LevelError
from segar.language import ConvexHull, FloorFriction, Parameter
from segar.levels import LEVEL_ARRAYS, families, level_schema
from tests.crafted import assert_clean_errors, at, crafted_descriptions, crafted_texts
from tests.places import ROOT

NAMES = sorted({*(name for name in families() if name.endswith("hard")), "puttputt", "billiards", "invisiball"})
LEVELS = segar.family("puttputt").sample(3, seed=0)  # things that may be absent, hulls and circles


class Wind(Parameter, default=0.5, bounds=(-2.0, 2.0)):
    """How hard the wind blows."""


class Fuel(segar.Scalar, default=0.5): ...


class Thrust(segar.Vector): ...


class Rocket(Object):
    fuel: Fuel = 0.5
    thrust: Thrust = (0.0, 1.0)


def in_json(levels: Levels, folder: Path) -> dict:
    """The data of the file that holds the levels."""
    levels.save(folder / "given.json")
    return json.loads((folder / "given.json").read_text(), parse_constant=None)


def assert_same(a: Levels, b: Levels) -> None:
    """Equal to the bit, with all that a file keeps."""
    assert a == b and a.task == b.task and a.provenance.rules == b.provenance.rules
    for name in LEVEL_ARRAYS:
        assert getattr(a, name).dtype == getattr(b, name).dtype and getattr(b, name).flags.c_contiguous
    assert a.provenance.indices.dtype == b.provenance.indices.dtype == np.int64
    assert a.moments.keys() == b.moments.keys()
    for key in a.moments:
        for one, other in zip(a.moments[key], b.moments[key], strict=True):
            assert one.tobytes() == other.tobytes() and one.dtype == other.dtype


def assert_kept(levels: Levels, folder: Path) -> None:
    """JSON gives the levels back, JSON of them is the same text, and npz files before and after it hold the same."""
    levels.save(folder / "a.npz")
    before = Levels.load(folder / "a.npz", levels.world)
    before.save(folder / "a.json")
    after = Levels.load(folder / "a.json", levels.world)
    assert_same(after, before)
    after.save(folder / "b.json")
    assert (folder / "a.json").read_bytes() == (folder / "b.json").read_bytes()
    after.save(folder / "b.npz")
    with np.load(folder / "a.npz") as one, np.load(folder / "b.npz") as other:
        assert one.files == other.files
        for name in one.files:
            assert one[name].tobytes() == other[name].tobytes() and one[name].dtype == other[name].dtype, name


@pytest.mark.parametrize("name", NAMES)
def test_the_levels_of_a_family_are_kept_to_the_bit(name, tmp_path):
    levels = segar.family(name).sample(6, seed=3, split="test")[[4, 0, 2]]
    assert_kept(levels, tmp_path)
    loaded, made = Levels.load(tmp_path / "a.npz"), levels.provenance
    assert all(getattr(loaded, array).tobytes() == getattr(levels, array).tobytes() for array in LEVEL_ARRAYS)
    assert loaded == levels and loaded.provenance == made and loaded.distribution is loaded.world is None
    assert (made.name, made.seed, made.split, made.indices.tolist()) == (name, 3, "test", [4, 0, 2])
    assert made.distribution == segar.family(name).hash


numbers = st.floats(-1e30, 1e30, allow_nan=False) | st.sampled_from([-0.0, 5e-324, 1 / 3, 1e22, 1e-7, 2.0**53 + 2])
places = st.tuples(numbers, numbers)
sizes = st.floats(1e-3, 10)
things = st.one_of(
    st.builds(lambda p, v, s: Ball({Position: p, segar.Velocity: v, Size: s, Shape: Circle(s)}), places, places, sizes),
    st.builds(lambda p, f, t: Rocket({Position: p, Fuel: f, Thrust: t}), places, numbers, places),
    st.builds(
        lambda p, corners: Tile({Position: p, Shape: ConvexHull([(np.cos(a), np.sin(a)) for a in corners], 1.0)}),
        places,
        st.sampled_from([(0, 2, 4), (0, 1, 2.5, 4), (0.1, 1.1, 2.1, 3.1, 5.1)]),
    ),
)


@given(
    levels=st.lists(st.lists(things, min_size=1, max_size=4), min_size=1, max_size=4),
    wind=st.floats(-2, 2) | st.just(-0.0),
    floor=st.floats(0, 1e6),
    drawn=numbers,
    named=st.none() | st.text(max_size=5).filter(str.isprintable),
)
@settings(max_examples=25, deadline=None)
def test_levels_of_any_entities_are_kept_to_the_bit(levels, wind, floor, drawn, named, tmp_path_factory):
    made = Levels.from_entities(levels, {Wind: wind, FloorFriction: floor, Gravity: -0.0}, name=named)
    column = made.layout.columns[Position]
    sampled = made.sampled_values.copy()
    sampled[0, 0, column] = drawn  # as where overlaps were fixed
    made = dataclasses.replace(made, sampled_values=sampled)
    assert_kept(made, tmp_path_factory.mktemp("levels"))


def test_a_level_is_written_as_a_person_would(tmp_path):
    ball = GolfBall({Position: (-0.0, 0.25), Mass: 2.0, Size: 0.2, Shape: Circle(0.2)})
    patch = Tile({Position: (0.5, 0.5), Shape: ConvexHull([(0, 0), (0.3, 0), (0, 0.3)], 0.3)})
    data = in_json(Levels.from_entities([[ball, patch], [ball]], {Wind: 0.125}), tmp_path)
    assert list(data) == ["format", "version", "description", "levels"]
    assert (data["format"], data["version"]) == ("segar-levels", 1)
    first, second = data["levels"]
    assert (first["index"], second["index"]) == (0, 1) and first["parameters"]["Wind"] == 0.125
    assert list(second["entities"]) == ["golfball", "global_friction"]
    found = second["entities"]["golfball"]
    assert found["type"] == "GolfBall" and found["shape"] == "circle" and set(found) == {"type", "shape", "factors"}
    assert found["factors"]["Position"] == [0.0, 0.25] and str(found["factors"]["Position"][0]) == "-0.0"
    assert found["factors"]["Mass"] == 2.0 and "Friction" not in found["factors"]
    assert first["entities"]["tile"]["shape"] == "hull" and len(first["entities"]["tile"]["vertices"]) == 3
    assert second["entities"]["global_friction"]["shape"] is None
    lines = (tmp_path / "given.json").read_text().splitlines()
    assert sum('"golfball": {' in line for line in lines) == 2


def test_only_values_that_were_moved_are_given_as_they_were_drawn(tmp_path):
    levels = segar.family("objectsx3-hard").sample(20, seed=0)
    for i, level in enumerate(in_json(levels, tmp_path)["levels"]):
        for name, entity in level["entities"].items():
            slot = levels.layout.slot_index(name)
            for factor, column in levels.layout.columns.items():
                part = np.s_[i, slot, column : column + factor.width]
                differs = levels.values[part].tobytes() != levels.sampled_values[part].tobytes()
                assert differs == (factor.__name__ in entity.get("sampled", {}))
            assert entity.get("sampled") != {}


def written(folder: Path, data: dict) -> Path:
    (folder / "x.json").write_text(json.dumps(data))
    return folder / "x.json"


def test_what_people_need_not_write_has_its_default(tmp_path):
    ball = GolfBall({Position: (0.5, 0.25)})
    levels = Levels.from_entities([[ball, GoalTile({Position: (-0.5, 0)})]] * 2, {FloorFriction: [0.05, 0.3]})
    data = in_json(levels, tmp_path)
    for level in data["levels"]:
        del level["index"], level["entities"]["global_friction"]
        level["parameters"] = {n: x for n, x in level["parameters"].items() if n == "FloorFriction"}
    for part in ("version", "provenance", "task", "rules", "factors", "extra_parameters", "moments"):
        del data["description"][part]
    assert_same(Levels.load(written(tmp_path, data)), levels)


def test_the_file_that_the_documentation_shows_is_read(tmp_path):
    page = (ROOT / "docs/reference/files.md").read_text()
    (tmp_path / "x.json").write_text(page.partition("```json\n")[2].partition("```")[0])
    found = Levels.load(tmp_path / "x.json")
    ball = GolfBall({Position: (0.25, -0.5), Size: 0.2, Shape: Circle(0.2), segar.language.ID: "golfball"})
    expected = Levels.from_entities([[ball]])
    assert np.array_equal(found.values, expected.values, equal_nan=True) and found.provenance.indices.tolist() == [17]
    drawn = found.sampled_values[0, 0, found.layout.columns[Position] :][:2]
    assert drawn.tolist() == [0.3, -0.5]


def test_whole_numbers_stand_for_the_same_floats(tmp_path):
    data = in_json(LEVELS, tmp_path)
    ball = data["levels"][0]["entities"]["golfball"]["factors"]
    ball["Mass"], ball["Charge"], ball["Position"] = 2, "CHARGE", [0, "ZERO"]
    text = json.dumps(data).replace('"CHARGE"', "100000000000000000000").replace('"ZERO"', "-0")
    (tmp_path / "x.json").write_text(text)
    found = Levels.load(tmp_path / "x.json")
    row = found.values[0, found.layout.slot_index("golfball")]
    assert row[found.layout.columns[Mass]] == 2.0 and row[found.layout.columns[segar.Charge]] == 1e20
    place = row[found.layout.columns[Position] :][:2]
    assert place.tolist() == [0.0, 0.0] and np.signbit(place).tolist() == [False, True]


BALL = "levels/2/entities/golfball"
FLOOR = "levels/1/entities/global_friction"
GOAL = {"type": "GoalTile", "factors": {}}
# What is edited, to which value, where ``...`` deletes it; where the message says that something is wrong, empty for the whole
# file, and what it names.
WRONG = {
    "a factor misspelt": (f"{BALL}/factors/Mas", 1.0, f"{BALL}/factors", "'Mas'.*'Mass'"),
    "a factor of others": (f"{BALL}/factors/Heat", 1.0, f"{BALL}/factors", "has no 'Heat'"),
    "a factor absent": (f"{BALL}/factors/Mass", ..., f"{BALL}/factors", "'Mass' is absent.*GolfBall"),
    "a truth for a number": (f"{BALL}/factors/Mass", True, f"{BALL}/factors/Mass", "list of float, not True"),
    "NaN": (f"{BALL}/factors/Mass", np.nan, f"{BALL}/factors/Mass", "list of float, not nan"),
    "Infinity": (f"{BALL}/factors/Position", [0.0, np.inf], f"{BALL}/factors/Position[1]", "float, not inf"),
    "two numbers for one": (f"{BALL}/factors/Mass", [1.0, 2.0], f"{BALL}/factors/Mass", "a number, not a list of 2"),
    "a mass that cannot be": (f"{BALL}/factors/Mass", -1.0, "level 2", "Mass of 'golfball' is -1"),
    "a drawn factor of others": (f"{BALL}/sampled", {"Heat": 1.0}, f"{BALL}/sampled", "has no 'Heat'"),
    "another type": (f"{BALL}/type", "Golfball", f"{BALL}/type", "GolfBall, not 'Golfball'"),
    "another shape": (f"{BALL}/shape", "square", f"{BALL}/shape", "'circle' or 'hull', not 'square'"),
    "a shape of the floor": (f"{FLOOR}/shape", "circle", f"{FLOOR}/shape", "null.*GlobalFriction"),
    "a hull without vertices": (f"{BALL}/shape", "hull", f"{BALL}/vertices", "3 to 32767 places.*there are 0"),
    "vertices of a circle": (f"{BALL}/vertices", [[0, 0], [1, 0], [0, 1]], f"{BALL}/vertices", "hulls"),
    "an entity misspelt": ("levels/1/entities/golfbal", GOAL, "levels/1/entities", "'golfbal'.*'golfball'"),
    "an entity absent": (BALL, ..., "levels/2/entities", "'golfball' is absent"),
    "a parameter misspelt": ("levels/1/parameters/Gravitiy", 1.0, "levels/1/parameters", "'Gravitiy'.*'Gravity'"),
    "a parameter that cannot be": ("levels/1/parameters/Gravity", -1.0, "level 1", "Gravity is -1"),
    "a key of a level misspelt": ("levels/0/paramters", {}, "levels/0/paramters", "not known.*'parameters'"),
    "an index below 0": ("levels/0/index", -1, "level 0", "index in the split is -1, below 0"),
    "an index that is no int64": ("levels/0/index", 2**63, "levels/0/index", "int, not 9.2"),
    "no levels": ("levels", [], "levels", "at least one level, and is empty"),
    "a level that is none": ("levels/1", 3, "levels/1", "a mapping, not 3"),
    "another floor": ("levels/1/parameters/FloorFriction", 0.5, f"{FLOOR}/factors/Friction", "FloorFriction is 0.5"),
    "a format of others": ("format", "segar-play", "", "'format' is 'segar-levels'"),
    "a later version": ("version", 2, "", "version 2 of its format"),
    "a type that is not defined": ("description/types/0/name", "Chargr", "", "entity type 'Chargr'"),
    "lines in a name": ("description/slots/0/name", "a\nb", "description", r"'a\\nb' has characters"),
    "room for very many vertices": ("description/most_vertices", 10**9, "description/most_vertices", "1000000000"),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_does_not_belong_into_a_level_file_is_refused_with_its_place(what, tmp_path):
    edited, value, place, named = WRONG[what]
    data = in_json(LEVELS, tmp_path)
    *parents, last = [int(part) if part.isdecimal() else part for part in edited.split("/")]
    at(data, tuple(parents))[last] = value
    if value is ...:
        del at(data, tuple(parents))[last]
    with pytest.raises(LevelError) as caught:
        Levels.load(written(tmp_path, data))
    said = re.sub(r"/(\d+)", r"[\1]", place).replace("/", ".")
    said = rf"x.json: (?:{re.escape(said)}:|'{re.escape(said)}') " if said else "x.json"
    assert re.search(rf"{said}.*{named}", str(caught.value))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"format": "segar-levels",\n "version" 1}', r"x.json is not .*: Expecting ':' .*line 2 column 12"),
        ('{"format": "segar-levels", "format": 1}', r"x.json .*: the key 'format' stands twice in one mapping"),
        ("[" * 100 + "]" * 100, r"x.json is not a level file in JSON, .*; there is a list of 1"),
    ],
)
def test_a_text_that_is_no_json_is_refused_with_line_and_column(text, message, tmp_path):
    (tmp_path / "x.json").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(LevelError, match=message):
        Levels.load(tmp_path / "x.json")


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(LevelError, match=r"there is no level file .*x.json"):
        Levels.load(tmp_path / "x.json")
    (tmp_path / "x.json").mkdir()
    with pytest.raises(LevelError, match=r"x.json is no level file: it is a folder"):
        Levels.load(tmp_path / "x.json")


def test_a_level_file_with_other_contents_is_refused_or_the_same_levels(tmp_path):
    """Every part in turn is something else: nothing ends in another error, and nothing else is read in silence."""
    levels = segar.family("tilesx1-easy").sample(1, seed=0)
    data = in_json(levels, tmp_path)
    del data["description"]["moments"][2:]

    def files():
        for what, changed in crafted_descriptions(data):
            yield what, json.dumps(changed).encode()
        for depth in range(900, 1000, 7):
            nested = json.dumps(data).replace('"GolfBall", "shape"', f'{"[" * depth}{"]" * depth}, "shape"')
            yield f"a type nested {depth} times", nested.encode()
        yield from crafted_texts()

    def is_harmless(found):  # numbers of levels, and what says where they come from, may be others
        slots = [[(slot.name, slot.types) for slot in one.layout.slots] for one in (found, levels)]
        return slots[0] == slots[1] and len(found) == 1

    assert_clean_errors(files(), tmp_path / "x.json", lambda: Levels.load(tmp_path / "x.json"), is_harmless)


def test_a_short_text_that_stands_for_very_many_numbers_is_refused(tmp_path):
    data = in_json(LEVELS, tmp_path)
    hull = [[np.cos(a), np.sin(a)] for a in np.linspace(0, 6, 3000)]
    tile = next(e for e in data["levels"][0]["entities"].values() if e["shape"] == "hull")
    tile["vertices"] = hull
    data["levels"] += data["levels"][1:] * 400
    path = written(tmp_path, data)
    with pytest.raises(LevelError, match=r"x.json: this level file of .* bytes would expand to .*SEGAR_FILE_LIMIT to"), pytest.MonkeyPatch.context() as patch:  # fmt: skip  # noqa: E501
        patch.setenv("SEGAR_FILE_LIMIT", "100")
        Levels.load(path)


def test_levels_that_could_not_be_read_again_are_not_written(tmp_path):
    values = LEVELS.values.copy()
    values[1, -1, LEVELS.layout.columns[segar.Friction]] = 0.75
    floor = dataclasses.replace(LEVELS, values=values)
    with pytest.raises(LevelError, match=r"x.json: levels\[1\].*Friction: is 0.75, and .*FloorFriction is 0.05"):
        floor.save(tmp_path / "x.json")
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["objectsx3-hard", "puttputt", "billiards"])
def test_files_fit_the_schema_and_what_is_refused_does_not(name, tmp_path):
    levels = segar.family(name).sample(2, seed=0)
    data = in_json(levels, tmp_path)
    any_level, of_layout = (
        jsonschema.Draft202012Validator(one) for one in (level_schema(), level_schema(levels.layout))
    )
    for validator in (any_level, of_layout):
        validator.check_schema(validator.schema)
        validator.validate(data)
    entity = next(iter(data["levels"][1]["entities"].values()))
    entity["factors"]["Mas"] = 1.0
    assert not of_layout.is_valid(data)
    del entity["factors"]["Mas"], data["levels"][1]["entities"]
    assert not any_level.is_valid(data)
