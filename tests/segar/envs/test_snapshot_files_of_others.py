"""Snapshot files that others made are data: each is read as it is meant, or refused with its name and what is wrong."""

import numpy as np
import pytest

import segar
from segar.envs import Snapshot, VectorEnv
from segar.errors import SegarError
from segar.observations import Stack
from tests.crafted import assert_clean_errors, crafted_archives, crafted_metadata, crafted_sizes, flipped, with_array

LEVELS = segar.family("empty-hard").sample(4, seed=0)


@pytest.fixture(scope="module")
def env():
    env = VectorEnv(LEVELS, 3, observation=Stack("state", 2), seed=0)
    env.reset()
    env.step(np.zeros((3, 2), np.float32))
    return env


@pytest.fixture
def saved(env, tmp_path):
    env.state().save(tmp_path / "snapshot.npz")
    return tmp_path / "snapshot.npz"


def restored(env, path):
    """What an environment goes on from; the message of a refusal begins with the file."""
    snapshot = Snapshot.load(path)
    try:
        env.restore(snapshot)
    except SegarError as error:
        raise SegarError(f"{path}: {error}") from error
    env.step(np.zeros((3, 2), np.float32))
    return snapshot


def with_other_numbers(path):
    """Snapshots with a number that cannot be."""
    with np.load(path) as archive:
        arrays = dict(archive)
    for name in ("level", "tick", "contacts", "unresolved_contacts", "lengths", "episodes"):
        for number in (-1, -(2**63)):
            yield f"{name} {number}", with_array(path, name, np.array([0, number, 0]))
    for number in (len(LEVELS), 2**62):
        yield f"level {number}", with_array(path, "level", np.array([0, number, 0]))
    for number in (np.nan, np.inf):
        values = arrays["values"].copy()
        values[1, 0, LEVELS.layout.columns[segar.Mass]] = number
        yield f"values {number}", with_array(path, "values", values)
    values = arrays["values"].copy()
    values[np.isnan(values)] = 0.0
    yield "values where there are none", with_array(path, "values", values)


def with_other_sizes(path):
    """Snapshots in which one array is of more or fewer environments than the others, or of other columns."""
    yield from crafted_sizes(path)
    values = Snapshot.load(path).state.values
    for what, other in (("columns", values[:, :, :-1]), ("entities", values[:, :-1])):
        yield f"values with fewer {what}", with_array(path, "values", np.ascontiguousarray(other))


@pytest.mark.parametrize("crafted", [crafted_archives, with_other_numbers, with_other_sizes])
def test_a_snapshot_that_was_spoilt_is_refused(env, saved, crafted):
    assert_clean_errors(crafted(saved), saved, lambda: restored(env, saved))


def test_a_snapshot_with_another_description_is_refused_or_goes_on(env, saved):
    assert_clean_errors(crafted_metadata(saved), saved, lambda: restored(env, saved), lambda found: len(found) == 3)


def test_changed_bytes_of_a_snapshot_are_found_or_change_nothing(env, saved):
    whole = Snapshot.load(saved)
    assert_clean_errors(
        flipped(saved, 300),
        saved,
        lambda: Snapshot.load(saved),
        lambda found: found.state.values.tobytes() == whole.state.values.tobytes() and found.seed == whole.seed,
    )
