"""A Minari dataset holds what was recorded, to the bit, and knows its environment."""

import minari
import numpy as np
import pytest

import segar
from segar.datasets import record, to_minari
from segar.datasets.recording import hash_of_levels
from segar.observations.pixels.solid_colours import Pixels
from tests.segar.datasets.folders import names_in

NAME = "segar/objectsx1-hard-v0"


@pytest.fixture
def root(tmp_path, monkeypatch):
    """Where Minari keeps its datasets."""
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "minari"))
    return tmp_path / "minari"


def test_episodes_come_out_as_they_were_recorded(recorded, root):
    to_minari(recorded, NAME)
    dataset = minari.load_dataset(NAME)
    assert len(dataset) == 7 and dataset.total_steps == recorded.steps
    for kept, episode in zip(dataset, recorded.episodes(), strict=True):
        np.testing.assert_array_equal(kept.observations, episode.observations["observation"])  # no JPEG
        np.testing.assert_array_equal(kept.actions, episode.actions)
        np.testing.assert_array_equal(kept.rewards, episode.rewards)
        np.testing.assert_array_equal(kept.terminations, episode.terminated)
        np.testing.assert_array_equal(kept.truncations, episode.truncated)
        assert (kept.infos["level"] == episode.level).all() and not kept.infos["success"][0]
        for name, values in episode.factors.items():
            np.testing.assert_array_equal(kept.infos[name], values, err_msg=name)
    options = [metadata["options"] for metadata in dataset.storage.get_episode_metadata(range(7))]
    seeds = [(int(o["seed"]), int(o["level"]), int(o["environment"])) for o in options]
    assert seeds == [(e.seed, e.level, e.environment) for e in recorded.episodes()]


def test_the_environment_is_recovered_with_its_levels(recorded, root):
    env = to_minari(recorded, NAME).recover_environment()
    assert hash_of_levels(env.unwrapped.levels) == hash_of_levels(recorded.levels)
    assert env.spec.id == "Segar-objectsx1-hard-rgb-v0" and env.unwrapped.task.max_steps == 9
    assert env.observation_space.shape == (64, 64, 3)


def test_other_observations_have_their_spaces_and_no_id(tmp_path, levels, root):
    few = record(tmp_path / "data", levels, episodes=2, max_steps=3, observation=Pixels(32))
    made = to_minari(few, "small-v0", observation=Pixels(32))
    assert made.observation_space.shape == (32, 32, 3) and made.env_spec is None
    assert made[1].observations.dtype == np.uint8


def test_dicts_of_observations_stay_dicts(tmp_path, levels, root):
    eyes = {"left": Pixels(32), "right": "state"}
    few = record(tmp_path / "data", levels, episodes=2, max_steps=3, observation=eyes)
    kept = to_minari(few, "eyes-v0", observation=eyes)[1].observations
    assert set(kept) == {"left", "right"}
    episode = list(few.episodes())[1]
    np.testing.assert_array_equal(kept["left"], episode.observations["observation.left"])
    np.testing.assert_array_equal(kept["right"], episode.observations["observation.right"])


def test_a_dataset_of_that_name_is_not_replaced(recorded, root):
    to_minari(recorded, NAME)
    with pytest.raises(segar.SegarError, match=f"there is a Minari dataset '{NAME}' already"):
        to_minari(recorded, NAME)
    assert list(minari.list_local_datasets()) == [NAME]


def test_what_fails_in_the_middle_leaves_nothing(recorded, root, monkeypatch):
    def fail(self, buffer):
        raise OSError("the disk is full")

    monkeypatch.setattr(minari.MinariDataset, "update_dataset_from_buffer", fail)
    with pytest.raises(OSError, match="the disk is full"):
        to_minari(recorded, NAME)
    assert names_in(root) == []
