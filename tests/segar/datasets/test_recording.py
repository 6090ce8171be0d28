"""Recordings are Minari datasets that hold what happened, go on after they were killed, and follow from their recipe."""

import errno
import importlib.util
import json
import os
import shutil

import h5py
import minari
import numpy as np
import pytest

import segar
from segar import cli
from segar.datasets import check_replay, levels_of, recipe_of, record
from segar.datasets.recipe import fingerprint_text
from segar.envs import VectorEnv
from segar.evaluation import Scripted
from segar.levels import hash_of_levels
from segar.observations import Joined, Pixels, PreviousStep, Stack, StateVector, TexturedPixels
from tests.segar.datasets.conftest import OPTIONS
from tests.segar.envs.test_pickles import assert_same


def options_in(dataset):
    """What says of each episode how to play it again."""
    metadata = dataset.storage.get_episode_metadata(range(dataset.total_episodes))
    return [{name: int(value) for name, value in one["options"].items()} for one in metadata]


def test_a_recording_holds_every_episode_from_its_reset_to_its_end(recorded, levels):
    assert len(recorded) == 7 and minari.__version__
    assert [one["level"] for one in options_in(recorded)] == [0, 1, 2, 0, 1, 2, 0]
    for episode, options in zip(recorded, options_in(recorded), strict=True):
        ended = episode.terminations | episode.truncations
        steps = len(ended)
        assert ended[-1] and not ended[:-1].any() and steps <= 9
        assert episode.actions.shape == (steps, 2) and np.isfinite(episode.actions).all()
        assert episode.observations.shape == (steps + 1, 64, 64, 3)
        assert episode.infos["Position"].shape == (steps + 1, 4, 2)
        assert (episode.infos["level"] == options["level"]).all() and not episode.infos["success"][0]
        first = levels.values[options["level"], :, levels.layout.columns[segar.Mass]]
        np.testing.assert_array_equal(episode.infos["Mass"][0], first)
    assert recorded.total_steps == sum(len(episode.rewards) for episode in recorded)


def play_again(levels, episode, options):
    """What an environment of one's own shows when the actions of an episode are taken again."""
    n = options["environment"] + 1
    env = VectorEnv(levels, n, observation="rgb", autoreset_mode="Disabled", max_steps=9)
    seen, _ = env.reset(seed=options["seed"], options={"levels": np.full(n, options["level"])})
    found = [(seen[-1], {name: value[-1] for name, value in env.factors.items()})]
    for action in episode.actions:
        seen = env.step(np.tile(action, (n, 1)))[0]
        found.append((seen[-1], {name: value[-1] for name, value in env.factors.items()}))
    return found


@pytest.mark.parametrize("number", [0, 4, 6])
def test_recorded_actions_on_recorded_levels_give_the_recorded_frames_and_factors(recorded, number):
    episode, options = recorded[number], options_in(recorded)[number]
    for t, (seen, factors) in enumerate(play_again(levels_of(recorded), episode, options)):
        np.testing.assert_array_equal(seen, episode.observations[t])  # no JPEG
        for name, value in factors.items():
            np.testing.assert_array_equal(value, episode.infos[name][t], err_msg=name)


def test_chance_in_rules_is_played_again_as_well(trembling):
    dataset = record("t-v0", trembling, episodes=4, batch=4, max_steps=5, observation="state")
    assert (dataset[0].infos["Velocity"] != dataset[2].infos["Velocity"])[1:, 0].all()
    # Files hold no rules: they have to be given.
    with pytest.raises(segar.errors.LevelError, match="rules of their own"):
        check_replay(dataset)
    assert check_replay(dataset, world=trembling.world) == dataset.total_steps


@pytest.mark.parametrize(
    ("observation", "shapes"),
    [
        ({"eye": Pixels(32), "body": "state"}, {"eye": (32, 32, 3), "body": (32,)}),
        (TexturedPixels("one", 32), (32, 32, 3)),
        (Stack(Pixels(32), 4), (32, 32, 12)),
    ],
    ids=["a dict", "textures that are drawn anew per episode", "a stack of frames"],
)
def test_composed_and_random_observations_are_played_again_as_well(levels, observation, shapes):
    dataset = record("seen-v0", levels, episodes=4, batch=3, max_steps=6, observation=observation)
    seen = dataset[1].observations
    found = {name: array.shape[1:] for name, array in seen.items()} if isinstance(seen, dict) else seen.shape[1:]
    assert found == shapes and dataset.env_spec is None
    assert check_replay(dataset, observation=observation) == dataset.total_steps
    with pytest.raises(segar.SegarError, match="this is not what was recorded: observations are"):
        check_replay(dataset, observation="rgb" if isinstance(seen, dict) else {"a": "rgb"})


def test_the_recovered_environment_plays_every_recorded_episode_again(recorded):
    env = recorded.recover_environment()
    assert hash_of_levels(env.unwrapped.levels) == hash_of_levels(levels_of(recorded))
    assert env.spec.id == "Segar-objectsx1-hard-rgb-v0" and env.spec.max_episode_steps == 9
    for episode, options in zip(recorded, options_in(recorded), strict=True):
        seen = [env.reset(options=options)[0]] + [env.step(action)[0] for action in episode.actions]
        np.testing.assert_array_equal(seen, episode.observations)


@pytest.mark.parametrize("trials", [1, 2])
def test_an_environment_takes_the_place_of_the_one_that_was_recorded(trembling, trials):
    dataset = record(f"t{trials}-v0", trembling, episodes=6, batch=3, max_steps=5, observation="state", trials=trials)
    env = segar.envs.Env(trembling, max_steps=5, trials=trials)
    for episode, options in zip(dataset, options_in(dataset), strict=True):
        seen = [env.reset(options=options)[0]] + [env.step(action)[0] for action in episode.actions]
        np.testing.assert_array_equal(seen, episode.observations)


def test_a_replay_that_differs_says_where(recorded, root):
    assert check_replay(recorded) == recorded.total_steps
    shutil.copytree(recorded.storage.data_path, root / "changed-v0" / "data")
    with h5py.File(root / "changed-v0" / "data" / "main_data.hdf5", "a") as file:
        file["episode_4/infos/Mass"][2, 0] += 1e-12
    with pytest.raises(segar.SegarError, match=r"episode 4, step 2: infos\.Mass comes"):
        check_replay(minari.load_dataset("changed-v0"))


def test_a_replay_with_another_task_is_refused(recorded):
    with pytest.raises(segar.SegarError, match=r"another task \(puttputt-squared\)"):
        check_replay(recorded, task=segar.puttputt(impulse=1.0))


def test_a_replay_ends_where_the_recording_does(recorded, root):
    shutil.copytree(recorded.storage.data_path, root / "long-v0" / "data")
    path = root / "long-v0" / "data" / "metadata.json"
    whole = json.loads(path.read_text())
    path.write_text(json.dumps({**whole, "segar": {**whole["segar"], "max_steps": 10**9}}))
    with pytest.raises(segar.SegarError, match="an episode has another length when its actions are played again"):
        check_replay(minari.load_dataset("long-v0"))


def test_a_dataset_of_another_program_has_no_recipe(recorded, root):
    shutil.copytree(recorded.storage.data_path, root / "other-v0" / "data")
    path = root / "other-v0" / "data" / "metadata.json"
    whole = json.loads(path.read_text())
    damaged = [{"batch": 0}, {"batch": -3}, {"trials": 0}, {"episodes": 3}, {"seed": -1}]
    cannot = [({**whole["segar"], **one}, "has 7 episodes, which its recipe cannot be of") for one in damaged]
    for recipe, said in ((None, "it has no recipe"), ({"seed": "1"}, "no recipe that this SEGAR reads"), *cannot):
        path.write_text(
            json.dumps({**{k: v for k, v in whole.items() if k != "segar"}, **({"segar": recipe} if recipe else {})})
        )
        with pytest.raises(segar.SegarError, match=said):
            check_replay(minari.load_dataset("other-v0"))


@pytest.mark.parametrize("name", ["infos/level", "actions", "rewards"])
@pytest.mark.parametrize("value", [None, h5py.SoftLink("/episode_4"), h5py.ExternalLink("/etc/passwd", "/"), 0])
def test_a_damaged_file_of_episodes_is_named(recorded, root, name, value):
    shutil.copytree(recorded.storage.data_path, root / "bad-v0" / "data")
    with h5py.File(root / "bad-v0" / "data" / "main_data.hdf5", "a") as file:
        del file[f"episode_4/{name}"]
        if value == 0:
            file.create_dataset(f"episode_4/{name}", (2**50, 3), "f4", chunks=(1, 3))
        elif value is not None:
            file[f"episode_4/{name}"] = value
    with pytest.raises(segar.SegarError, match=r"bad-v0/data cannot be read \(.+\); restore it, or remove it"):
        check_replay(minari.load_dataset("bad-v0"))


@pytest.mark.parametrize("file", ["metadata.json", "main_data.hdf5"])
def test_what_stands_in_place_of_a_dataset_is_named_and_stays(recorded, levels, root, file):
    place = root / "there-v0" / "data"
    shutil.copytree(recorded.storage.data_path, place)
    (place / file).unlink()
    with pytest.raises(segar.SegarError, match=r"there-v0 cannot be read \(No data found"):
        record("there-v0", levels, **OPTIONS)
    assert len([*place.iterdir()]) == 2


def test_other_levels_than_those_that_were_recorded_are_refused(recorded, root):
    shutil.copytree(recorded.storage.data_path, root / "other-v0" / "data")
    segar.family("objectsx1-hard").sample(3, seed=1).save(root / "other-v0" / "data" / "levels.npz")
    with pytest.raises(segar.SegarError, match=r"levels.npz holds other levels"):
        levels_of(minari.load_dataset("other-v0"))


class Counting:
    """A policy whose random numbers follow from the environments, which counts its calls and may fail."""

    def __init__(self, dies_at_call: int | None = None) -> None:
        self.calls, self.dies_at_call = 0, dies_at_call

    def begin(self, env):
        self.rng = np.random.default_rng(env.state().seed)

    def __call__(self, observations):
        self.calls += 1
        if self.calls == self.dies_at_call:
            raise KeyboardInterrupt
        return self.rng.uniform(-1, 1, (len(observations), 2)).astype(np.float32)


def test_a_recording_that_was_killed_goes_on_to_the_same_bits(levels, root):
    whole = record("whole-v0", levels, Counting(), **OPTIONS)
    with pytest.raises(KeyboardInterrupt):
        record("killed-v0", levels, Counting(dies_at_call=12), **OPTIONS)
    assert [*minari.list_local_datasets()] == ["whole-v0"]
    (root / ".segar-recording" / "killed-v0" / "batch-00001.writing").mkdir()
    batch = root / ".segar-recording" / "killed-v0" / "batch-00000" / "metadata.json"
    batch.rename(batch.with_suffix(".away"))
    with pytest.raises(segar.SegarError, match=r"batch-00000 cannot be read \(No data found"):
        record("killed-v0", levels, Counting(), **OPTIONS)
    batch.with_suffix(".away").rename(batch)
    with pytest.raises(segar.SegarError, match=r"holds a recording with other settings: seed \(0 there, 1 asked for\)"):
        record("killed-v0", levels, Counting(), **OPTIONS, seed=1)
    seen, policy = [], Counting()
    again = record("killed-v0", levels, policy, **OPTIONS, progress=lambda done, of: seen.append((done, of)))
    assert policy.calls <= 2 * 9 + 1 and seen == [(3, 7), (6, 7), (7, 7)]
    for one, other in zip(whole, again, strict=True):
        names = ("observations", "actions", "rewards", "terminations", "truncations", "infos")
        assert_same(*([getattr(episode, name) for name in names] for episode in (one, other)))
    assert options_in(again) == options_in(whole) and recipe_of(again) == recipe_of(whole)
    assert (
        len(record("killed-v0", levels, policy, **OPTIONS)) == 7 and policy.calls <= 2 * 9 + 2
    )  # nothing was left to record
    assert not [*(root / ".segar-recording").rglob("*.hdf5")]


@pytest.mark.parametrize("is_complete", [True, False])
def test_another_policy_of_the_same_name_is_refused(levels, is_complete):
    """The second agent of a class must not get the episodes of the first one, nor add its own to them."""

    class Agent:
        def __init__(self, push: float, steps: int) -> None:
            self.push, self.steps = push, steps

        def __call__(self, observations):
            self.steps -= 1
            if self.steps < 0:
                raise KeyboardInterrupt
            return np.full((len(observations), 2), self.push, np.float32)

    if is_complete:
        record("agent-v0", levels, Agent(0.1, 99), **OPTIONS)
    else:
        with pytest.raises(KeyboardInterrupt):
            record("agent-v0", levels, Agent(0.1, 12), **OPTIONS)
    with pytest.raises(segar.SegarError, match="by another policy of that name; choose another name"):
        record("agent-v0", levels, Agent(0.2, 99), **OPTIONS)
    assert len(record("agent-v0", levels, Agent(0.1, 99), **OPTIONS)) == 7


def test_a_full_disk_is_told_before_hdf5_crashes_on_it(levels, root, monkeypatch):
    first, sizes = root / ".segar-recording" / "full-v0" / "batch-00000", []

    def full(file, start, size):
        sizes.append(size)
        if first.exists():
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("os.posix_fallocate", full)
    with pytest.raises(segar.SegarError, match="batch-00001: No space left on device; make room and record again"):
        record("full-v0", levels, **OPTIONS)
    assert sizes[0] >= (first / "main_data.hdf5").stat().st_size
    monkeypatch.undo()
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(root))
    assert len(record("full-v0", levels, **OPTIONS)) == 7


def test_a_second_recorder_is_told_to_wait_and_the_first_loses_nothing(levels):
    messages = []

    def policy(observations):
        if not messages:
            with pytest.raises(segar.SegarError) as refused:
                record("data-v0", levels, policy, **OPTIONS)
            messages.append(str(refused.value))
        return np.zeros((len(observations), 2), np.float32)

    dataset = record("data-v0", levels, policy, **OPTIONS)
    assert "another process is at work in" in messages[0] and check_replay(dataset) == dataset.total_steps


def test_a_recording_that_fails_before_its_first_batch_leaves_nothing(levels, root):
    with pytest.raises(KeyboardInterrupt):
        record("none-v0", levels, Counting(dies_at_call=1), **OPTIONS)
    assert not [path for path in root.rglob("*") if path.is_file()]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": 1}, r"seed \(0 there, 1 asked for\)"),
        ({"episodes": 8}, r"episodes \(7 there, 8 asked for\)"),
        ({"batch": 4}, r"batch \(3 there, 4 asked for\)"),
        ({"unit_actions": True}, r"unit_actions \(False there, True asked for\)"),
        ({"observation": Pixels(32)}, r"observation \('rgb' there, .Pixels\(resolution=32,"),
        ({"max_steps": 10}, r"max_steps \(9 there, 10 asked for\)"),
        ({"task": segar.puttputt("linear")}, r"kernel .*; task \('puttputt-squared' there, .*The kernel changes with"),
        ({"policy": Counting()}, r"policy \('uniform' there, '.*Counting' asked for\)"),
        ({"trials": 7}, r"trials \(1 there, 7 asked for\)"),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_a_dataset_of_that_name_with_other_settings_is_not_replaced(recorded, levels, root, change, message):
    shutil.copytree(recorded.storage.data_path, root / "there-v0" / "data")
    with pytest.raises(segar.SegarError, match=message):
        record("there-v0", **{"levels": levels, **OPTIONS, **change})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"episodes": 0}, "episodes must be a whole number from 1, not 0"),
        ({"trials": 0}, "trials must be a whole number from 1"),
        ({"trials": 2}, "episodes must be a multiple of trials, 2, not 7"),
        ({"max_step": 3}, "there is no option 'max_step'. Did you mean 'max_steps'"),
        ({"device": "cuda"}, "'device' is not to be chosen here"),
        ({"dataset_id": "no version"}, "'no version' names no Minari dataset"),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_what_cannot_be_recorded_is_refused(levels, change, message):
    with pytest.raises(segar.SegarError, match=message):
        record(**{"dataset_id": "data-v0", "levels": levels, **OPTIONS, **change})


def test_a_task_of_ones_own_and_the_options_of_a_trained_run_are_recorded(levels):
    task = segar.puttputt(impulse=2.0)
    options = {"task": task, "unit_actions": True, "observation": "state"}
    dataset = record("own-v0", levels, Scripted(), episodes=3, policy_name="script", **options)
    assert recipe_of(dataset).policy == "script" and recipe_of(dataset).unit_actions
    assert sum(bool(episode.infos["success"][-1]) for episode in dataset) >= 2
    assert max(float(np.abs(episode.actions).max()) for episode in dataset) <= 1
    assert check_replay(dataset, task=task) == dataset.total_steps


TRIED = {"episodes": 12, "batch": 7, "max_steps": 6, "trials": 3}


def test_a_recording_says_which_trial_each_episode_was(levels):
    observation = Joined(["state", PreviousStep()])
    tried = record("tried-v0", levels, observation=observation, **TRIED)
    found = options_in(tried)
    assert [one["trial"] for one in found] == [0, 1, 2] * 4
    assert [one["level"] for one in found] == [0, 0, 0, 1, 1, 1, 2, 2, 2, 0, 0, 0]
    assert [one["environment"] for one in found] == [0, 0, 0, 1, 1, 1] * 2 and recipe_of(tried).batch == 6
    assert check_replay(tried, observation=observation) == tried.total_steps


def test_a_missing_package_is_named_with_its_extra(levels, monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "h5py" else find(name))
    with pytest.raises(segar.SegarError, match=r"recording needs h5py.*pip install 'segar\[datasets\]'"):
        record("data-v0", levels)


def test_words_tell_observations_apart_and_are_the_same_in_every_process():
    assert fingerprint_text(Pixels(32)) == fingerprint_text(Pixels(32)) != fingerprint_text(Pixels(64))
    assert fingerprint_text(StateVector()) != fingerprint_text(StateVector(sees_invisible=False))
    a, b = np.zeros(2000), np.zeros(2000)
    b[1000] = 1e-9
    assert fingerprint_text(a) == fingerprint_text(a.copy()) != fingerprint_text(b)
    assert fingerprint_text(object()) == "builtins.object"
    assert fingerprint_text(fingerprint_text) == "segar.datasets.recipe.fingerprint_text"


def test_the_command_records_and_checks(capsys):
    command = ["record", "objectsx1-hard", "-o", "segar/hard-v0", "-n", "3", "--episodes", "5", "--batch", "2"]
    command += ["--policy", "script", "--observation", "state", "--check", "--json"]
    assert cli.main(command) == 0
    dataset = minari.load_dataset("segar/hard-v0")
    steps = int(dataset.total_steps)
    answer = {"dataset": "segar/hard-v0", "episodes": 5, "steps": steps, "steps_replayed": steps}
    assert json.loads(capsys.readouterr().out) == answer and recipe_of(dataset).policy == "script"
    assert cli.main(["record", "objectsx1-hard", "-o", "segar/hard-v0", "-n", "3", "--episodes", "5"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "policy ('script' there, 'uniform' asked for)" in said


def test_the_command_checks_a_world_and_a_task_of_ones_own(capsys):
    command = "record tests.raft:calm -o raft/calm-v0 -n 2 --episodes 2 --observation state --check --json"
    assert cli.main(command.split()) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["steps"] == answer["steps_replayed"]


def test_a_missing_package_is_named_before_anything_is_compiled(tmp_path, monkeypatch, capsys):
    find = importlib.util.find_spec
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "imageio" else find(name))
    monkeypatch.setattr("segar.envs.VectorEnv.__init__", lambda *arguments, **options: pytest.fail("compiles"))
    assert cli.main(["record", "empty-easy", "-o", str(tmp_path / "film.gif")]) == 2
    assert (
        "writing videos needs imageio, which is not installed: pip install 'segar[render]'" in capsys.readouterr().err
    )


def test_the_command_films_an_episode(tmp_path, capsys):
    film = tmp_path / "film.gif"
    command = ["record", "objectsx1-hard", "-o", str(film), "--policy", "script", "--level", "2", "--size", "128"]
    assert cli.main(command) == 0
    assert capsys.readouterr().out.endswith("frames of level 2\n") and film.exists()
