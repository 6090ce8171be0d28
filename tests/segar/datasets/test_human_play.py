"""Recordings of human play are played again, and refused where they do not come out as they say."""

import json

import numpy as np
import pytest

import segar
from segar.datasets import read_play
from segar.envs import VectorEnv
from segar.errors import SegarError
from tests.crafted import assert_clean_errors, crafted_descriptions, crafted_texts

FAMILIES = {"objectsx1-hard": None, "billiards": "billiards", "puttputt": None}


def played(path, levels, episodes, task=None, steps=None):
    """Write a recording of random play into ``path``, step by step as an environment says; return it.

    Args:
        episodes: pairs of level and seed.
        steps: after how many the player leaves; None: at the end.
    """
    levels.save(path.with_name("levels.json"))
    rng, found, rewards = np.random.default_rng(0), [], []
    for level, seed in episodes:
        env = VectorEnv(levels, 1, seed=seed, autoreset_mode="Disabled")
        env.reset(options={"levels": [level]})
        actions, ended = [], False
        rewards.append([])
        while not ended and len(actions) != steps:
            action = rng.uniform(env.single_action_space.low, env.single_action_space.high).astype(np.float32)
            _, reward, terminated, truncated, info = env.step(action[None])
            actions.append(action.tolist())
            rewards[-1].append(float(reward[0]))
            ended = bool(terminated[0] | truncated[0])
        ends = {"terminated": bool(terminated[0]), "truncated": bool(truncated[0]), "success": bool(info["success"][0])}
        found.append({"level": level, "seed": seed, "actions": actions, "return": float(info["return"][0]), **ends})
    data = {"format": "segar-play", "version": 1, "segar": segar.__version__, "task": task, "seed": 5}
    data |= {"levels": json.loads(path.with_name("levels.json").read_text()), "episodes": found}
    path.write_text(json.dumps(data))
    return data, rewards


@pytest.mark.parametrize("name", FAMILIES)
def test_a_recording_is_read_as_the_episodes_that_were_played(name, tmp_path):
    levels = segar.family(name).sample(3, seed=0)
    data, rewards = played(tmp_path / "play.json", levels, [(2, 5), (0, 5), (0, 7)], FAMILIES[name])
    found, episodes = read_play(tmp_path / "play.json")
    assert found == levels
    for said, reward, episode in zip(data["episodes"], rewards, episodes, strict=True):
        assert episode.options == {"level": said["level"], "seed": said["seed"], "environment": 0}
        assert episode.actions.dtype == np.float32 and episode.actions.tolist() == said["actions"]
        assert episode.rewards.tolist() == reward
        ends = {
            "terminated": episode.terminations,
            "truncated": episode.truncations,
            "success": episode.infos["success"],
        }
        assert all(array.dtype == bool and array[-1] == said[name] for name, array in ends.items())
        states = len(episode) + 1
        assert episode.observations.shape[0] == states
        assert episode.infos["Position"].shape == (states, len(levels.layout.slots), 2)
        start = levels.values[said["level"], :, levels.layout.columns[segar.Position]]
        assert np.array_equal(episode.infos["Position"][0, :, 0], start, equal_nan=True)


def test_an_episode_that_the_player_left_has_no_end(tmp_path):
    played(tmp_path / "play.json", segar.family("empty-easy").sample(2, seed=0), [(1, 3)], steps=4)
    _, [episode] = read_play(tmp_path / "play.json", observation="rgb")
    assert len(episode) == 4 and not episode.terminations.any() and not episode.truncations.any()
    assert episode.observations.shape == (5, 64, 64, 3)


def test_rules_that_draw_numbers_draw_those_of_the_recorded_seed(tmp_path, trembling):
    played(tmp_path / "play.json", trembling, [(0, 1), (0, 2)], steps=5)
    _, (one, other) = read_play(tmp_path / "play.json", world=trembling.world)
    assert not np.array_equal(one.infos["Velocity"], other.infos["Velocity"], equal_nan=True)
    with pytest.raises(SegarError, match=r"play.json: these levels were saved with rules of their own"):
        read_play(tmp_path / "play.json")


def test_a_task_of_ones_own_is_given(tmp_path):
    levels = segar.family("empty-easy").sample(1, seed=0)
    played(tmp_path / "play.json", levels, [(0, 0)], task="my_lab.tasks:golf")
    with pytest.raises(SegarError, match=r"play.json: the task 'my_lab.tasks:golf' is not built in.*give it by task="):
        read_play(tmp_path / "play.json")
    assert len(read_play(tmp_path / "play.json", task=segar.puttputt())[1]) == 1


CHANGES = {
    "another return": (lambda e: e.update({"return": np.nextafter(e["return"], 9)}), r"return: is \S+, and \S+ when the act"),
    "another end": (lambda e: e.update(terminated=not e["terminated"]), r"terminated: is \w+, and \w+ when"),
    "no end": (lambda e: e.update(truncated=False, terminated=False), r"t\w+ated: is False, and True when"),
    "a success": (lambda e: e.update(success=not e["success"]), r"success: is \w+, and \w+ when"),
    "another action": (lambda e: e["actions"][0].__setitem__(0, -e["actions"][0][0]), r"(return: is|actions: there)"),
    "an action more": (lambda e: e["actions"].append([0.0, 0.0]), r"actions: there are \d+, and the episode ends after \d+"),
    "an action less": (lambda e: e["actions"].pop(), r"(return|t\w+ated): is"),
    "no actions": (lambda e: e["actions"].clear(), r"actions: there must be one at least"),
    "a third number": (lambda e: e["actions"][1].append(0.0), r"actions\[1\]: must be 2 numbers, not 3"),
    "a number that is no float32": (lambda e: e["actions"][1].__setitem__(1, 0.1), r"actions\[1\]\[1\]: 0.1 is no number of"),
    "a huge number": (lambda e: e["actions"][1].__setitem__(1, 1e300), r"actions\[1\]\[1\]: 1e\+300 is no number of float32"),
    "another level": (lambda e: e.update(level=3), r"level: must be 0 to 2, not 3"),
    "a level before the first": (lambda e: e.update(level=-1), r"level: must be 0 to 2, not -1"),
    "a negative seed": (lambda e: e.update(seed=-1), r"seed: must not be negative"),
}  # fmt: skip


@pytest.fixture(scope="module")
def two_episodes(tmp_path_factory):
    """A recording of two episodes, as text."""
    path = tmp_path_factory.mktemp("play") / "play.json"
    played(path, segar.family("objectsx1-hard").sample(3, seed=0), [(2, 5), (0, 5)])
    return path.read_text()


@pytest.mark.parametrize("change", CHANGES)
def test_an_episode_that_was_changed_is_refused_by_its_number_and_what_differs(change, two_episodes, tmp_path):
    data = json.loads(two_episodes)
    alter, message = CHANGES[change]
    alter(data["episodes"][1])
    (tmp_path / "play.json").write_text(json.dumps(data))
    with pytest.raises(SegarError, match=rf"play.json: episodes\[1\].{message}"):
        read_play(tmp_path / "play.json")


def test_a_recording_with_other_contents_is_refused_or_the_same(tmp_path):
    path = tmp_path / "play.json"
    data, _ = played(path, segar.family("empty-easy").sample(2, seed=0), [(1, 3)], steps=2)
    levels = data.pop("levels")

    def files():
        for what, changed in crafted_descriptions(data):
            text = changed | {"levels": levels} if isinstance(changed, dict) else changed
            yield what, json.dumps(text).encode()
        yield "no levels", json.dumps(data | {"levels": {}}).encode()
        yield "damaged levels", json.dumps(data | {"levels": levels | {"levels": [{}]}}).encode()
        yield "infinite", json.dumps(data | {"levels": levels, "seed": float("inf")}).encode()
        yield "a key more", json.dumps(data | {"levels": levels, "player": "x"}).encode()
        yield (
            "nested",
            json.dumps(data | {"levels": levels}).replace('"seed": 5', '"seed": ' + "[" * 900 + "]" * 900).encode(),
        )
        yield from crafted_texts()

    def is_harmless(found):  # what says who recorded with which seed, and the name of the default task
        return found[0] == segar.family("empty-easy").sample(2, seed=0) and len(found[1]) in (0, 1)

    assert_clean_errors(files(), path, lambda: read_play(path), is_harmless)
    path.unlink()
    with pytest.raises(SegarError, match=r"there is no recording of play .*play.json"):
        read_play(path)


def test_a_recording_that_needs_more_memory_than_the_limit_is_refused(tmp_path, monkeypatch):
    played(tmp_path / "play.json", segar.family("empty-easy").sample(1, seed=0), [(0, 0), (0, 1), (0, 2)], steps=60)
    monkeypatch.setenv("SEGAR_FILE_LIMIT", "0")
    with pytest.raises(SegarError, match=r"play.json: this recording of play has more than 0 bytes"):
        read_play(tmp_path / "play.json")
    monkeypatch.setenv("SEGAR_FILE_LIMIT", "1")
    with pytest.raises(SegarError, match=r"play.json: this recording of play of .* would expand to"):
        read_play(tmp_path / "play.json", observation="rgb")
