"""Rows as data: what is written is read, pieces are added one after the other, and everything that was edited is refused."""

import dataclasses
import json
import os

import numpy as np
import pyarrow as pa
import pytest

from segar.experiments.benchmarking.row import (
    EPISODES,
    MEANS,
    ROW,
    TABLE,
    Method,
    NewPiece,
    Piece,
    add_pieces,
    read_row,
    row_of,
)
from segar.experiments.settings import RunFolderError

METHOD = Method("mine", "networks", "a method", "laptop", 100, {"observation": {"name": "state", "options": {}}})


def episodes_of(suite, seed, returns):
    n = len(returns)
    columns = {"suite": [suite] * n, "seed": [seed] * n, "levels": ["test"] * n, "level": range(n), "return": returns}
    return pa.table(columns | {"length": [1] * n, "success": [True] * n, "death": [False] * n}, EPISODES)


def piece_of(folder, suite="a-v1", seed=1, returns=(0.5, 0.25), content=b"weights"):
    folder.mkdir(exist_ok=True)
    path = folder / f"{suite}-{seed}"
    path.write_bytes(content)
    piece = Piece(suite, "0123", seed, {"test": "4567"}, "run", f"{suite}-s{seed}.npz", 32, {"python": "3"})
    return NewPiece(piece, episodes_of(suite, seed, list(returns)), path)


@pytest.fixture
def row(tmp_path):
    return add_pieces(
        tmp_path / "rows" / "mine", METHOD, [piece_of(tmp_path / "new"), piece_of(tmp_path / "new", seed=2)]
    )


def test_a_row_is_read_as_it_was_written(row):
    again = read_row(row.folder)
    assert again == row and again.method == METHOD
    assert [(one.suite, one.seed) for one in again.pieces] == [("a-v1", 1), ("a-v1", 2)]
    assert again.episodes()["return"].to_pylist() == [0.5, 0.25] * 2


def test_pieces_in_any_order_and_in_any_number_of_steps_make_the_same_row(tmp_path):
    new = [piece_of(tmp_path / "new", suite, seed, [seed / 7]) for suite in ("a-v1", "b-v1") for seed in (1, 2, 3)]
    whole = add_pieces(tmp_path / "whole" / "mine", METHOD, new)
    for k in np.random.default_rng(0).permutation(len(new)):
        step_by_step = add_pieces(tmp_path / "steps" / "mine", METHOD, [new[k]])
    assert step_by_step.hash == whole.hash and step_by_step.episodes() == whole.episodes()


def test_a_piece_replaces_that_of_the_same_suite_and_seed(row, tmp_path):
    changed = add_pieces(row.folder, METHOD, [piece_of(tmp_path / "new", seed=2, returns=[0.125], content=b"others")])
    assert changed.episodes()["return"].to_pylist() == [0.5, 0.25, 0.125] and changed.hash != row.hash
    assert (row.folder / "a-v1-s2.npz").read_bytes() == b"others"


@pytest.mark.parametrize("name", ["a-v1-s1.npz", TABLE])
def test_an_edited_file_is_refused_and_named(row, name):
    path = row.folder / name
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(content)
    with pytest.raises(RunFolderError, match=f"{name} is not what the row was made of: its hash is"):
        read_row(row.folder)


def test_every_edit_of_the_description_is_refused(row):
    path = row.folder / ROW
    data = json.loads(path.read_text())
    for key in data:
        changed = {**data, key: {"str": "x", "int": 3, "list": [], "dict": {}}[type(data[key]).__name__]}
        if changed != data:
            path.write_text(json.dumps(changed))
            with pytest.raises(RunFolderError, match=r"row\.json"):
                read_row(row.folder)


def test_files_that_are_missing_or_too_many_are_named(row):
    (row.folder / "more.npz").touch()
    with pytest.raises(RunFolderError, match=r"the file more\.npz is not part of the row"):
        read_row(row.folder)
    (row.folder / "more.npz").unlink()
    (row.folder / TABLE).unlink()
    with pytest.raises(RunFolderError, match=rf"the file {TABLE} is not here; `segar results fetch`"):
        read_row(row.folder)


def test_a_row_without_some_of_its_files_stays_the_same_row_and_can_be_added_to(row, tmp_path):
    (row.folder / "a-v1-s2.npz").unlink()
    there = read_row(row.folder)
    assert there.hash == row.hash and there.lacks == {"a-v1-s2.npz"}
    more = add_pieces(row.folder, METHOD, [piece_of(tmp_path / "new", seed=3)])
    assert more.lacks == {"a-v1-s2.npz"} and more.files["a-v1-s2.npz"] == row.files["a-v1-s2.npz"]


def test_of_levels_that_were_played_several_times_the_means_can_stand_for_the_episodes(tmp_path):
    played = episodes_of("a-v1", 1, [0.5, 0.25])
    again = dataclasses.replace(piece_of(tmp_path / "new"), episodes=pa.concat_tables([played, played]))
    row = add_pieces(tmp_path / "rows" / "mine", METHOD, [again])
    (row.folder / TABLE).unlink()
    there = read_row(row.folder)
    assert there.hash == row.hash and there.results()["return"].to_pylist() == [0.5, 0.25]
    with pytest.raises(RunFolderError, match=f"{TABLE} is not here"):
        there.episodes()
    (row.folder / MEANS).write_bytes(b"other")
    with pytest.raises(RunFolderError, match=f"{MEANS} is not what the row was made of"):
        read_row(row.folder)


@pytest.mark.parametrize("after", range(8))
def test_what_a_process_that_was_killed_left_of_new_pieces_is_done_again_or_finished(row, tmp_path, monkeypatch, after):
    new, moved, move = [piece_of(tmp_path / "new", seed=seed) for seed in (2, 3)], [], os.replace

    def killed(*where):
        if len(moved) == after:
            raise KeyboardInterrupt
        moved.append(move(*where))

    monkeypatch.setattr(os, "replace", killed)
    with pytest.raises(KeyboardInterrupt):
        add_pieces(row.folder, METHOD, new)
    monkeypatch.undo()
    if after <= 4:  # two files, the table and the description are written before the first of them is moved
        assert read_row(row.folder) == row
    whole = add_pieces(tmp_path / "mine", METHOD, [piece_of(tmp_path / "new"), *new])
    assert add_pieces(row.folder, METHOD, new).hash == whole.hash
    assert not [path for path in row.folder.iterdir() if path.is_dir()]


def test_the_row_of_another_method_is_not_added_to(row):
    other = dataclasses.replace(METHOD, settings={"observation": {"name": "rgb", "options": {}}})
    with pytest.raises(RunFolderError, match=r"settings\.observation\.name is 'state' there and 'rgb' here.*row="):
        row_of(row.folder, other)


def test_a_folder_that_holds_something_else_becomes_no_row(tmp_path):
    own = tmp_path / "rows" / "mine" / "own.npz"
    own.parent.mkdir(parents=True)
    own.write_bytes(b"mine")
    with pytest.raises(RunFolderError, match=r"holds no row but own\.npz; name another folder"):
        add_pieces(own.parent, METHOD, [piece_of(tmp_path / "new")])
    assert [*own.parent.iterdir()] == [own]


def test_files_in_other_folders_are_refused(row):
    path = row.folder / ROW
    path.write_text(path.read_text().replace("a-v1-s1.npz", "../a-v1-s1.npz"))
    with pytest.raises(RunFolderError, match="in no other folder"):
        read_row(row.folder)
