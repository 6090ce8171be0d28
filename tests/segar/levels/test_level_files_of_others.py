"""Level files that others made are data: each is read as it is meant, or refused with its name and what is wrong."""

import dataclasses
import io
import json
import tracemalloc

import numpy as np
import pytest

import segar
from segar.errors import LevelError
from segar.levels import Levels, check_levels
from tests.crafted import (
    as_member,
    assert_clean_errors,
    crafted_archives,
    crafted_metadata,
    crafted_sizes,
    flipped,
    members_of,
    with_array,
    zipped,
)

LEVELS = segar.family("puttputt").sample(3, seed=0)  # things that may be absent, hulls and circles
NAMES = LEVELS.layout.names


@pytest.fixture
def saved(tmp_path):
    LEVELS.save(tmp_path / "levels.npz")
    return tmp_path / "levels.npz"


def other_numbers():
    """Arrays of the right form in which one number cannot be: name of the array, the number, where it is put."""
    absent = np.argwhere(LEVELS.types < 0)[0]
    hull, no_hull = np.argwhere(LEVELS.shape_kind == 2)[0], np.argwhere(LEVELS.shape_kind != 2)[0]
    ball = (0, NAMES.index("golfball"))
    columns = LEVELS.layout.columns
    for number in (-2, -32768, len(LEVELS.layout.types), 32767):
        yield "types", number, (0, 0)
    yield "types", -1, ball
    yield "types", int(LEVELS.types[ball]), tuple(absent)
    for number in (-1, 3, 127, -128):
        yield "shape_kind", number, ball
    yield "shape_kind", 1, tuple(absent)
    for number in (-1, 0, 2, LEVELS.vertices.shape[2] + 1, 32767, -32768):
        yield "vertex_count", number, tuple(hull)
    yield "vertex_count", 3, tuple(no_hull)
    for number in (np.nan, np.inf, -np.inf, 1e300):
        yield "vertices", number, (*hull, 0, 0)
        yield "parameters", number, (0, 0)
        for array in ("values", "sampled_values"):
            yield array, number, (*ball, columns[segar.Mass])
            yield array, number, (*ball, columns[segar.Position] + 1)
    yield "parameters", -1.0, (0, 0)
    for factor, number in ((segar.Mass, -1.0), (segar.Size, 0.0), (segar.Size, -0.2), (segar.language.Alive, 0.5)):
        yield "values", number, (*ball, columns[factor])
    yield "values", 1.0, (*absent, 0)
    yield "indices", -1, (0,)


def with_other_numbers(path):
    with np.load(path) as archive:
        arrays = dict(archive)
    for name, number, place in other_numbers():
        array = arrays[name].copy()
        array[place] = number
        yield f"{name}{list(place)} = {number}", with_array(path, name, array)


def with_other_sizes(path):
    """Archives in which one array is of more or fewer levels, or has more columns, than the others."""
    yield from crafted_sizes(path)
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files if name != "metadata"}
    for name, array in arrays.items():
        if array.ndim > 1 and name != "vertices":
            wider = np.concatenate([array, array[..., -1:]], axis=-1)
            yield f"{name} with one more column", with_array(path, name, wider)
    none = [(f"{name}.npy", as_member(array[:0])) for name, array in arrays.items()]
    yield "no levels at all", zipped([*none, ("metadata.npy", members_of(path)["metadata.npy"])])


@pytest.mark.parametrize("crafted", [crafted_archives, with_other_numbers, with_other_sizes])
def test_a_level_file_that_was_spoilt_is_refused(saved, crafted):
    assert_clean_errors(crafted(saved), saved, lambda: Levels.load(saved))


def test_a_level_file_with_another_description_is_refused_or_still_fits_its_arrays(saved):
    def is_harmless(found):
        check_levels(found)
        same = [name for name in ("values", "types", "vertices") if getattr(found, name) is not None]
        return all(np.array_equal(getattr(found, n), getattr(LEVELS, n), equal_nan=n == "values") for n in same)

    assert_clean_errors(crafted_metadata(saved), saved, lambda: Levels.load(saved), is_harmless)


def test_changed_bytes_of_a_level_file_are_found_or_change_nothing(saved):
    arrays = [name for name in vars(LEVELS) if isinstance(getattr(LEVELS, name), np.ndarray)]

    def is_harmless(found):
        return found.layout == LEVELS.layout and all(
            getattr(found, name).tobytes() == getattr(LEVELS, name).tobytes() for name in arrays
        )

    assert_clean_errors(flipped(saved, 500), saved, lambda: Levels.load(saved), is_harmless)


def test_arrays_in_fortran_order_are_the_same_levels(saved):
    saved.write_bytes(with_array(saved, "values", np.asfortranarray(LEVELS.values)))
    assert Levels.load(saved) == LEVELS and Levels.load(saved).values.flags.c_contiguous


def bomb(path) -> int:
    """Put room for so many vertices into the file that its arrays take more than the limit; return how many bytes."""
    shape = (*LEVELS.vertices.shape[:2], 850_000, 2)
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": shape})
    size = int(np.prod(shape)) * 8
    others = {name: content for name, content in members_of(path).items() if name != "vertices.npy"}
    path.write_bytes(zipped([*others.items(), ("vertices.npy", header.getvalue() + bytes(size))]))
    return size


def test_a_small_file_that_would_expand_to_hundreds_of_megabytes_is_not_expanded(saved):
    size = bomb(saved)
    assert saved.stat().st_size < size / 100 and size > 256 * 2**20
    tracemalloc.start()
    with pytest.raises(LevelError, match=r"levels.npz: this level file of .* bytes would expand to .*SEGAR_FILE_LIMIT"):
        Levels.load(saved)
    assert tracemalloc.get_traced_memory()[1] < 20e6
    tracemalloc.stop()


def test_the_limit_of_files_is_set_by_an_environment_variable(saved, monkeypatch):
    monkeypatch.setenv("SEGAR_FILE_LIMIT", "0")
    with pytest.raises(LevelError, match=r"would expand to [\d,]+, more than 0.*SEGAR_FILE_LIMIT to 1 \(megabytes\)"):
        Levels.load(saved)
    monkeypatch.setenv("SEGAR_FILE_LIMIT", "1")
    assert Levels.load(saved) == LEVELS
    monkeypatch.setenv("SEGAR_FILE_LIMIT", "lots")
    with pytest.raises(segar.SegarError, match="SEGAR_FILE_LIMIT is a number of megabytes, such as 4000, not 'lots'"):
        Levels.load(saved)


@pytest.mark.parametrize(
    ("factor", "value", "message"),
    [
        (segar.Mass, -1.0, "Mass of 'golfball' is -1 and must be a number that is not negative, at most 1e"),
        (segar.Position, np.nan, "Position of 'golfball' is nan, nan and must be a finite number"),
        (segar.language.Order, 0.5, "Order of 'golfball' is 0.5 and must be a whole number"),
    ],
)
def test_environments_refuse_levels_with_numbers_that_cannot_be(factor, value, message):
    column, values = LEVELS.layout.columns[factor], LEVELS.values.copy()
    values[1, NAMES.index("golfball"), column : column + factor.width] = value
    levels = dataclasses.replace(LEVELS, values=values)
    with pytest.raises(LevelError, match=f"^level 1: {message}"):
        segar.envs.VectorEnv(levels, 2)


def test_the_bounds_that_a_factor_declares_hold_for_levels_made_by_hand():
    class Fuel(segar.Scalar, default=0.5, bounds=(0.0, 1.0)): ...

    class Rocket(segar.Object):
        fuel: Fuel = 0.5

    with pytest.raises(LevelError, match=r"level 1: Fuel of 'object' is 2 and must be a finite number from 0 to 1"):
        Levels.from_entities([[Rocket()], [Rocket({Fuel: 2.0})]])


@pytest.mark.parametrize("kind", ["json", "npz"])
def test_a_class_of_the_user_never_stands_for_a_built_in_one_nor_the_other_way_round(tmp_path, kind):
    """Also where it has the same name and the same factors."""
    path = tmp_path / f"levels.{kind}"

    def saved_as(module):
        LEVELS.save(path)
        if kind == "json":
            path.write_text(path.read_text().replace('"segar.language.entities"', f'"{module}"'))
        else:
            text = members_of(path)["metadata.npy"][128:].replace(b'"segar.language.entities"', f'"{module}"'.encode())
            path.write_bytes(with_array(path, "metadata", np.frombuffer(text, np.uint8)))
        return path

    assert Levels.load(saved_as("segar.moved_since")) == LEVELS, "modules of SEGAR may move"
    for module in ("my_lab.golf", "nowhere.at.all", "__main__", "segarlike", ""):
        with pytest.raises(LevelError, match=rf"levels.{kind}: it holds the entity type '\w+' of {module}, and here"):
            Levels.load(saved_as(module))


def test_a_class_of_the_user_s_is_found_where_its_module_moved_and_is_not_taken_for_a_built_in_one(tmp_path):
    class GolfBall(segar.GolfBall):
        """Another thing of a built-in name."""

    levels = Levels.from_entities([[GolfBall({segar.Position: [0.0, 0.0]})]])
    levels.save(tmp_path / "own.json")
    assert Levels.load(tmp_path / "own.json").layout.types[0] is GolfBall
    GolfBall.__module__ = "moved.since"
    assert Levels.load(tmp_path / "own.json").layout.types[0] is GolfBall
    segar.family("empty-easy").sample(1).save(tmp_path / "theirs.json")
    assert segar.GolfBall in Levels.load(tmp_path / "theirs.json").layout.types
    GolfBall.__name__ = "GoneSince"  # so that no other test meets it
    with pytest.raises(LevelError, match=r"it holds the entity type 'GolfBall' of \S*test"):
        Levels.load(tmp_path / "own.json")


@pytest.mark.parametrize("split", ["", "../../x", "a/b", "/etc", "..", ".", " ", "a\0b", "a\nb", "x" * 1000, 3])
def test_a_split_is_a_word_which_can_be_a_part_of_the_name_of_a_file(tmp_path, split):
    with pytest.raises(LevelError, match="the split must be a word such as 'train' or 'test'"):
        segar.family("empty-easy").sample(1, split=split)
    if split and isinstance(split, str):
        data = json.loads(text_of(tmp_path / "levels.json"))
        data["description"]["provenance"]["split"] = split
        (tmp_path / "levels.json").write_text(json.dumps(data))
        with pytest.raises(LevelError, match=r"levels.json: (provenance.split: .* names no split|description: )"):
            Levels.load(tmp_path / "levels.json")


def text_of(path):
    """The text of a level file in JSON, which is written there."""
    LEVELS.save(path)
    return path.read_text()


@pytest.mark.parametrize("ending", [".json", ".npz"])
@pytest.mark.parametrize("around", ['"""', "'''", "\\N{"])
def test_the_name_of_an_entity_is_no_code(around, ending, tmp_path):
    there = tmp_path / "there"
    name = f"x{around}; open({str(there)!r}, 'w'); {around}"
    goal = segar.GoalTile({segar.Position: (0.5, 0.5)})
    levels = Levels.from_entities([[segar.GolfBall({segar.language.ID: name}), goal]])
    levels.save(tmp_path / f"levels{ending}")
    env = segar.envs.Env(Levels.load(tmp_path / f"levels{ending}"))
    env.reset()
    env.step(np.zeros(2, np.float32))
    assert name in env.levels.layout.names
    assert not there.exists()


def test_a_name_that_cannot_be_printed_is_refused():
    for name in ("a\nb", "\0", "\ud800", "\u202e"):
        with pytest.raises(LevelError, match="characters that cannot be printed; give it another ID"):
            Levels.from_entities([[segar.GolfBall({segar.language.ID: name})]])
