"""Recordings of several trials on each level: which episode is which, and all of it played again to the bit."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pyarrow.parquet
import pytest

import segar
from segar.datasets import Dataset, check_replay, record
from segar.envs import VectorEnv
from segar.observations import Joined, PreviousStep

OBSERVATION = Joined(["state", PreviousStep()])
OPTIONS: dict[str, Any] = {
    "episodes": 12,
    "episodes_per_shard": 7,
    "max_steps": 6,
    "observation": OBSERVATION,
    "trials": 3,
}


@pytest.fixture(scope="module")
def tried(tmp_path_factory, levels) -> Dataset:
    return record(tmp_path_factory.mktemp("trials") / "data", levels, **OPTIONS)


def test_a_recording_says_which_trial_each_episode_was(tried):
    episodes = list(tried.episodes())
    assert [one.number for one in episodes] == [*range(12)] and len(tried.manifest.shards) == 2
    assert [one.trial for one in episodes] == [0, 1, 2] * 4
    assert [one.level for one in episodes] == [0, 0, 0, 1, 1, 1, 2, 2, 2, 0, 0, 0]
    assert [one.environment for one in episodes] == [0, 0, 0, 1, 1, 1] * 2
    assert tried.manifest.settings.trials == 3 and tried.manifest.settings.episodes_per_shard == 6
    table = pyarrow.parquet.read_table(tried.folder / "shard-00001.parquet").to_pandas()
    assert (table.trial == table.episode % 3).all() and (table.environment == (table.episode - 6) // 3).all()
    assert check_replay(tried, observation=OBSERVATION) == tried.steps


def test_trials_are_those_of_environments_that_go_on_by_themselves(tried, levels):
    shard = tried.shard(0)
    env = VectorEnv(levels, 2, observation=OBSERVATION, max_steps=6, trials=3)
    seen, _ = env.reset(seed=shard.seed, options={"levels": np.arange(2)})
    rows: list[list[np.ndarray]] = [[seen[0]], [seen[1]]]
    episodes = [[one for one in shard.episodes() if one.environment == e] for e in range(2)]
    actions = [np.concatenate([one.actions for one in of_env]) for of_env in episodes]
    for t in range(max(map(len, actions))):
        now = np.stack([one[min(t, len(one) - 1)] for one in actions])
        seen, _, terminated, truncated, info = env.step(now)
        for e in np.flatnonzero([t < len(one) for one in actions]):
            rows[e] += [info["final_obs"][e]] if terminated[e] or truncated[e] else []
            rows[e].append(seen[e])
    for of_env, found in zip(episodes, rows, strict=True):
        recorded = np.concatenate([one.observations["observation"] for one in of_env])
        np.testing.assert_array_equal(recorded, found[:-1])  # then the next level begins


def test_a_trial_is_played_again_by_itself_after_as_many_resets(tmp_path, trembling):
    dataset = record(tmp_path / "data", trembling, **{**OPTIONS, "observation": "state"})
    for episode in dataset.episodes():
        n = episode.environment + 1
        env = VectorEnv(trembling, n, max_steps=6, autoreset_mode="Disabled", trials=3)
        seen, _ = env.reset(seed=episode.seed, options={"levels": np.full(n, episode.level)})
        for _ in range(episode.trial):
            seen, _ = env.reset()
        found = [seen[-1]] + [env.step(np.tile(action, (n, 1)))[0][-1] for action in episode.actions]
        np.testing.assert_array_equal(found, episode.observations["observation"])
    assert check_replay(dataset) == dataset.steps


def test_without_trials_a_recording_has_the_form_that_it_had(recorded):
    content = json.loads((recorded.folder / "manifest.json").read_text())
    assert content["format_version"] == 1 and "trials" not in content["settings"]
    assert "trial" not in pyarrow.parquet.read_schema(recorded.folder / "shard-00000.parquet").names


def test_a_recording_with_trials_is_of_a_newer_format(tried):
    assert json.loads((tried.folder / "manifest.json").read_text())["format_version"] == 2


def test_trials_that_a_table_says_otherwise_are_refused(tmp_path, tried, levels):
    from segar.datasets.dataset import write_shard

    dataset = record(tmp_path / "data", levels, **OPTIONS)
    shard = dataset.shard(0)
    trial = np.where(shard.rollouts.episode == 5, 1, shard.rollouts.trial)
    entry = write_shard(dataset.folder, 0, replace(shard.rollouts, trial=trial), shard.seed, shard.layout)
    dataset.manifest.with_shard(0, entry).write(dataset.folder)
    with pytest.raises(segar.SegarError, match="its rows are not the episodes of shard 0"):
        Dataset.load(dataset.folder).shard(0)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"episodes": 13}, "episodes must be a multiple of trials, 3, not 13"),
        ({"trials": 0}, "trials must be a whole number from 1"),
        ({"trials": True}, "trials must be a whole number from 1"),
    ],
)
def test_what_cannot_be_recorded_is_refused(tmp_path, levels, changes, says):
    with pytest.raises(segar.SegarError, match=says):
        record(tmp_path / "data", levels, **{**OPTIONS, **changes})


def test_another_number_of_trials_does_not_go_on_with_a_recording(tried, levels):
    with pytest.raises(segar.SegarError, match=r"trials \(3 there, 2 asked for\)"):
        record(tried.folder, levels, **{**OPTIONS, "trials": 2})
