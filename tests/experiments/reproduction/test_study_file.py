"""A study is a file: its schema is that of the checks, wrong files are told with place and fix, and grids cross what they
say."""

import json
import re
import sys

import jsonschema
import pytest
import yaml

import segar
import segar.experiments.study
from segar.experiments.commands.hydra_app import compose
from segar.experiments.levels.builders import make_levels
from segar.experiments.reproduce import experiment_files
from segar.experiments.reproduction.checks import check_objects
from segar.experiments.reproduction.experiment_file import experiment_at
from segar.experiments.reproduction.grid import grid_runs
from segar.experiments.reproduction.plan import as_text, make_plan, measure_speeds
from segar.experiments.reproduction.study_file import read_study, schema
from segar.experiments.settings import ConfigError, RunConfig, RunFolderError
from segar.experiments.study import study_of
from tests.crafted import replaced
from tests.experiments.short_runs import run_module

GOOD = {
    "title": "Does it matter?",
    "settings": {"algorithm": "ppo_fast", "observation": "state", "scale.frames": 2000, "levels": {"test_count": 5}},
    "grid": {"families": ["empty-easy", "billiards"], "counts": [1, 4], "seeds": 2},
    "claims": {
        "distance": {"says": "Farther is worse.", "test": "correlation", "given": ["panel"], "expected": "negative"}
    },
}
# Mistakes: where, what, and what the message says.
WRONG = {
    "unknown key": (["grid", "famlies"], [], "no setting is called 'grid.famlies'. Did you mean 'grid.families'?"),
    "unknown test": (["claims", "distance", "test"], "correlate", "claims.distance.test: 'correlate' is unknown"),
    "unknown sign": (["claims", "distance", "expected"], "up", "claims.distance.expected: 'up' is unknown"),
    "no statement": (["claims", "distance"], {"test": "mean"}, "claims.distance.says: it has no default"),
    "a number as a list": (["grid", "counts"], 3, "grid.counts: 3 is not a list"),
    "text as a number": (["grid", "seeds"], "two", "grid.seeds: 'two' is not a whole number"),
    "no column": (["claims", "distance", "of"], "sucess_test", "claims.distance.of: the runs have no column 'sucess_test'"),
    "no sign": (["claims", "distance"], {"says": "x", "test": "mean"}, "claims.distance.expected: say what you expect"),
    "on": (["claims", "distance", True], "empty-hard", "claims.distance: name the levels of a transfer by tested_on"),
    "off": (["claims", "distance", False], "gap", "claims.distance: name the column that is tested by of: ...; YAML takes"),
    "no values": (["grid", "vary"], {"algorithm.gamma": 0.9}, "grid.vary.algorithm.gamma: 0.9 is not allowed; it must be"),
    "no counts": (["grid", "counts"], [], "grid.counts: [] is not allowed; it must be a list of one or more"),
    "a count twice": (["grid", "counts"], [2, 2], "grid.counts: [2, 2] is not allowed; it must be a list in which each stands"),
    "between equal values": (
        ["claims", "distance"],
        {"says": "x", "test": "difference", "expected": "none", "between": {"n": [1, "1"]}},
        "claims.distance.between: {'n': [1, '1']} is not allowed; it must be one column with two different values",
    ),
    "a transfer twice": (
        ["transfers"], [{"family": "billiards"}] * 2,
        "transfers[1]: {'family': 'billiards'} is not allowed; it must be another transfer than those before it",
    ),
    "a value twice": (["grid", "vary"], {"algorithm.gamma": [0.9, 0.9]}, "grid.vary.algorithm.gamma: [0.9, 0.9] is not all"),
    "a name of its own": (["grid", "vary"], {"seed": [1]}, "grid.vary.seed: 'seed' is not allowed; it must be varied by"),
}  # fmt: skip
IN_SCHEMA = ("unknown key", "unknown sign", "no statement", "a number as a list", "text as a number")


def written(folder, data, name="mine.yaml"):
    path = folder / name
    path.write_text(yaml.safe_dump(data))
    return path


def test_the_example_of_the_help_fits_the_schema_and_so_do_all_experiments():
    example = re.search(r"::\n\n(    title.*?)\n\nThe command", segar.experiments.study.__doc__, re.DOTALL)[1]
    jsonschema.validate(yaml.safe_load(example), schema())
    for data in experiment_files().values():
        jsonschema.validate(data, schema())


@pytest.mark.slow
def test_the_schema_is_one_and_the_command_prints_it():
    jsonschema.Draft202012Validator.check_schema(schema())
    assert json.loads(run_module("segar.experiments.study", "--schema").stdout) == schema()


@pytest.mark.parametrize(("place", "value", "message"), WRONG.values(), ids=WRONG)
def test_a_wrong_file_is_told_with_its_name_and_the_place(tmp_path, place, value, message):
    path = written(tmp_path, replaced(GOOD, place, value))
    with pytest.raises(ConfigError, match=re.escape(f"{path}: {message}")):
        read_study(path)


def test_a_transfer_in_two_spellings_is_refused_as_the_same(tmp_path):
    (tmp_path / "far_away.py").write_text("import segar\nlevels = segar.family('empty-hard')\n")
    transfers = [{"family": "far_away.py:levels"}, {"family": "far_away:levels"}]
    path = written(tmp_path, {**GOOD, "transfers": transfers})
    with pytest.raises(ConfigError, match=r"transfers\[1\]: .* must be another transfer than those before it"):
        read_study(path)


@pytest.mark.parametrize("name", [
    "subprocess:run", "os:system", "builtins:eval", "__main__:sys.exit", "numpy:load",
    "segar.engine.targets.numba_ir:subprocess.run", "experiments.study:json.dumps", "analysis.report.make:Path",
])  # fmt: skip
@pytest.mark.parametrize("place", [("settings", "task.name"), ("claims", "distance", "test"), ("grid", "families"),
                                   ("grid", "designs"), ("settings", "algorithm")])  # fmt: skip
def test_a_study_reaches_what_lies_beside_it_and_not_python_its_packages_or_segar(tmp_path, monkeypatch, place, name):
    """Also where something of the same name, which no import would take, lies beside it."""
    study = {**GOOD, "claims": {"distance": {"says": "x", "test": "mean", "expected": "none"}}}
    study = replaced(study, place, [name] if place[0] == "grid" else name)
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(study))
    (tmp_path / name.partition(":")[0].partition(".")[0]).mkdir()
    with pytest.raises(RunFolderError, match=rf"names code that would be imported: {re.escape(name)} \({place[0]}"):
        read_study(tmp_path / "mine.yaml")
    monkeypatch.setenv("SEGAR_TRUST", name.partition(":")[0].partition(".")[0])
    read_study(tmp_path / "mine.yaml")


def test_a_tab_is_told_with_its_line(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("title: x\n\tgrid: 3\n")
    with pytest.raises(ConfigError, match=r"mine.yaml is not a study.*: line 2: .*; indent it by spaces"):
        read_study(path)


def test_a_setting_that_the_grid_varies_says_nothing_beside_it(tmp_path):
    data = replaced(GOOD, ["settings", "observation.options.normalise"], True)
    data["grid"]["vary"] = {"observation.options.normalise": [True, False]}
    with pytest.raises(ConfigError, match=r"settings.observation.options.normalise: it would say nothing .* grid.vary"):
        read_study(written(tmp_path, data))


def test_a_key_that_stands_twice_is_refused_with_its_lines(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("title: x\ngrid:\n  counts: [1]\n  seeds: 2\n  counts: [2]\n")
    with pytest.raises(ConfigError, match=r"mine.yaml .*: line 5: the key counts .* for the second time; .* line 3"):
        read_study(path)
    path.write_text("title: x\ngrid: &same\n  counts: [1]\n  seeds: 2\nscales: {more: {<<: *same, counts: [2]}}\n")
    assert read_study(path).experiment["scales"] == {"more": {"counts": [2], "seeds": 2}}


@pytest.mark.parametrize(
    ("settings", "grid", "by"),
    [
        ({"levels.count": 7}, {}, "counts"),
        ({"levels": {"count": 7}}, {}, "counts"),
        ({"levels.seed": 7}, {}, "level_sets"),
        ({"levels": "empty-hard"}, {}, "families"),
        ({"scale.frames": 10}, {"frames": 20}, "frames"),
    ],
)
def test_settings_that_say_nothing_beside_the_grid_are_refused(tmp_path, settings, grid, by):
    data = {**GOOD, "settings": settings, "grid": {**GOOD["grid"], **grid}}
    says = rf"\w: it would say nothing beside the grid, which says it for all runs: grid.{by}$"
    with pytest.raises(ConfigError, match=f"mine.yaml: settings.*{says}"):
        read_study(written(tmp_path, data))
    path = written(tmp_path, {**data, "settings": {}})
    if not isinstance(settings.get("levels"), dict):
        with pytest.raises(ConfigError, match=says):
            study_of([str(path), *(f"{name}={value}" for name, value in settings.items())])
    assert compose(read_study(path).overrides())


@pytest.mark.parametrize("name", IN_SCHEMA)
def test_the_schema_refuses_what_the_checks_refuse(name):
    place, value, _ = WRONG[name]
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(replaced(GOOD, place, value), schema())


@pytest.mark.parametrize(
    ("name", "reason"), [("nowhere.yaml", "there is no study {}"), ("folder.yaml", "{} is no study: it is a folder")]
)
def test_a_file_that_is_not_there_is_told_in_one_line_with_its_path(tmp_path, monkeypatch, name, reason):
    (tmp_path / "folder.yaml").mkdir()
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError) as told:
        study_of([name])
    assert str(told.value) == reason.format(tmp_path / name)
    assert "Errno" not in str(told.value) and "\n" not in str(told.value)


def test_settings_of_the_file_come_before_those_of_the_command_line(tmp_path):
    path = written(tmp_path, GOOD)
    study, overrides = study_of([str(path), "scale.frames=100", "seed=7"])
    run = compose(overrides)
    assert (run.algorithm.name, run.observation.name, run.levels.test_count) == ("ppo_fast", "state", 5)
    assert (run.scale.frames, run.seed) == (100, 7)
    assert study.name == "mine"


def test_values_of_all_kinds_reach_the_settings(tmp_path):
    stated = {
        "task.options": {"reward": "linear", "of_my_own": {"a": [1, 2]}},
        "evaluation.distances": ["exact"],
        "tracking.experiment": "a b, 'c'",
    }
    data = {**GOOD, "settings": {**stated, "levels.test": None, "progress": False}}
    run = compose(read_study(written(tmp_path, data)).overrides())
    assert run.task.options == {"reward": "linear", "of_my_own": {"a": [1, 2]}}
    assert run.evaluation.distances == ("exact",)
    assert run.tracking.experiment == "a b, 'c'"
    assert (run.levels.test, run.progress) == (None, False)


@pytest.mark.parametrize("arguments", [[], ["one.yaml", "two.yml"]])
def test_a_command_line_names_one_study(arguments):
    with pytest.raises(ConfigError, match="name one study, a YAML file"):
        study_of(arguments)


def runs_of(folder, settings=GOOD["settings"], **grid):
    data = {**GOOD, "settings": settings, "grid": {**GOOD["grid"], **grid}}
    study = read_study(written(folder, data))
    return list(grid_runs(experiment_at("mine", study.experiment, "single").grid, compose(study.overrides())))


@pytest.mark.parametrize("where", ["mine", "it's mine, a=b [1]"])
@pytest.mark.parametrize("absolute", [False, True])
def test_level_files_of_settings_and_grid_are_those_beside_the_study_whatever_their_path(tmp_path, where, absolute):
    folder = tmp_path / where
    folder.mkdir()
    for seed, name in enumerate(("a.npz", "b c.npz", "test.npz")):
        segar.family("empty-easy").sample(4, seed=seed).save(folder / name)
    names = [str(folder / name) if absolute else name for name in ("a.npz", "b c.npz", "test.npz")]
    settings = {"observation": "state", "levels.test": names[2], "levels.test_count": 4}
    runs = runs_of(folder, settings, families=names[:2], counts=[4], seeds=1)
    paths = {(run.levels.train.partition("#")[0], run.levels.test.partition("#")[0]) for run in runs}
    assert paths == {(str(folder / name), str(folder / "test.npz")) for name in ("a.npz", "b c.npz")}
    check_objects(runs)
    expected = segar.Levels.load(folder / "test.npz").values
    assert all(make_levels(run.levels)[1].values[0].tobytes() == expected[0].tobytes() for run in runs)


def test_each_seed_is_that_of_an_agent_and_of_its_level_set(tmp_path):
    runs = runs_of(tmp_path)
    assert {(run.seed, run.levels.seed) for run in runs} == {(0, 0), (1, 1)}
    assert {run.levels.train for run in runs} == {"empty-easy", "billiards"}
    assert len(runs) == len({run.label() for run in runs}) == 8
    crossed = runs_of(tmp_path, level_sets=3)
    assert {(run.seed, run.levels.seed) for run in crossed} == {(agent, one) for agent in (0, 1) for one in (0, 1, 2)}


def test_level_sets_that_are_not_nested_have_seeds_of_their_own(tmp_path):
    runs = runs_of(tmp_path, counts=[3, 5], nested=False)
    assert {(run.levels.count, run.seed, run.levels.seed) for run in runs} == {
        (3, 0, 0),
        (3, 1, 1),
        (5, 2, 2),
        (5, 3, 3),
    }
    crossed = runs_of(tmp_path, counts=[3, 5], nested=False, level_sets=3)
    sets = {n: {run.levels.seed for run in crossed if run.levels.count == n} for n in (3, 5)}
    assert sets == {3: {0, 1, 2}, 5: {3, 4, 5}}
    assert len(crossed) == 2 * 2 * len(runs) * 3 // 4


def test_any_setting_varies(tmp_path):
    runs = runs_of(tmp_path, vary={"algorithm.gamma": [0.9, 0.99], "levels.test": ["empty-hard"]})
    assert {(run.algorithm.gamma, run.levels.test) for run in runs} == {(0.9, "empty-hard"), (0.99, "empty-hard")}
    with pytest.raises(ConfigError, match=r"no setting is called 'algorithm.gama'"):
        runs_of(tmp_path, vary={"algorithm.gama": [0.9]})
    with pytest.raises(ConfigError, match=r"seed: .* is not a whole number"):
        runs_of(tmp_path, vary={"seed.of_levels": [1]})


@pytest.mark.parametrize("grid", [{"seeds": 10**9}, {"level_sets": 10**30}])
def test_a_grid_that_does_not_end_is_refused_at_once(tmp_path, grid):
    with pytest.raises(ConfigError, match=r"grid: '[0-9]+ runs' is not allowed; it must be at most 100,000 runs"):
        runs_of(tmp_path, **grid)


def test_a_group_of_settings_that_varies_is_replaced_whole(tmp_path):
    groups = [{"reward": "linear"}, {}]
    base = {"task.options": {"max_steps": 7}}
    runs = runs_of(tmp_path, {**GOOD["settings"], **base}, vary={"task.options": groups})
    assert {str(dict(run.task.options)) for run in runs} == set(map(str, groups))


def test_a_wrong_name_of_an_own_object_ends_the_plan(tmp_path):
    (tmp_path / "mylab.py").write_text("import segar\ncalm = segar.family('empty-easy')\n")
    sys.modules.pop("mylab", None)
    (run, *_) = runs_of(tmp_path, families=["mylab.py:calm"])
    assert run.levels.train == "mylab:calm"
    check_objects([run])
    (run, *_) = runs_of(tmp_path, families=["mylab.py:clam"])
    with pytest.raises(ConfigError, match=r"^grid.families: 'mylab' has no 'clam'. Did you mean 'calm'\?"):
        check_objects([run])


def test_agents_that_would_see_other_numbers_on_other_levels_end_the_plan(tmp_path):
    data = {
        "title": "x",
        "grid": {"families": ["empty-easy"], "counts": [1]},
        "transfers": [{"family": "objectsx1-easy"}],
    }
    base = compose(["observation=state", f"root={tmp_path}"])
    with pytest.raises(ConfigError, match=r"transfers: objectsx1-easy: .* does not show the same"):
        make_plan([experiment_at("mine", data, "single")], base, tmp_path)


def test_an_experiment_without_scales_is_run_at_all_and_one_with_scales_at_these():
    data = {key: value for key, value in GOOD.items() if key != "settings"}
    assert experiment_at("mine", data, "single").grid.counts == (1, 4)
    assert experiment_at("mine", {**data, "scales": {"quick": {}}}, "single") is None


GIVES = {"of": "gap", "against": "w2", "given": ["cell"], "between": {"n": [1, 10]}}
FITTING = {
    "correlation": {"against", "given", "of"},
    "difference": {"of", "between"},
    "mean": {"of"},
    "own:test": set(),
}


@pytest.mark.parametrize("key", GIVES)
@pytest.mark.parametrize("test", FITTING)
def test_a_claim_has_the_keys_of_its_test_and_the_schema_says_the_same(tmp_path, test, key):
    needed = {"between": GIVES["between"]} if test == "difference" else {}
    claim = {"says": "x", "test": test, "expected": "none", "where": {"n": 1}, **needed, key: GIVES[key]}
    data = {**GOOD, "claims": {"mine": claim}}
    if key in FITTING[test]:
        jsonschema.validate(data, schema())
        read_study(written(tmp_path, data))
        return
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(data, schema())
    taken = ", ".join([*(name for name in GIVES if name in FITTING[test]), "where", "tested_on", "margin"])
    with pytest.raises(ConfigError) as caught:
        read_study(written(tmp_path, data))
    assert re.search(
        rf"claims\.mine\.{key}: it would say nothing beside test: [\w:]+, which takes {taken}$", str(caught.value)
    )


CLAIM = {"says": "x", "test": "correlation", "expected": "negative"}


@pytest.mark.parametrize(
    ("claim", "grid", "says"),
    [
        ({}, {}, "it has 2 blocks, and an interval takes 3. Its blocks are whole panels"),
        ({"given": ["log_n"]}, {"seeds": 5}, "it has 2 blocks, and an interval takes 3. Its blocks are whole panels"),
        ({}, {"families": ["empty-easy"]}, "it has 2 blocks, and an interval takes 3. Its blocks are level sets"),
        ({}, {"families": ["empty-easy"], "seeds": 1}, "it has 1 block, and an interval takes 3"),
        ({}, {"families": ["empty-easy"], "seeds": 3}, ""),
        ({}, {"families": ["empty-easy", "empty-hard", "billiards"], "seeds": 1}, ""),
        ({"given": ["cell"]}, {}, ""),  # four level sets of two panels
        ({"where": {"family": "billiards"}}, {}, "it has 2 blocks"),
        ({"test": "mean"}, {}, ""),
        ({"test": "mean", "where": {"cell": "billiards--1"}}, {}, "it has 2 blocks"),
        ({"test": "difference", "between": {"family": ["billiards", "empty"]}}, {}, "it has 2 blocks"),
        ({"test": "difference", "between": {"n": [4, 1]}}, {}, ""),
        ({"test": "difference", "between": {"n": [4, 1]}}, {"seeds": 1}, "it has 2 blocks"),
    ],
)
def test_the_plan_warns_of_a_claim_that_its_runs_cannot_test(tmp_path, claim, grid, says):
    data = {**GOOD, "grid": {**GOOD["grid"], **grid}, "claims": {"mine": {**CLAIM, **claim}}}
    study = read_study(written(tmp_path, data))
    plan = make_plan([experiment_at("mine", study.experiment, "")], RunConfig(root=str(tmp_path / "runs")), tmp_path)
    text = as_text(plan, measure_speeds(tmp_path / "runs"), 1, RunConfig().scale)
    warnings = [
        line for line in text.splitlines() if line.startswith("warning: claims.mine cannot be tested by this design: ")
    ]
    assert len(warnings) == bool(says) and says in "".join(warnings)
