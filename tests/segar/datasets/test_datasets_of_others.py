"""Datasets that others made are data: each is read as it is meant, or refused with its place and what is wrong."""

import hashlib
import json
import shutil

import numpy as np
import pytest
from pyarrow import parquet, table

import segar
from segar.datasets import Dataset, record
from tests.crafted import assert_clean_errors, crafted_archives, crafted_descriptions, crafted_texts, flipped

TABLE, OBSERVATIONS = "shard-00000.parquet", "shard-00000.npz"


@pytest.fixture(scope="module")
def made(tmp_path_factory, levels):
    """Two episodes of at most two steps in one shard, with few numbers in each file; nobody writes to it."""
    folder = tmp_path_factory.mktemp("made") / "data"
    return record(folder, levels, episodes=2, max_steps=2, observation="state").folder


@pytest.fixture
def folder(made, tmp_path):
    return shutil.copytree(made, tmp_path / "data")


def sign(folder, name):
    """Write the hash of a shard's file into the manifest, as who made the file on purpose would."""
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["shards"]["0"]["files"][name] = hashlib.sha256((folder / name).read_bytes()).hexdigest()
    (folder / "manifest.json").write_text(json.dumps(manifest))


def rewrite(folder, **changes):
    """Replace or remove (None) columns of the table."""
    columns = {name: column.to_numpy() for name, column in _columns(folder).items()} | changes
    parquet.write_table(table({n: c for n, c in columns.items() if c is not None}), folder / TABLE)


def _columns(folder):
    found = parquet.read_table(folder / TABLE)
    return {name: found[name] for name in found.column_names}


def test_a_manifest_with_other_entries_is_refused_or_leads_to_the_same_episodes(folder):
    path = folder / "manifest.json"
    whole = json.loads(path.read_text())

    def load():
        dataset = Dataset.load(folder)
        shards = list(dataset)
        return dataset, shards

    def is_harmless(found):
        return [len(shard.rollouts) for shard in found[1]] == [whole["shards"]["0"]["rows"]]

    files = [(what, json.dumps(changed).encode()) for what, changed in crafted_descriptions(whole)]
    for what, content in [*files, *crafted_texts()]:
        path.write_bytes(content)
        try:
            assert is_harmless(load()), what
        except segar.SegarError as error:
            assert str(folder) in str(error) and "\n" not in str(error), what


@pytest.mark.parametrize("name", ["../outside.npz", "/etc/passwd", "shard-00001.npz", "a/../shard-00000.npz"])
def test_a_manifest_that_names_files_elsewhere_is_refused(folder, name):
    path = folder / "manifest.json"
    manifest = json.loads(path.read_text())
    files = manifest["shards"]["0"]["files"]
    files[name] = files.pop(OBSERVATIONS)
    path.write_text(json.dumps(manifest))
    with pytest.raises(segar.SegarError, match=r"shard 0 must have the files .* and no others; restore it"):
        Dataset.load(folder)


def test_other_levels_than_those_that_were_recorded_are_refused(folder, levels):
    segar.family("objectsx1-hard").sample(3, seed=1).save(folder / "levels.npz")
    with pytest.raises(segar.SegarError, match=r"levels.npz holds other levels than those that were recorded"):
        Dataset.load(folder)
    levels.save(folder / "levels.npz")
    assert Dataset.load(folder).levels == levels


def spoilt_tables(folder):
    """Tables with other columns, or other numbers in these."""
    columns = {name: column.to_numpy() for name, column in _columns(folder).items()}
    for name, column in columns.items():
        if name != "action.1":  # how many components an action has, the manifest does not say
            yield f"{name} missing", {name: None}
        yield f"{name} as text", {name: column.astype(str)}
        yield f"{name} of another type", {name: np.zeros(len(column), np.int16)}
    rows = len(columns["step"])
    for name, numbers in (("level", (-1, 3, 2**62)), ("step", (-1, 5, 2**62)), ("episode", (-1, 7))):
        for number in numbers:
            yield f"{name} {number}", {name: np.full(rows, number)}
            yield f"{name} {number} at last", {name: np.append(columns[name][:-1], number)}
    yield "fewer rows", {name: column[:-1] for name, column in columns.items()}
    yield "more rows", {name: np.append(column, column[-1:]) for name, column in columns.items()}
    yield "no rows", {name: column[:0] for name, column in columns.items()}
    yield "another column", {"more": np.zeros(rows)}


def test_a_table_that_was_spoilt_is_refused_although_its_hash_is_right(folder):
    whole = (folder / TABLE).read_bytes()
    for what, changes in list(spoilt_tables(folder)):
        (folder / TABLE).write_bytes(whole)
        rewrite(folder, **changes)
        sign(folder, TABLE)
        with pytest.raises(segar.SegarError, match=TABLE):
            Dataset.load(folder).shard(0)
            pytest.fail(what)


def test_changed_bytes_of_a_table_are_found_or_it_is_read(folder):
    path = folder / TABLE

    def load():
        sign(folder, TABLE)
        return Dataset.load(folder).shard(0)

    assert_clean_errors(flipped(path, 150), path, load, lambda shard: shard.rollouts.step.dtype == np.int64)


def test_observations_that_were_spoilt_are_refused_although_their_hash_is_right(folder):
    path = folder / OBSERVATIONS

    def load():
        sign(folder, OBSERVATIONS)
        return Dataset.load(folder).shard(0)

    assert_clean_errors(crafted_archives(path), path, load)
