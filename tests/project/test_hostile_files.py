"""No file of others runs anything: every text in a sample of each format is replaced by names that would run something."""

import dataclasses
import json
import os
import tomllib
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml

import segar
from segar.analysis.distances import transfer_levels
from segar.datasets import read_play
from segar.datasets.recipe import FORM as RECIPE
from segar.datasets.recipe import recipe_from
from segar.envs import Snapshot, VectorEnv
from segar.errors import SegarError
from segar.experiments.benchmark import BenchmarkConfig
from segar.experiments.benchmarking import verification
from segar.experiments.benchmarking.playing import options_of
from segar.experiments.benchmarking.protocol import SHIPPED
from segar.experiments.benchmarking.row import MEANS, ROW, file_hash, hash_of, read_row
from segar.experiments.benchmarking.settings import again
from segar.experiments.benchmarking.verification import verify
from segar.experiments.evaluation.transfers import Transfer
from segar.experiments.levels.builders import Prepared
from segar.experiments.runs.run_folder import CONFIG, EVALUATIONS, JOURNAL, SUMMARY, SWEEPS, VERSIONS, read_config
from segar.experiments.runs.run_rows import UNREADABLE, run_rows
from segar.experiments.settings import ObservationConfig, PLRConfig, RunConfig, as_data
from segar.hardness import Plan, plan
from segar.lab import Lab, Session
from segar.playground.run_folder import read_policy
from segar.policies import Network
from segar.suites.suite_file import HASHED, read_suite, suite_hash
from segar.tasks import task_of
from segar.textures import TextureSet
from tests.crafted import description_of
from tests.hostile import MODULE, SECRET, assert_nothing_runs, watching
from tests.segar.datasets.test_human_play import played
from tests.segar.lab.conftest import DISTRIBUTION, WORLD
from tests.segar.policies.networks import NETWORKS
from tests.synthetic_runs import settings, write_run

LEVELS = segar.family("objectsx1-easy").sample(2, seed=0)


class Played(Exception):
    """Episodes would be played now."""


def test_the_watch_sees_programs_and_imports():
    with watching() as seen:
        os.system("true")
        with suppress(ImportError):
            __import__(MODULE)
    assert {one.split()[0] for one in seen} >= {"os.system", "import"}


@pytest.fixture(autouse=True)
def secret(monkeypatch, tmp_path):
    monkeypatch.setenv("HOSTILE_SECRET", SECRET)
    monkeypatch.setenv("SEGAR_FILE_LIMIT", "64")


def text_at(path):
    """A function that writes data as JSON, or as YAML where the name of the file says so."""

    def write(data):
        is_yaml = path.suffix == ".yaml"
        path.write_text(yaml.dump(data, Dumper=yaml.CSafeDumper) if is_yaml else json.dumps(data))
        return path

    return write


def archive_at(path):
    """The description in an archive, and a function that writes another one into it."""
    description, described = description_of(path)

    def write(data: Any) -> Path:
        path.write_bytes(described(json.dumps(data).encode()))
        return path

    return description, write


def check(folder, data, write, read):
    write(data)
    read()  # so that what is wrong is the hostile name alone
    assert_nothing_runs(data, write, read, folder / "hostile")


def named(file, make):
    """What a function makes of the data in a file, whose errors name the setting and not where it stands."""
    try:
        return make()
    except SegarError as error:
        raise SegarError(f"{file}: {error}") from error


def config_data(folder):
    """The settings of a run with all that can be named, as plain data."""
    config = settings(folder, levels=dataclasses.replace(RunConfig().levels, test="empty-easy", world=None))
    config = dataclasses.replace(config, curriculum=PLRConfig())
    data = as_data(config)
    data["levels"] |= {"world": "", "test_variation": "", "count": 1, "test_count": 1}
    data["task"] = {"name": "puttputt", "options": {"reward": "squared"}}
    data["observation"] = {"name": "state", "options": {"factors": ["Mass"]}}
    data["module_path"] = [str(folder)]
    return data


def test_settings_of_a_run_run_nothing(tmp_path):
    folder = write_run(settings(tmp_path))
    write = text_at(folder / CONFIG)

    def read():
        named(CONFIG, Prepared(read_config(folder)).check_names)

    check(tmp_path, config_data(tmp_path), write, read)
    for group in ("algorithm", "curriculum"):
        assert_nothing_runs({group: {"_target_": "x"}}, write, read, tmp_path / f"hostile_{group}")


def test_yaml_tags_and_interpolations_are_no_names(tmp_path):
    path = write_run(settings(tmp_path)) / CONFIG
    for value in (
        "!!python/object/apply:os.system ['touch mark']", "!!python/name:os.system", "!!python/module:os",
        "!!python/object/new:os.system ['touch mark']", "&a [*a]", "[" * 5000 + "]" * 5000,
    ):  # fmt: skip
        path.write_text(f"task: {{name: {value}}}\n")
        with pytest.raises(SegarError, match=path.name):
            read_config(path.parent)


@pytest.mark.parametrize("name", [SUMMARY, VERSIONS, SWEEPS, JOURNAL, f"{EVALUATIONS}/test-n20/{SUMMARY}"])
def test_what_a_run_left_runs_nothing(tmp_path, name):
    folder = write_run(settings(tmp_path))
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    sample = {
        SUMMARY: lambda: {**json.loads(path.read_text()), "note": "x"},
        VERSIONS: lambda: {**json.loads(path.read_text()), "levels": {"train": "0", "test": "0"}},
        SWEEPS: lambda: {"sweeps": ["one"]},
        JOURNAL: lambda: {"event": "failed", "error": "x", "time": "y"},
    }
    other = {"players": {"deterministic": {"score": 1.0, "note": "x"}}, "code": {"kernel": "0", "a/b.py": "1"},
             "planner": {"planner_samples": "64"}, "levels": {"asked": "test", "name": "x"}}  # fmt: skip
    data = sample.get(name, lambda: other)()

    def read():
        (row,) = run_rows([folder])
        if row.state == UNREADABLE:
            raise SegarError(row.problem)

    check(tmp_path, data, text_at(path), read)


def test_a_transfer_runs_nothing(tmp_path):
    folder = write_run(settings(tmp_path))
    stated = as_data(Transfer("far", "empty-hard", "gravity_40", ObservationConfig()))
    path = folder / EVALUATIONS / "transfer-far" / SUMMARY
    path.parent.mkdir(parents=True)
    check(tmp_path, {"transfer": stated}, text_at(path), lambda: transfer_levels(folder, "transfer-far"))


def test_a_row_of_the_benchmark_runs_nothing(tmp_path, monkeypatch):
    (tmp_path / "row").mkdir()
    path = tmp_path / "row" / ROW
    data = json.loads((SHIPPED / "ppo_fast-state-laptop" / ROW).read_text())
    data["pieces"], data["files"] = data["pieces"][:1], {"episodes.parquet": "0"}
    data["drawn"] = [data["drawn"][0] | {"file": ""}]
    data["pieces"][0]["levels"] = {side: data["pieces"][0]["levels"][side] for side in ("train", "test")}
    data["made_with"] = [{"python": "3", "code": {"my_lab/learner.py": "0"}}]
    data["settings"]["algorithm"] = {"kind": "ppo", "name": "ppo", "encoder": "impala"}
    data["settings"]["observation"]["options"] |= {"factors": ["Mass"]}
    data["settings"]["curriculum"] = as_data(PLRConfig())
    played = [(key, "=", data["pieces"][0][key]) for key in ("suite", "seed")]
    pq.write_table(pq.read_table(SHIPPED / "random" / MEANS, filters=played), tmp_path / "row" / MEANS)
    data["means"] = file_hash(tmp_path / "row" / MEANS)
    config = BenchmarkConfig(run=RunConfig(root=str(tmp_path)))

    def played_again(method, piece, of, folder):
        options_of(of, method, of.test_levels, "test")
        raise Played

    monkeypatch.setattr(verification, "replay", played_again)

    def write(data):
        stated = {key: value for key, value in data.items() if key not in ("hash", "means")}
        path.write_text(json.dumps({**data, "hash": hash_of(stated)}))
        return path

    def read():
        row = read_row(tmp_path / "row")
        again(config, row)
        row.results()
        with suppress(Played):
            verify(row)

    check(tmp_path, data, write, read)


@pytest.mark.parametrize("kind", ["json", "npz"])
def test_levels_run_nothing(tmp_path, kind):
    path = tmp_path / f"levels.{kind}"
    dataclasses.replace(LEVELS, task="billiards").save(path)
    data, write = (json.loads(path.read_text()), text_at(path)) if kind == "json" else archive_at(path)
    check(tmp_path, data, write, lambda: named(path, partial(task_of, segar.Levels.load(path))))


def test_recordings_of_play_run_nothing(tmp_path):
    data, _ = played(tmp_path / "play.json", LEVELS[:1], [(0, 0)], task="puttputt", steps=2)
    check(tmp_path, data, text_at(tmp_path / "play.json"), lambda: read_play(tmp_path / "play.json"))


def test_sessions_of_a_lab_run_nothing(tmp_path):
    lab, path = Lab(DISTRIBUTION, world=WORLD, noise=0.0), tmp_path / "session.jsonl"
    session = Session(lab)
    session.experiment(steps=2, level=0, set={"golfball": {"Mass": 1.5}})
    session.save(path)
    head, first = map(json.loads, path.read_text().splitlines())

    def write(data):
        path.write_text("".join(f"{json.dumps(line)}\n" for line in data.values()))
        return path

    check(tmp_path, {"head": head, "first": first}, write, lambda: Session.load(path, lab))


def test_suites_run_nothing(tmp_path):
    name, data = "place-few-v1", segar.suites.suite_names.DATA
    (tmp_path / f"{name}.levels.npz").write_bytes((data / f"{name}.levels.npz").read_bytes())
    path, stated = tmp_path / f"{name}.toml", tomllib.loads((data / f"{name}.toml").read_text())
    stated["hidden"], stated["task"]["options"] = ["Mass"], {"reward": "squared"}

    def write(data):
        data["hashes"]["suite"] = suite_hash(data, {what: data["hashes"][what] for what in HASHED})
        path.write_text(segar.suites.freezing._toml(data))
        return path

    check(tmp_path, stated, write, lambda: read_suite(path))


def test_settings_of_a_run_that_a_page_plays_run_nothing(tmp_path):
    NETWORKS["mlp"]().save(tmp_path / "network.npz")
    data = {
        "observation": {"name": "state", "options": {"parameters": ["Gravity"]}},
        "task": {"name": "puttputt", "options": {"reward": "squared"}},
    }
    check(tmp_path, data, text_at(tmp_path / CONFIG), lambda: read_policy(tmp_path, LEVELS))


@pytest.mark.parametrize("kind", ["network", "plan", "snapshot", "textures"])
def test_archives_run_nothing(tmp_path, kind):
    path = tmp_path / f"{kind}.npz"
    if kind == "network":
        next(iter(NETWORKS.values()))().save(path)
    elif kind == "plan":
        plan(LEVELS[:1], segar.puttputt(), rng=np.random.default_rng(0), samples=8, iterations=1).save(path)
    elif kind == "snapshot":
        env = VectorEnv(LEVELS, 1, seed=0)
        env.reset(seed=0)
        env.state().save(path)
    else:
        TextureSet.load("baseline").save(path)
    load = {"network": Network, "plan": Plan, "snapshot": Snapshot, "textures": TextureSet}[kind].load
    check(tmp_path, *archive_at(path), lambda: load(path))


def test_recipes_of_datasets_run_nothing(tmp_path):
    data = {name: "x" if kind is str else True if kind is bool else 1 for name, kind in RECIPE.items()}
    path = tmp_path / "recipe.json"
    check(tmp_path, data, text_at(path), lambda: recipe_from(json.loads(path.read_text()), str(path)))


LOADERS = {
    "levels.npz": segar.Levels.load, "levels.json": segar.Levels.load, "network.npz": Network.load, "plan.npz": Plan.load,
    "snapshot.npz": Snapshot.load, "textures.npz": TextureSet.load, "play.json": read_play, "suite-v1.toml": read_suite,
    "session.jsonl": lambda path: Session.load(path, Lab(DISTRIBUTION, world=WORLD)),
    "config.yaml": lambda path: read_config(path.parent), "row.json": lambda path: read_row(path.parent),
}  # fmt: skip


@pytest.mark.parametrize("name", LOADERS)
def test_what_is_no_file_or_too_large_is_refused_at_once(tmp_path, monkeypatch, name):
    monkeypatch.setenv("SEGAR_FILE_LIMIT", "1")
    path = tmp_path / name
    for what, make in {
        "a device": lambda: path.symlink_to("/dev/zero"),
        "a pipe": lambda: os.mkfifo(path),
        "a folder": path.mkdir,
        "": lambda: (path.touch(), os.truncate(path, 2**40)),
    }.items():
        make()
        with pytest.raises(SegarError, match=f"{name}.*{what}"):
            LOADERS[name](path)
        path.rmdir() if what == "a folder" else path.unlink()
