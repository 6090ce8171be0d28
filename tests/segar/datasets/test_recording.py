"""Recordings hold what happened, go on after they were killed, and refuse what does not belong together."""

import json
import shutil

import numpy as np
import pyarrow.parquet
import pytest

import segar
from segar.datasets import Dataset, Episode, check_replay, record
from segar.datasets.recording import fingerprint_text
from segar.datasets.rollouts import from_leaves, leaves
from segar.observations.composed.stack import Stack
from segar.observations.pixels.solid_colours import Colour, Pixels
from segar.observations.pixels.textured import TexturedPixels
from segar.observations.state.state_vector import StateVector
from tests.segar.datasets.folders import names_in

OPTIONS = {"episodes": 7, "episodes_per_shard": 3, "max_steps": 9}


def test_a_recording_holds_every_episode_from_its_reset_to_its_end(recorded, levels):
    episodes = list(recorded.episodes())
    assert [episode.number for episode in episodes] == list(range(7)) and len(recorded) == 7
    assert [episode.level for episode in episodes] == [0, 1, 2, 0, 1, 2, 0]
    for episode in episodes:
        ended = episode.terminated | episode.truncated
        assert ended[-1] and not ended[:-1].any() and len(episode) <= 9
        assert episode.actions.shape == (len(episode), 2) and np.isfinite(episode.actions).all()
        assert episode.observations["observation"].shape == (len(episode) + 1, 64, 64, 3)
        assert episode.factors["Position"].shape == (len(episode) + 1, 4, 2)
        first = levels.values[episode.level, :, levels.layout.columns[segar.Mass]]
        np.testing.assert_array_equal(episode.factors["Mass"][0], first)
    assert recorded.steps == sum(map(len, episodes)) and recorded.rows == recorded.steps + 7


def play_again(levels: segar.Levels, episode: Episode, observation: str, max_steps: int) -> list[tuple]:
    """What an environment of one's own shows when the actions of an episode are taken again."""
    env = segar.envs.VectorEnv(
        levels, episode.environment + 1, observation=observation, autoreset_mode="Disabled", max_steps=max_steps
    )
    mine = episode.environment
    seen, info = env.reset(seed=episode.seed, options={"levels": np.full(mine + 1, episode.level)})
    steps = [(seen[mine], {name: value[mine] for name, value in info["factors"].items()}, None)]
    for action in episode.actions:
        seen, reward, *_, info = env.step(np.tile(action, (mine + 1, 1)))
        steps.append((seen[mine], {name: value[mine] for name, value in info["factors"].items()}, reward[mine]))
    return steps


@pytest.mark.parametrize("number", [0, 4, 6])
def test_recorded_actions_on_recorded_levels_give_the_recorded_frames_and_factors(recorded, number):
    episode = list(recorded.episodes())[number]
    for t, (seen, factors, reward) in enumerate(play_again(recorded.levels, episode, "rgb", 9)):
        np.testing.assert_array_equal(seen, episode.observations["observation"][t])
        for name, value in factors.items():
            np.testing.assert_array_equal(value, episode.factors[name][t], err_msg=name)
        assert reward is None or reward == episode.rewards[t - 1]


def test_chance_in_rules_is_played_again_as_well(tmp_path, trembling):
    dataset = record(tmp_path / "data", trembling, episodes=4, episodes_per_shard=4, max_steps=5, observation="state")
    first, _, second, _ = dataset.episodes()
    assert first.level == second.level and (first.factors["Velocity"] != second.factors["Velocity"])[1:, 0].all()
    again = play_again(trembling, second, "state", 5)
    np.testing.assert_array_equal([seen for seen, *_ in again], second.observations["observation"])
    assert check_replay(dataset) == dataset.steps
    # Files hold no rules: they have to be given.
    with pytest.raises(segar.errors.LevelError, match="rules of their own"):
        check_replay(Dataset.load(tmp_path / "data"))
    assert check_replay(Dataset.load(tmp_path / "data", world=trembling.world)) == dataset.steps


@pytest.mark.parametrize(
    ("observation", "shapes"),
    [
        ({"eye": Pixels(32), "body": "state"}, {"observation.eye": (32, 32, 3), "observation.body": (32,)}),
        (TexturedPixels("one", 32), {"observation": (32, 32, 3)}),
        (Stack(Pixels(32), 4), {"observation": (32, 32, 12)}),
    ],
    ids=["a dict", "textures that are drawn anew per episode", "a stack of frames"],
)
def test_composed_and_random_observations_are_played_again_as_well(tmp_path, levels, observation, shapes):
    dataset = record(tmp_path / "data", levels, episodes=4, episodes_per_shard=3, max_steps=6, observation=observation)
    episode = next(dataset.episodes())
    assert {name: array.shape[1:] for name, array in episode.observations.items()} == shapes
    assert check_replay(dataset, observation=observation) == dataset.steps
    with pytest.raises(segar.SegarError, match="this is not the observation that was recorded: its arrays are"):
        check_replay(dataset, observation="rgb")


def test_a_replay_with_other_colours_says_where(recorded):
    with pytest.raises(segar.SegarError, match="episode 0, step 0: observation comes out differently"):
        check_replay(recorded, observation=Pixels(colours={segar.GolfBall: Colour((255, 0, 0))}))


def test_a_replay_that_differs_says_where(tmp_path, recorded):
    from segar.datasets.dataset import write_shard

    folder = shutil.copytree(recorded.folder, tmp_path / "data")
    shard = recorded.shard(1)
    row = int(np.flatnonzero((shard.rollouts.episode == 4) & (shard.rollouts.step == 2))[0])
    shard.rollouts.values[row, 0, shard.layout.columns[segar.Mass]] += 1e-12
    entry = write_shard(folder, 1, shard.rollouts, shard.seed, shard.layout)
    recorded.manifest.with_shard(1, entry).write(folder)
    assert check_replay(recorded) == recorded.steps
    with pytest.raises(segar.SegarError, match="episode 4, step 2: Mass of 'golfball' comes out differently"):
        check_replay(Dataset.load(folder))


def test_a_replay_with_another_task_is_refused(recorded):
    with pytest.raises(segar.SegarError, match=r"another task \(puttputt-squared\)"):
        check_replay(recorded, task=segar.puttputt(impulse=1.0))


def test_a_recording_of_another_version_is_read_and_replayed_and_refused_where_it_would_go_on(
    tmp_path, recorded, levels
):
    folder = shutil.copytree(recorded.folder, tmp_path / "data")
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["settings"]["kernel"] = "0" * 16  # the kernel's code lay elsewhere
    (folder / "manifest.json").write_text(json.dumps(manifest))
    assert check_replay(Dataset.load(folder)) == recorded.steps
    with pytest.raises(segar.SegarError, match=r"kernel \('0000.*another folder.*was begun by SEGAR 0.*Dataset.load"):
        record(folder, levels, **OPTIONS)


def test_the_table_names_every_factor_with_its_entity(recorded):
    table = pyarrow.parquet.read_table(recorded.folder / "shard-00000.parquet")
    assert {"golfball.Position.x", "golfball.Position.y", "object1.Charge", "goal.Heat", "reward"} <= set(
        table.column_names
    )
    assert "goal.Mass" not in table.column_names  # a tile has none
    assert "global_friction.Friction" in table.column_names
    units = {column["name"]: column["unit"] for column in recorded.manifest.columns}
    assert units["golfball.Velocity.x"] == "m/s" and units["golfball.Mass"] == "kg"
    steps, rewards = table["step"].to_numpy(), table["reward"].to_numpy()
    assert (np.isnan(rewards) == np.append(steps[1:] == 0, True)).all()  # nan where no action was taken


class Counting:
    """The uniform policy, which counts its calls and may fail."""

    def __init__(self, dies_at_call: int | None = None) -> None:
        self.calls, self.dies_at_call = 0, dies_at_call

    def __call__(self, observations, info, rng):
        self.calls += 1
        if self.calls == self.dies_at_call:
            raise KeyboardInterrupt
        return rng.uniform(-1, 1, (len(observations), 2)).astype(np.float32)


def test_a_recording_that_was_killed_goes_on_to_the_same_bits(tmp_path, levels):
    whole = record(tmp_path / "whole", levels, Counting(), **OPTIONS)
    with pytest.raises(KeyboardInterrupt):
        record(tmp_path / "killed", levels, Counting(dies_at_call=12), **OPTIONS)
    (tmp_path / "killed" / ".writing-0123-shard-00001.npz").write_bytes(b"half a file")
    (tmp_path / "killed" / "shard-00001.parquet").write_bytes(b"a table without frames")
    with pytest.raises(segar.SegarError, match="holds 1 of 3 shards: its recording was stopped"):
        Dataset.load(tmp_path / "killed")
    seen = []
    policy = Counting()
    record(tmp_path / "killed", levels, policy, **OPTIONS, progress=lambda done, shards: seen.append((done, shards)))
    assert policy.calls <= 2 * 9 and seen == [(1, 3), (2, 3), (3, 3)]
    assert names_in(tmp_path / "killed") == names_in(tmp_path / "whole")
    for name in names_in(tmp_path / "whole"):
        assert (tmp_path / "killed" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name
    assert record(tmp_path / "killed", levels, policy, **OPTIONS).manifest == whole.manifest
    assert policy.calls <= 2 * 9  # nothing was left to record


def test_a_second_recorder_is_told_to_wait_and_the_first_loses_nothing(tmp_path, levels):
    messages = []

    def policy(observations, info, rng):
        if not messages:
            with pytest.raises(segar.SegarError) as refused:
                record(tmp_path / "data", levels, **OPTIONS, seed=1)
            messages.append(str(refused.value))
        return rng.uniform(-1, 1, (len(observations), 2)).astype(np.float32)

    dataset = record(tmp_path / "data", levels, policy, policy_name="uniform", **OPTIONS)
    assert messages == [
        f"another process is at work in {tmp_path / 'data'}; wait until it has recorded, or name another folder"
    ]
    dataset.check()
    assert dataset.manifest == record(tmp_path / "alone", levels, **OPTIONS).manifest
    with pytest.raises(segar.SegarError, match=r"seed \(0 there, 1 asked for\)"):
        record(tmp_path / "data", levels, policy_name="uniform", **OPTIONS, seed=1)


@pytest.mark.parametrize("place", ["file", "file/below"])
def test_a_file_in_the_place_of_the_folder_is_told_and_kept(tmp_path, levels, place):
    (tmp_path / "file").write_text("years of work")
    with pytest.raises(segar.SegarError, match=r"episodes cannot be recorded into .*; name another folder"):
        record(tmp_path / place, levels, **OPTIONS)
    assert (tmp_path / "file").read_text() == "years of work"


def test_a_recording_that_was_killed_before_its_first_shard_starts_anew(tmp_path, levels, monkeypatch):
    (tmp_path / "levels.npz").write_bytes(b"levels without a manifest")
    (tmp_path / ".writing-0123-manifest.json").write_bytes(b"{")
    (tmp_path / ".writing-4567-levels.npz").write_bytes(b"half a file")

    def save_half(file, **arrays):
        file.write(b"half a file")
        raise KeyboardInterrupt

    monkeypatch.setattr("segar.support.files.np.savez_compressed", save_half)
    with pytest.raises(KeyboardInterrupt):
        record(tmp_path, levels, **OPTIONS)
    monkeypatch.undo()
    assert names_in(tmp_path) == ["levels.npz"]
    record(tmp_path, levels, **OPTIONS).check()
    assert not [name for name in names_in(tmp_path) if name.startswith(".")]


@pytest.mark.parametrize("suffix", ["parquet", "npz"])
def test_a_damaged_shard_is_told_and_recorded_again(tmp_path, recorded, levels, suffix):
    folder = shutil.copytree(recorded.folder, tmp_path / "data")
    path = folder / f"shard-00001.{suffix}"
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    damaged = Dataset.load(folder)
    for read in (lambda: damaged.shard(1), damaged.check, lambda: list(damaged)):
        with pytest.raises(segar.SegarError, match=f"shard 1 of .* is damaged: shard-00001.{suffix} has another hash"):
            read()
    damaged.shard(0)
    path.unlink()
    with pytest.raises(segar.SegarError, match=f"shard 1 of .* is incomplete: there is no shard-00001.{suffix}"):
        damaged.check()
    record(folder, levels, **OPTIONS).check()
    assert path.read_bytes() == (recorded.folder / path.name).read_bytes()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": 1}, r"seed \(0 there, 1 asked for\)"),
        ({"episodes": 8}, r"episodes \(7 there, 8 asked for\)"),
        ({"episodes_per_shard": 4}, r"episodes_per_shard \(3 there, 4 asked for\)"),
        ({"observation": "state"}, r"observation \('rgb' there, 'state' asked for\)"),
        ({"observation": Pixels(32)}, r"observation \('rgb' there, .Pixels\(resolution=32,"),
        ({"max_steps": 10}, r"max_steps \(9 there, 10 asked for\)"),
        (
            {"task": segar.puttputt("linear")},
            r"kernel .*; task \('puttputt-squared' there, 'puttputt-linear' asked for\)",
        ),
        ({"policy": Counting()}, r"policy \('uniform' there, '.*Counting' asked for\)"),
        ({"levels": segar.family("objectsx1-hard").sample(3, seed=1)}, r"other settings: levels \('"),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_going_on_with_other_settings_is_refused_with_their_names(recorded, levels, change, message):
    with pytest.raises(segar.SegarError, match=message):
        record(recorded.folder, **{"levels": levels, **OPTIONS, **change})


def test_shards_depend_on_the_seed(tmp_path, recorded, levels):
    other = record(tmp_path / "data", levels, **OPTIONS, seed=1)
    mine, theirs = next(recorded.episodes()), next(other.episodes())
    assert mine.level == theirs.level and not np.array_equal(mine.actions[:3], theirs.actions[:3])


def test_a_policy_sees_observations_and_true_factors(tmp_path, levels):
    task = segar.puttputt()
    dataset = record(
        tmp_path / "data",
        levels,
        lambda seen, info, rng: task.demo_actions(info["factors"]),
        episodes=3,
        policy_name="script",
    )
    assert dataset.manifest.settings.policy == "script"
    assert sum(bool(episode.success[-1]) for episode in dataset.episodes()) >= 2
    assert max(float(np.abs(episode.actions).max()) for episode in dataset.episodes()) <= 1


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "holds no dataset: there is no manifest.json"),
        ("{", "manifest.json is damaged"),
        ('{"format": "something else"}', "not the manifest of a dataset but of a something else"),
        ("newer", "was written by a newer SEGAR"),
        ("[]", "manifest.json is damaged"),
    ],
)
def test_what_is_no_dataset_is_told(tmp_path, recorded, content, message):
    if content == "newer":
        content = json.dumps(json.loads((recorded.folder / "manifest.json").read_text()) | {"format_version": 3})
    if content is not None:
        (tmp_path / "manifest.json").write_text(content)
    with pytest.raises(segar.SegarError, match=message):
        Dataset.load(tmp_path)


def test_a_folder_with_other_things_is_left_alone(tmp_path, levels):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(segar.SegarError, match=r"is not empty and holds no dataset: there is thesis\.tex"):
        record(tmp_path, levels, **OPTIONS)
    assert names_in(tmp_path) == ["thesis.tex"]


def test_numbers_that_make_no_sense_are_refused(tmp_path, levels, recorded):
    with pytest.raises(segar.SegarError, match="at least 1, not 0 and 64"):
        record(tmp_path / "data", levels, episodes=0)
    with pytest.raises(segar.SegarError, match="has shards 0 to 2, no shard 3"):
        recorded.shard(3)


def test_a_missing_package_is_named_with_its_extra(tmp_path, levels, monkeypatch):
    import importlib.util

    find = importlib.util.find_spec
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "pyarrow" else find(name))
    with pytest.raises(segar.SegarError, match=r"recording needs pyarrow.*pip install 'segar\[datasets\]'"):
        record(tmp_path / "data", levels)


def test_observations_of_several_parts_are_taken_apart_and_put_together():
    import gymnasium.spaces as spaces

    space = spaces.Dict({"eye": spaces.Box(0, 1, (2,)), "ears": spaces.Tuple([spaces.Box(0, 1, (1,))] * 2)})
    seen = {"eye": np.ones((5, 2)), "ears": (np.zeros((5, 1)), np.full((5, 1), 0.5))}
    arrays = leaves(seen)
    assert list(arrays) == ["observation.eye", "observation.ears.0", "observation.ears.1"]
    again = from_leaves(arrays, space)
    assert again["eye"] is seen["eye"] and again["ears"][1] is seen["ears"][1]


def test_words_tell_observations_apart_and_are_the_same_in_every_process():
    assert fingerprint_text(Pixels(32)) == fingerprint_text(Pixels(32)) != fingerprint_text(Pixels(64))
    assert fingerprint_text(StateVector()) != fingerprint_text(StateVector(sees_invisible=False))
    a, b = np.zeros(2000), np.zeros(2000)
    b[1000] = 1e-9
    assert fingerprint_text(a) == fingerprint_text(a.copy()) != fingerprint_text(b)
    assert (
        fingerprint_text(object()) == "builtins.object"
        and fingerprint_text(fingerprint_text) == "segar.datasets.recording.fingerprint_text"
    )
