"""Hydra as its users know it: own sweep files, own groups in a folder or a package, own algorithms, and --cfg job."""

import os
import re
import sys
from typing import Any

import pytest
import yaml

from segar.experiments.commands.config_store import register_settings
from segar.experiments.commands.hydra_app import (
    build_run,
    check_command_line,
    compose,
    compose_data,
    initialized,
    to_plain,
)
from segar.experiments.commands.overrides import (
    VALUE,
    number_of_runs,
    parse,
    quoted,
    single_runs,
    unquoted,
    with_own_names,
    with_search_path,
)
from segar.experiments.levels.builders import Prepared
from segar.experiments.reproduction.plan import Speeds, sweep_as_text
from segar.experiments.runs.run_folder import read_config, run_folders
from segar.experiments.settings import KINDS, ConfigError, as_data, run_config
from tests.experiments.short_runs import COMMAND, run_module

SWEEP = """
# @package _global_
defaults:
  - override /algorithm: sac
  - _self_
hydra:
  mode: MULTIRUN
  sweeper:
    params:
      algorithm.gamma: 0.9,0.95
algorithm:
  num_envs: 4
  num_steps: 8
  warmup: 8
  batch_size: 4
  widths: [8]
"""
CONFIG = """
from dataclasses import dataclass

from segar.experiments.settings import Count, PPOConfig


@dataclass(frozen=True)
class MineConfig(PPOConfig):
    name: str = "mine"
    learner = "my_lab.learner:Mine"
    layers: Count = 2
"""
LEARNER = """
from segar.experiments.algorithms.ppo import PPO


class Mine(PPO):
    pass
"""
RUN = [part for part in COMMAND if not part.startswith("algorithm")]


@pytest.fixture
def my_lab(tmp_path, monkeypatch):
    """A user's package with an algorithm and groups of settings in ``my_lab.conf``; its parent is the working directory."""
    files = {
        "__init__.py": "",
        "mine.py": CONFIG,
        "learner.py": LEARNER,
        "conf/__init__.py": "",
        "conf/algorithm/mine.yaml": "defaults: [base_ppo, _self_]\n_target_: my_lab.mine.MineConfig\nname: mine\nlayers: 3\n",
        "conf/observation/far_two.yaml": "name: textures\noptions: {textures: far}\n",
        "conf/sweep/my_sweep.yaml": SWEEP,
    }
    for name, text in files.items():
        path = tmp_path / "my_lab" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    yield tmp_path / "my_lab"
    for name in [name for name in sys.modules if name.partition(".")[0] == "my_lab"]:
        del sys.modules[name]


def in_folder(module, *arguments):
    """What ``python -m <module>`` does in the working directory."""
    return run_module(module, *arguments, cwd=os.getcwd())


@pytest.mark.slow
def test_a_sweep_file_of_the_users_own_may_choose_an_algorithm_and_sweep_its_settings(my_lab, tmp_path):
    done = in_folder(
        "segar.experiments.train", "+sweep=my_sweep", *RUN, f"root={tmp_path / 'runs'}", "tracking=none",
        "--config-dir", str(my_lab / "conf"),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found: list[Any] = [read_config(folder).algorithm for folder in run_folders(tmp_path / "runs")]
    assert sorted((type(one).name, one.gamma) for one in found) == [("sac", 0.9), ("sac", 0.95)]


@pytest.mark.slow
def test_an_algorithm_of_a_package_is_trained_and_its_run_read_again(my_lab, tmp_path):
    small = [part for part in COMMAND if part.startswith("algorithm.")]
    done = in_folder(
        "segar.experiments.train", "hydra.searchpath=[pkg://my_lab.conf]", *RUN, "algorithm=mine", *small, "algorithm.layers=4",
        f"root={tmp_path / 'runs'}", "tracking=none",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    (folder,) = run_folders(tmp_path / "runs")
    assert yaml.safe_load((folder / "config.yaml").read_text())["algorithm"]["_target_"] == "my_lab.mine.MineConfig"
    config = read_config(folder)
    algorithm: Any = config.algorithm
    assert (type(algorithm).__name__, algorithm.layers) == ("MineConfig", 4)
    assert config.identity()["algorithm"]["kind"] == "my_lab.mine.MineConfig"
    assert "_target_" not in config.identity()["algorithm"]


@pytest.mark.parametrize(
    "module", ["train", *(pytest.param(x, marks=pytest.mark.slow) for x in ("search", "reproduce"))]
)
def test_groups_of_a_package_are_found_by_every_command(my_lab, module):
    asked = ["hydra.searchpath=[pkg://my_lab.conf]", "algorithm=mine", "observation=far_two"]
    done = in_folder(f"segar.experiments.{module}", *asked, "--cfg", "job")
    assert done.returncode == 0, done.stderr
    shown = yaml.safe_load(done.stdout)
    assert module != "train" or run_config(shown) == compose(asked)  # the settings that a run would have
    assert shown["algorithm"]["_target_"] == "my_lab.mine.MineConfig" and shown["algorithm"]["layers"] == 3
    assert shown["observation"] == {"name": "textures", "options": {"textures": "far"}}


@pytest.mark.slow
def test_a_grid_may_name_choices_of_a_package(my_lab, tmp_path):
    (my_lab / "conf" / "experiment").mkdir()
    grid = {"counts": [1], "algorithms": ["mine"], "observations": ["far_two"], "families": ["empty"], "seeds": 1}
    data = {"title": "Mine", "grid": {**grid, "difficulties": ["easy"]}, "scales": {"smoke": {}}}
    (my_lab / "conf" / "experiment" / "my_grid.yaml").write_text(yaml.safe_dump(data))
    done = in_folder(
        "segar.experiments.reproduce", "scale=smoke", "hydra.searchpath=[pkg://my_lab.conf]",
        "+experiment@grids.my_grid=my_grid", "experiments=[my_grid]", "dry_run=true", f"root={tmp_path / 'runs'}",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "smoke: 1 run, 0 done, 1 to do" in done.stdout


@pytest.mark.parametrize("kind", KINDS)
def test_the_defaults_of_every_kind_of_algorithm_are_a_choice(kind):
    with initialized():
        data = to_plain(compose_data([f"algorithm=base_{kind}"], "config"))
    assert data["algorithm"] == as_data(KINDS[kind]())


@pytest.mark.parametrize(
    ("target", "says"),
    [
        ("my_lab.mine.MinConfig", "algorithm._target_: 'my_lab.mine' has no 'MinConfig'. Did you mean 'MineConfig'?"),
        (
            "my_lab.learner.Mine",
            "'my_lab.learner.Mine' is not a sub-class of segar.experiments.settings.AlgorithmConfig",
        ),
        ("my_lab.my.MineConfig", "algorithm._target_: 'my_lab.my:MineConfig' cannot be imported"),
    ],
)
def test_a_target_that_is_no_algorithm_is_told(my_lab, target, says):
    with pytest.raises(ConfigError, match=re.escape(says)):
        run_config({"algorithm": {"_target_": target}})


def test_a_setting_that_an_own_algorithm_s_file_leaves_out_is_told_how_to_be_added(my_lab):
    for stated, named in (("name: bare\n", "bare"), ("", r"my_lab\.mine\.MineConfig")):
        (my_lab / "conf" / "algorithm" / "bare.yaml").write_text(f"_target_: my_lab.mine.MineConfig\n{stated}")
        places = with_search_path(["algorithm=bare"], ["pkg://my_lab.conf"])
        with pytest.raises(ConfigError, match=f"the file of {named} does not state algorithm.layers"):
            compose([*places, "algorithm.layers=5"])
    assert compose([*places, "++algorithm.layers=5"]).algorithm.layers == 5  # type: ignore[attr-defined]


def test_a_sweep_is_checked_for_every_choice_and_one_value_of_other_settings():
    with initialized():
        runs = single_runs(["algorithm=sac,ppo", "seed=range(1,4)", "levels.count=3", "algorithm.gamma=interval(0,1)"])
        own = single_runs(["levels.train=my_lab.levels:a,my_lab.levels:b", "seed=1,2"])
    assert runs == [["algorithm=sac", "seed=1", "levels.count=3"], ["algorithm=ppo", "seed=1", "levels.count=3"]]
    names = ["levels.train=my_lab.levels:a", "levels.train=my_lab.levels:b"]
    assert [run[0].replace("\\", "") for run in own] == names  # Hydra writes a backslash before the colon


def test_a_sweep_is_told_with_the_number_of_its_runs_and_what_decides_their_time(monkeypatch):
    register_settings()
    monkeypatch.setattr(
        "sys.argv", ["train", "+sweep=demo", "scale.frames=range(10,12)", "levels=empty-easy,billiards"]
    )
    configs, number = check_command_line("config")
    runs = [build_run(one) for one in configs]
    assert number == 4 * 2 * 2 and {run.scale.frames for run in runs} == {10, 11}
    told = sweep_as_text(runs, number, Speeds({}, {}, 0))
    assert told.startswith("sweep: 16 runs of 10 frames, in ") and "by assumed speeds" in told
    for values in ("interval(1,2)", "1"):  # another program chooses the values; no sweep
        monkeypatch.setattr("sys.argv", ["train", f"seed={values}", *["--multirun"] * (values != "1")])
        assert check_command_line("config")[1] == 0


def test_a_sweep_of_more_runs_than_anyone_has_time_for_is_refused_before_they_are_listed():
    with initialized():
        assert number_of_runs(["seed=range(1,100001)"]) == 100_000
        for sweep in ("seed=range(1,1000000000)", "scale.frames=range(1,1000000000)"):
            with pytest.raises(ConfigError, match=r"--multirun: '100,001 runs or more'.* at most 100,000 runs"):
                single_runs([sweep])
        with pytest.raises(ConfigError, match="1,000,000 runs"):
            single_runs(["seed=range(1,1001)", "scale.count=range(1,1001)"])


def test_a_search_path_is_added_to_the_one_that_is_stated():
    assert with_search_path(["seed=1"], []) == ["seed=1"]
    added = with_search_path(["hydra.searchpath=[pkg://a]", "seed=1"], ["file:///b c"])
    assert added == ["seed=1", "hydra.searchpath=['pkg://a','file:///b c']"]


def test_own_objects_are_named_where_groups_are_chosen():
    own = compose(["levels=my_lab.levels:windy", "task=my_lab.tasks:slow", "observation=my_lab.seen:looks"])
    assert (own.levels.train, own.task.name, own.observation.name) == (
        "my_lab.levels:windy", "my_lab.tasks:slow", "my_lab.seen:looks",
    )  # fmt: skip
    assert own == compose(
        ["levels.train=my_lab.levels:windy", "task.name=my_lab.tasks:slow", "observation.name=my_lab.seen:looks"]
    )


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ("levels=my_lab.nowhere:windy", "levels.train: 'my_lab.nowhere:windy' cannot be imported"),
        ("levels.test=os:nothing", "levels.test: 'os' has no 'nothing'"),
        ("observation=os:getcwdd", "observation.name: 'os' has no 'getcwdd'. Did you mean 'getcwd'?"),
        ("task=os.path:nothing", "task.name: 'os.path' has no 'nothing'"),
    ],
)
def test_an_own_object_that_does_not_exist_is_told_by_its_setting(override, says):
    with pytest.raises(ConfigError, match=f"^{re.escape(says)}"):
        Prepared(compose([override])).check_names()


@pytest.mark.parametrize("override", ["levels.train", "levels.test", "seed"])
def test_a_setting_that_refers_to_what_is_not_there_is_told_by_its_name(override, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["train", f"{override}=${{oc.env:NOT_SET_ANYWHERE}}"])
    with pytest.raises(ConfigError, match=f"cannot be read: .*'NOT_SET_ANYWHERE' not found.* full_key: {override}"):
        (check_command_line("config"), compose(sys.argv[1:]))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (b"seed: 1\nseed: 2\n", "found duplicate key seed in .*wrong.yaml"),
        (b"\tseed: 1\n", "cannot start any token in .*wrong.yaml"),
        (b"seed: \0\n", "special characters are not allowed in .*wrong.yaml"),
        (b"seed: \xf6\n", "can't decode byte 0xf6 in position 6: .*, in the file with b'seed: "),
        (b"seed: " + b"[" * 3000, "recursion"),
    ],
)
def test_a_file_of_settings_that_cannot_be_read_is_told(my_lab, text, says):
    (my_lab / "conf" / "sweep" / "wrong.yaml").write_bytes(text)
    with pytest.raises(ConfigError, match=f"settings cannot be read: .*{says}"):
        compose(["+sweep=wrong", "hydra.searchpath=[pkg://my_lab.conf]"])


@pytest.mark.parametrize(
    "text", ["/a b/c.npz#12345678", "it's", "a\\'b", "ends with \\", "two\\\\in", '"said"', "x,y", "{a: b}", "a=b"]
)
def test_a_quoted_text_is_itself_to_hydra_and_comes_back(text):
    (override,) = parse([f"levels.test={quoted(text)}"])
    assert str(override.value()) == text == unquoted(quoted(text))
    assert VALUE.findall(f"{quoted(text)},{quoted('b')}") == [quoted(text), quoted("b")]


@pytest.mark.parametrize(
    ("override", "read"),
    [
        ("root=/home/Jörg/my runs", "root='/home/Jörg/my runs'"),
        ("levels.test=größe:böig,lab:calm", "levels.test='größe:böig',lab:calm"),
        ("levels=labör.größe:böig", "levels.train='labör.größe:böig'"),
        ("tracking.sweep=choice(größe,'ä, b',3)", "tracking.sweep=choice('größe','ä, b',3)"),
        ("evaluation.distances=[ größe , exact]", "evaluation.distances=[ 'größe' , exact]"),
        ("task.options={a: 'größe'}", "task.options={a: 'größe'}"),
        ("levels.count=1,10", "levels.count=1,10"),
    ],
)
def test_letters_of_all_languages_stand_in_overrides_without_quotation_marks(override, read):
    assert with_own_names([override]) == [read] and parse([read])


def test_settings_on_both_sides_of_an_option_are_told_to_stand_on_one(monkeypatch):
    register_settings()
    monkeypatch.setattr("sys.argv", ["train", "levels=empty-easy", "--multirun", "seed=1,2", "levels.test=empty-hard"])
    with pytest.raises(ConfigError, match="on one side of options such as --multirun, all of them: move seed=1,2"):
        check_command_line("config")


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["observation=rgb", "observation=state"], "observation=rgb and observation=state both say what"),
        (["observation=my_lab.seen:looks", "observation=state"], "both say what observation.name is"),
        (["suite=place-few-v1", "levels=empty-easy"], "suite=place-few-v1 and levels=empty-easy both say what"),
        (["suite=[place-few-v1,look-far-v1]"], "suite: takes one name, not the list .*--multirun suite=A,B"),
        (["levels=empty-easy,my_lab.levels:windy"], "levels.train=empty-easy,my_lab.levels:windy takes both"),
        *(
            ([f"{group}={value}"], f"^{group}: takes a name, and {group}={value} gives none$")
            for group, value in [("tracking", "null"), ("scale", "0"), ("task", "true"), ("curriculum", "1.5")]
        ),
        (["levels=place-few-v1"], "place-few-v1 is a suite, and says what is played, too: suite=place-few-v1"),
    ],
)
def test_names_of_which_one_would_count_are_refused(overrides, message):
    with pytest.raises(ConfigError, match=message):
        compose(overrides)


@pytest.mark.parametrize("value", ["/runs (1)", "/a [b]", "/lr=0.1", "/Größe [b]"])
def test_a_value_that_cannot_be_read_is_named_and_can_be_given_in_quotation_marks(value):
    with pytest.raises(ConfigError, match=r"^root=.* cannot be read: .* quotation marks: \"root='\.\.\.'\"$"):
        compose(["seed=3", f"root={value}"])
    assert compose(["seed=3", f"root='{value}'"]).root == value
