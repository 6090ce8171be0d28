"""Evaluation of a run folder on any levels: what is played, what is written, what is refused."""

import csv
import json
import shutil
import sys

import imageio.v2 as imageio
import numpy as np
import pyarrow.parquet as pq
import pytest

import segar
from segar.datasets import check_replay, recipe_of, record
from segar.evaluation import Baselines, find_baselines
from segar.experiments.algorithms.checkpoint import read_checkpoint
from segar.experiments.evaluation.causes import suite_played
from segar.experiments.evaluation.evaluator import as_played, choose_levels, evaluate, label, mean_returns
from segar.experiments.levels.builders import Prepared
from segar.experiments.runs.run_folder import CHECKPOINT, read_episodes, read_summary
from segar.experiments.runs.run_rows import run_rows, score_warnings
from segar.experiments.settings import (
    CheckpointError,
    ConfigError,
    EvaluateConfig,
    LevelsConfig,
    ObservationConfig,
    RunConfig,
    RunFolderError,
)
from segar.experiments.training.run import run
from tests.experiments.short_runs import run_killed, short_run

QUICK = {"scores": False, "videos": "none"}


@pytest.fixture(scope="module")
def trained(trained_once, tmp_path_factory):
    """The folder of a finished run on two levels of empty-easy, in which evaluations may lie."""
    return shutil.copytree(trained_once, tmp_path_factory.mktemp("trained") / "run")


def test_a_runs_own_test_levels_give_what_it_found_at_its_end(trained):
    found = evaluate(EvaluateConfig(str(trained), **QUICK))
    episodes = read_episodes(trained).to_pandas()
    mine = episodes[(episodes.levels == "test") & (episodes.action_mode == "deterministic")]
    rows = [row for row in found.episodes if row["action_mode"] == "deterministic"]
    assert [row["return"] for row in rows] == mine["return"].tolist()
    assert found.summary["players"]["deterministic"]["return"] == pytest.approx(mine["return"].mean())
    assert found.summary["frames"] == read_summary(trained)["frames"]


def test_any_levels_can_be_played_and_everything_is_written(trained, tmp_path):
    said = []
    search = {"planner_samples": 16, "planner_iterations": 2}
    config = EvaluateConfig(str(trained), levels="empty-medium", n=5, seed=3, episodes=2, videos="gif", **search)
    found = evaluate(config, said.append)
    assert found.folder == trained / "evaluations" / "empty-medium-test-n5-s3"
    assert {path.name for path in found.folder.iterdir()} == {
        "episodes.parquet", "summary.json", "levels.npz", "best.gif", "median.gif", "worst.gif",
    }  # fmt: skip
    table = pq.read_table(found.folder / "episodes.parquet").to_pandas()
    assert table.groupby("action_mode").size().to_dict() == {"deterministic": 5, "sampled": 10}
    assert set(table["levels"]) == {"empty-medium"}
    levels = segar.Levels.load(found.folder / "levels.npz")
    wanted = segar.family("empty-medium").sample(5, seed=3, split="test")
    assert np.array_equal(levels.values, wanted.values, equal_nan=True)
    assert json.loads((found.folder / "summary.json").read_text()) == found.summary
    assert "run after 256 frames, on 5 levels of empty-medium (split test, seed 3):" in said[0]
    for name in ("deterministic", "sampled", "no-op", "random", "floor", "best known", "regret"):
        assert name in said[0]


@pytest.fixture(scope="module")
def trained_in_gusts(tmp_path_factory):
    """The folder of a finished run whose rules draw random numbers."""
    levels = LevelsConfig("tests.experiments.evaluation.gusty:WINDY", count=2, test_count=3)
    return run(short_run(tmp_path_factory.mktemp("gusty") / "run", levels=levels), lambda line: None).folder


@pytest.mark.parametrize(
    ("levels", "portable"), [("test", True), ("train", False), ("tests.experiments.evaluation.gusty:WINDY", False)]
)
def test_where_rules_draw_deterministic_actions_are_repeated_like_sampled_ones(levels, portable, trained_in_gusts):
    config = EvaluateConfig(str(trained_in_gusts), levels, n=2, episodes=4, portable=portable, **QUICK)
    found = evaluate(config, lambda line: None)
    for mode in ("deterministic", "sampled"):
        rows = [row for row in found.episodes if row["action_mode"] == mode]
        assert [row["level"] for row in rows] == [0, 1] * 4
        returns = np.reshape([row["return"] for row in rows], (4, 2))
        assert (returns.std(axis=0) > 0).all()
        assert found.summary["players"][mode]["return"] == pytest.approx(returns.mean())


@pytest.fixture(scope="module")
def on_a_raft(tmp_path_factory):
    """The folder of a finished run in a world of a user's own, with its own task, whose actions go up to 3."""
    levels = LevelsConfig("tests.raft:calm", test="tests.raft:strong", count=2, test_count=3)
    return run(short_run(tmp_path_factory.mktemp("raft") / "run", levels=levels), lambda line: None).folder


def test_twins_are_of_the_test_levels_of_a_run_or_of_another_distribution(on_a_raft):
    for levels, n, name in (("test", None, "tests.raft:strong"), ("tests.raft:calm", 2, "tests.raft:calm")):
        found = evaluate(
            EvaluateConfig(str(on_a_raft), levels=levels, n=n, twins=True, modes=("deterministic",), **QUICK)
        )
        rows = list(csv.DictReader((found.folder / "causes.csv").read_text().splitlines()))
        assert {row["suite"] for row in rows} == {f"tests.raft:calm to {name}"}
        differs = [row["group"] for row in rows if row["differs"] == "True"]
        assert differs == ([] if name == "tests.raft:calm" else ["CurrentStrength"])
        assert all(row["twins"] == str(n or 3) for row in rows)
    with pytest.raises(ConfigError, match=r"twins: .* are of levels of a test distribution, and train are none"):
        evaluate(EvaluateConfig(str(on_a_raft), levels="train", twins=True, **QUICK))


def test_causes_in_worlds_of_two_variations_have_two_names():
    """Or the groups of both would be averaged as those of one world."""
    for variation in ("ball_heavy", "gravity_40"):
        trained = RunConfig(levels=LevelsConfig("empty-easy", test_variation=variation))
        levels = Prepared(trained).test_distribution.sample(1, split="test")
        played = suite_played(EvaluateConfig("", levels="test"), trained, levels)
        assert played.name == f"empty-easy to empty-easy {variation}"


def test_an_agent_is_recorded_with_its_world_and_never_with_actions_of_another_scale(on_a_raft, tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    player = as_played(on_a_raft)
    dataset = record("raft/trained-v0", episodes=3, **player)
    assert recipe_of(dataset).unit_actions and max(np.abs(episode.actions).max() for episode in dataset) <= 1
    returns = [row["return"] for row in read_episodes(on_a_raft).to_pylist() if row["levels"] == "test"]
    np.testing.assert_allclose([episode.rewards.sum() for episode in dataset], returns[:3])
    same = {"task": player["task"], "observation": player["observation"], "world": player["levels"].world}
    assert check_replay(dataset, **same) == dataset.total_steps
    with pytest.raises(ConfigError, match=r"acts in \[-1, 1\].* unit_actions=True"):
        record("raft/unscaled-v0", episodes=3, **{**player, "unit_actions": False})


def test_scores_lie_between_chance_and_the_oracle_on_the_same_levels(trained):
    found = evaluate(EvaluateConfig(str(trained), levels="empty-easy", n=4, seed=1, videos="none"))
    levels = segar.family("empty-easy").sample(4, seed=1, split="test")
    baselines = find_baselines(levels, rng=np.random.default_rng(1))
    for player in found.summary["players"].values():
        assert player["score"] == pytest.approx(baselines.normalised(player["return"]))
        assert player["regret"] == pytest.approx(baselines.regret(player["return"]))
    anchors = found.summary["anchors"]
    assert anchors["oracle"] > anchors["floor"] >= max(anchors["random"], found.summary["players"]["no-op"]["return"])
    assert found.summary["players"]["no-op"]["score"] <= 0
    for name, player in found.summary["players"].items():
        of_mode = [row for row in found.episodes if row["action_mode"] == name]
        if of_mode:
            beaten = sum(value > baselines.oracle[level] for level, value in mean_returns(of_mode).items())
            assert player["above_best_known"] == beaten


def test_a_score_above_1_is_told_with_the_levels_and_the_settings_of_a_larger_search(trained, monkeypatch):
    # A planner that is stopped at the random agent's return plus a little is beaten by everything that is better.
    def too_small(levels, task, *, samples, iterations, **others):
        asked.append((samples, iterations))
        low = np.full(len(levels), -1000.0)
        return Baselines(random=low, idle=low, oracle=low + 1)

    asked, said = [], []
    monkeypatch.setattr("segar.experiments.evaluation.evaluator.find_baselines", too_small)
    config = EvaluateConfig(str(trained), videos="none", planner_samples=16, planner_iterations=3)
    found = evaluate(config, said.append)
    assert asked == [(16, 3)]
    (line,) = (line for line in said if "note: deterministic" in line)
    assert "beats the best known return on 3 of 3 levels (score" in line
    assert line.endswith("enlarge it: planner_samples=64 planner_iterations=6")
    assert found.summary["players"]["deterministic"]["above_best_known"] == 3


@pytest.mark.slow
def test_a_film_shows_the_episode_that_was_counted(trained):
    found = evaluate(EvaluateConfig(str(trained), n=3, scores=False, videos="gif", modes=("deterministic",)))
    for name, (level, _) in choose_levels(found.episodes).items():
        (row,) = (row for row in found.episodes if row["level"] == level)
        frames = imageio.mimread(found.folder / f"{name}.gif", memtest=False)
        # One before the first step and one after each; what stands still is stored once.
        assert 2 <= len(frames) <= row["length"] + 1


def test_best_median_and_worst_are_chosen_by_the_mean_return_of_a_level():
    returns = {0: (-5.0, -1.0), 1: (-2.0, -2.0), 2: (-9.0, -9.0), 3: (0.0, -8.0), 4: (-1.0, -1.0)}
    rows = [{"level": level, "return": value} for level, values in returns.items() for value in values]
    assert choose_levels(rows) == {"best": (4, -1.0), "median": (0, -3.0), "worst": (2, -9.0)}
    assert choose_levels(rows[:2]) == {"best": (0, -3.0), "median": (0, -3.0), "worst": (0, -3.0)}


def test_a_level_file_is_played(trained, tmp_path):
    segar.family("empty-easy").sample(4, seed=9).save(tmp_path / "mine.npz")
    found = evaluate(EvaluateConfig(str(trained), levels=str(tmp_path / "mine.npz"), n=2, **QUICK))
    assert found.folder.name == "mine-n2"
    assert {row["level"] for row in found.episodes} == {0, 1}


def test_one_folder_holds_the_results_on_levels_that_are_spelled_in_several_ways(tmp_path, monkeypatch):
    (tmp_path / "spelled.py").write_text("import segar\nmine = segar.family('empty-easy')\n")
    levels = segar.family("empty-easy").sample(2, seed=1)
    levels.save(tmp_path / "mine.npz")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    for names in (("spelled.py:mine", "./spelled.py:mine", f"{tmp_path}/spelled.py:mine", "spelled:mine"),
                  ("mine.npz", "./mine.npz", f"{tmp_path}/mine.npz")):  # fmt: skip
        assert len({label(EvaluateConfig("run", levels=name), levels) for name in names}) == 1


@pytest.mark.slow
def test_levels_that_the_agent_cannot_observe_are_refused_and_pixels_fit_all(trained, tmp_path):
    with pytest.raises(ConfigError, match=r"agent of run observes arrays of shape \(\d+,\); in these levels 'state'"):
        evaluate(EvaluateConfig(str(trained), levels="objectsx1-easy", **QUICK))
    algorithm = short_run(tmp_path).algorithm
    seeing = short_run(tmp_path / "seeing", observation=ObservationConfig("rgb"), algorithm=algorithm)
    found = evaluate(EvaluateConfig(str(run(seeing).folder), levels="tilesx3-easy", n=2, **QUICK))
    assert len(found.episodes) == 4


def test_levels_of_another_task_are_told_without_advice_that_the_command_does_not_take(trained, tmp_path):
    levels = tmp_path / "tiles.npz"
    segar.Levels.from_entities([[segar.GoalTile({segar.Position: (0, 0)})]]).save(levels)
    with pytest.raises(ConfigError, match=r"levels: the agent plays the task puttputt.* these levels do") as told:
        evaluate(EvaluateConfig(str(trained), levels=str(levels), **QUICK))
    assert "task=" not in str(told.value)


def test_edited_settings_of_a_run_are_told(trained, tmp_path):
    folder, said = shutil.copytree(trained, tmp_path / "one"), []
    evaluate(EvaluateConfig(str(folder), **QUICK), said.append)
    assert not any("was edited" in line for line in said)
    path = folder / "config.yaml"
    path.write_text(path.read_text().replace("gamma: 0.", "gamma: 0.5"))
    evaluate(EvaluateConfig(str(folder), trust=True, **QUICK), said.append)
    (note,) = (line for line in said if "was edited" in line)
    assert f"the weights were made with {read_checkpoint(folder / CHECKPOINT)['config']}" in note


def test_what_a_run_does_not_hold_is_refused(tmp_path, trained):
    with pytest.raises(ConfigError, match="n: test has 3 levels, not 50"):
        evaluate(EvaluateConfig(str(trained), n=50))
    with pytest.raises(ConfigError, match=r"out: .* holds a run, whose results would be replaced"):
        evaluate(EvaluateConfig(str(trained), out=str(trained)))
    with pytest.raises(RunFolderError, match=r"there is no file of settings /.*/config.yaml"):
        evaluate(EvaluateConfig(str(tmp_path)))
    (tmp_path / "config.yaml").write_bytes((trained / "config.yaml").read_bytes())
    with pytest.raises(CheckpointError, match="there is no checkpoint in"):
        evaluate(EvaluateConfig(str(tmp_path), levels="empty-easy"))


@pytest.fixture
def moved(tmp_path, monkeypatch):
    """A run on levels of a module of one's own, and the folder that holds the module."""
    places = [*sys.path]
    lab = tmp_path / "before" / "moved_lab"
    lab.mkdir(parents=True)
    (lab / "__init__.py").touch()
    (lab / "levels.py").write_text('import segar\n\ncalm = segar.family("empty-easy")\n')
    monkeypatch.setattr(sys, "path", [*places, str(lab.parent)])
    levels = LevelsConfig("moved_lab.levels:calm", count=2, test_count=2)
    folder = run(short_run(tmp_path / "run", levels=levels), lambda line: None).folder
    forget("moved_lab")
    yield folder, lab
    forget("moved_lab")


def forget(package):
    for name in [name for name in sys.modules if name.partition(".")[0] == package]:
        del sys.modules[name]


def test_a_module_that_cannot_be_imported_any_more_is_told_with_what_is_missing_and_the_folders_that_were_searched(
    moved,
):
    folder, lab = moved
    (lab / "levels.py").write_text("from segar import nothing_of_the_kind\n")
    with pytest.raises(ConfigError, match=r"cannot import name 'nothing_of_the_kind' from 'segar' [^ ]*$"):
        evaluate(EvaluateConfig(str(folder), **QUICK))
    forget("moved_lab")
    (lab / "levels.py").rename(lab / "meadows.py")
    with pytest.raises(ConfigError, match=f"No module named 'moved_lab.levels'. It was looked for in {lab}."):
        evaluate(EvaluateConfig(str(folder), **QUICK))
    forget("moved_lab")
    lab.parent.rename(lab.parent.with_name("after"))
    with pytest.raises(ConfigError) as told:
        evaluate(EvaluateConfig(str(folder), **QUICK))
    says = str(told.value)
    assert says.startswith(
        "run: levels.train: 'moved_lab.levels:calm' cannot be imported: No module named 'moved_lab'."
    )
    assert f"{lab.parent} (which is no longer there)" in says and "among installed packages" in says
    assert says.endswith("which folder holds moved_lab, PYTHONPATH=FOLDER")


def test_code_that_changed_since_training_is_told(trained, tmp_path):
    folder = shutil.copytree(trained, tmp_path / "runs" / "changed")
    path = folder / "versions.json"
    versions = json.loads(path.read_text())
    path.write_text(json.dumps({**versions, "code": {**versions["code"], "kernel": "0" * 16}}))
    said = []
    found = evaluate(
        EvaluateConfig(run=str(folder), videos="none", planner_samples=8, planner_iterations=1), said.append
    )
    assert "changed since: kernel" in said[0]
    assert found.summary["changed_code"] == ["kernel"]  # such scores are left out of tables


def test_the_table_of_runs_has_scores_and_regrets_of_evaluations_that_measured_baselines(trained, tmp_path):
    folder = shutil.copytree(trained, tmp_path / "runs" / "one")
    found = evaluate(EvaluateConfig(run=str(folder), videos="none", planner_samples=8, planner_iterations=1))
    (row,) = run_rows([tmp_path / "runs"])
    for mode in ("deterministic", "sampled"):
        for name in ("score", "regret"):
            assert row.figures[f"{name}_{mode}"] == found.summary["players"][mode][name]
    summary = json.loads((found.folder / "summary.json").read_text())
    del summary["anchors"]
    (found.folder / "summary.json").write_text(json.dumps(summary))
    (row,) = run_rows([tmp_path / "runs"])
    assert not any(name.startswith(("score", "regret")) for name in row.figures)


@pytest.mark.slow
def test_an_evaluation_of_an_unfinished_agent_is_not_that_of_the_finished_one(tmp_path):
    config, small = short_run(tmp_path / "one"), {"videos": "none", "planner_samples": 8, "planner_iterations": 1}
    run_killed(config, 2)
    assert evaluate(EvaluateConfig(config.folder, **small)).summary["frames"] == 128
    run(config)
    (row,) = rows = run_rows([tmp_path])
    assert not any(name.startswith(("score", "regret")) for name in row.figures)
    (warning,) = score_warnings(rows)
    assert "that of one is of the agent after 128 frames, and the run has 256" in warning
    evaluate(EvaluateConfig(config.folder, **small))
    (row,) = rows = run_rows([tmp_path])
    assert "score_deterministic" in row.figures and score_warnings(rows) == []


def test_scores_by_searches_of_several_sizes_are_told_in_one_table(trained, tmp_path):
    for name, samples in (("one", 8), ("other", 12)):
        folder = shutil.copytree(trained, tmp_path / "runs" / name)
        evaluate(EvaluateConfig(str(folder), videos="none", planner_samples=samples, planner_iterations=1))
    rows = run_rows([tmp_path / "runs"])
    (warning,) = score_warnings(rows)
    assert "planner_samples=12 planner_iterations=1; planner_samples=8 planner_iterations=1" in warning
    assert score_warnings(rows[:1]) == []
