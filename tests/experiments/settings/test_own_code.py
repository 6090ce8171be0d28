"""Users' own objects and level files in settings: named by files, kept without places, found again from anywhere."""

import sys

import pytest

import segar
from segar.errors import SegarError
from segar.experiments.levels.builders import distribution_of, make_levels
from segar.experiments.settings import ConfigError, LevelsConfig, require_known, run_config, without_files
from segar.support import module_in_file, named_object
from tests.experiments.short_runs import run_module

DEFINITIONS = """
import segar

breeze = segar.family("empty-easy")


def first_half(distribution, count, seed, test):
    return distribution.sample(2 * count, seed=seed, split="train")[:count]


def nothing(distribution, count, seed, test):
    return 3
"""


@pytest.fixture
def lab(tmp_path, monkeypatch):
    """A folder with a Python file and a level file; what is imported from it is forgotten afterwards."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    (tmp_path / "breezes.py").write_text(DEFINITIONS)
    segar.family("empty-easy").sample(8, seed=3).save(tmp_path / "eight.npz")
    yield tmp_path
    sys.modules.pop("breezes", None)


def test_an_object_in_a_file_is_one_of_a_module(lab):
    assert named_object(f"{lab}/breezes.py:breeze") is named_object("breezes:breeze")
    settings = run_config({"levels": {"train": f"{lab}/breezes.py:breeze"}})
    assert settings.levels.train == "breezes:breeze"


def test_a_file_in_a_package_is_a_module_of_the_package(lab):
    package = lab / "lab_of_winds"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "gusts.py").write_text("from lab_of_winds import strength\nforce = strength.FORCE\n")
    (package / "strength.py").write_text("FORCE = 3\n")
    assert module_in_file(package / "gusts.py") == "lab_of_winds.gusts"
    assert named_object(f"{package / 'gusts.py'}:force") == 3


@pytest.mark.parametrize(
    ("file", "message"),
    [("missing.py", "there is no file"), ("json.py", "another module 'json'"), ("my-lab.py", "no name of a module")],
)
def test_a_file_that_cannot_be_imported_is_told_with_its_place(lab, file, message):
    if file != "missing.py":
        (lab / file).write_text("x = 1\n")
    with pytest.raises(ConfigError, match=message) as caught:
        without_files({"train": f"{lab}/{file}:x"}, "levels")
    assert str(caught.value).startswith("levels.train: ")


def test_paths_begin_where_the_file_that_states_them_is(lab):
    stated = without_files({"levels": ["breezes.py:breeze", "eight.npz"]}, folder=lab)
    assert stated["levels"][0] == "breezes:breeze"
    assert stated["levels"][1].startswith(f"{lab}/eight.npz#")


def test_names_of_runs_do_not_contain_where_level_files_lie(lab):
    (lab / "elsewhere").mkdir()
    (lab / "elsewhere" / "eight.npz").write_bytes((lab / "eight.npz").read_bytes())
    runs = [
        run_config({"levels": {"train": f"{place}/eight.npz", "test": "empty-easy"}})
        for place in (lab, lab / "elsewhere")
    ]
    assert runs[0].label() == runs[1].label()
    assert runs[0].label().startswith("eight.npz_")


def test_an_edited_level_file_is_another_run_and_a_named_one_is_refused(lab):
    before = run_config({"levels": {"train": f"{lab}/eight.npz", "test": "empty-easy"}})
    segar.family("empty-easy").sample(8, seed=4).save(lab / "eight.npz")
    after = run_config({"levels": {"train": f"{lab}/eight.npz", "test": "empty-easy"}})
    assert before.hash != after.hash
    with pytest.raises(ConfigError, match="holds other levels than when it was named"):
        make_levels(before.levels)


def test_levels_of_a_file_are_taken_as_if_sampled(lab):
    settings = run_config({"levels": {"train": f"{lab}/eight.npz", "test": "empty-easy", "count": 5}}).levels
    file = distribution_of(settings, "train")
    assert file.sample(5) == file.levels[:5]
    assert file.sample(3, seed=2) == file.sample(5, seed=2)[:3]
    drawn = file.sample(8, seed=2).provenance.indices
    assert sorted(drawn) == list(range(8)) != list(drawn)
    with pytest.raises(ConfigError, match="has 8 levels, not 9"):
        file.sample(9)


def test_a_level_file_in_json_gives_the_levels_of_the_one_in_npz(lab):
    segar.Levels.load(lab / "eight.npz").save(lab / "eight.json")
    runs = [
        run_config({"levels": {"train": f"{lab}/eight.{kind}", "test": "empty-easy", "count": 5}})
        for kind in ("npz", "json")
    ]
    assert make_levels(runs[0].levels)[0] == make_levels(runs[1].levels)[0]
    assert runs[1].label().startswith("eight.json_") and runs[1].levels.train.startswith(f"{lab}/eight.json#")


def test_a_level_file_needs_test_levels_beside_it_and_takes_no_variation(lab):
    name = f"{lab}/eight.npz"
    with pytest.raises(ConfigError, match=r"levels.test: the training levels are those of"):
        make_levels(LevelsConfig(train=name, count=2))
    with pytest.raises(ConfigError, match=r"levels.variation: .* cannot be varied"):
        make_levels(LevelsConfig(train=name, test="empty-easy", count=2, variation="ball_mass"))


def test_a_design_of_ones_own_picks_the_training_levels(lab):
    config = LevelsConfig(
        train="empty-easy", design=f"{module_in_file(lab / 'breezes.py')}:first_half", count=3, seed=1
    )
    train, _ = make_levels(config)
    assert train == segar.family("empty-easy").sample(6, seed=1)[:3]
    with pytest.raises(ConfigError, match=r"levels.design: breezes:nothing returns int, not 3 levels"):
        make_levels(LevelsConfig(train="empty-easy", design="breezes:nothing", count=3))


TRAIN = (
    "scale.frames=64", "algorithm.num_envs=4", "algorithm.num_steps=16", "levels.count=2", "levels.test_count=2",
    "evaluation.episodes=2", "tracking=none", "progress=false",
)  # fmt: skip
LEARNER = """
from dataclasses import dataclass
from segar.experiments.settings import PPOConfig

@dataclass(frozen=True)
class Patient(PPOConfig):
    gamma: float = 0.9
"""


@pytest.mark.slow
def test_a_run_of_files_is_evaluated_from_another_folder(tmp_path):
    (tmp_path / "breezes.py").write_text(DEFINITIONS)
    (tmp_path / "patience.py").write_text(LEARNER)
    names = ("levels=breezes.py:breeze", "algorithm=patience.py:Patient", "levels.design=breezes.py:first_half")
    done = run_module("segar.experiments.train", *names, *TRAIN, f"root={tmp_path}/runs", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (run,) = (tmp_path / "runs").iterdir()
    assert run.name.startswith("breezes_breeze-breezes_first_half-n2-state-Patient-s0-")
    done = run_module("segar.experiments.evaluate", f"run={run}", "videos=none", "scores=false", cwd=sys.prefix)
    assert done.returncode == 0, done.stderr
    assert "its own 2 test levels" in done.stdout


def test_a_file_that_is_not_there_ends_a_command_with_one_line(tmp_path):
    done = run_module("segar.experiments.train", "levels=missing.py:calm", cwd=tmp_path)
    assert done.returncode == 1
    assert done.stderr.splitlines() == [f"error: levels: there is no file {tmp_path}/missing.py"]


def test_a_module_that_a_file_imports_is_not_taken_for_what_was_meant(tmp_path):
    (tmp_path / "shares.py").write_text("import numpy as np\n\n\ndef share(runs):\n    return np.mean(runs)\n")
    with pytest.raises(SegarError) as caught:
        named_object(f"{tmp_path}/shares.py:nope")
    assert str(caught.value) == "'shares' has no 'nope'. Known: share."


def test_a_name_is_known_or_one_that_the_import_would_take():
    for name in ("a", "my_lab.own:found", "folder/file.py:found"):
        require_known("test", name, ["a"], own=True)
    for name in ("meen", "no words:found", ":x", "own:"):
        with pytest.raises(ConfigError, match=f"test: '{name}' is unknown"):
            require_known("test", name, ["a"], own=True)
