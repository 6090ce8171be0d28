"""The table of runs: which settings differ, how far each is, what it achieved; and the mistakes one makes on the way."""

import csv
import dataclasses
import json
import shutil
import threading
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import segar
from segar.analysis.runs import read_runs
from segar.experiments.results import results
from segar.experiments.runs.run_folder import (
    EPISODES,
    SUMMARY,
    VERSIONS,
    read_episodes,
    read_metrics,
    read_versions,
    use_run_folder,
    write_json,
)
from segar.experiments.runs.run_rows import (
    RunRow,
    as_columns,
    copies_warning,
    in_short,
    mixed_code,
    once_each,
    run_rows,
    state_of,
)  # fmt: skip
from segar.experiments.runs.versions import computed_with
from segar.experiments.settings import (
    ConfigError,
    EvaluationConfig,
    LevelsConfig,
    RunFolderError,
    TaskConfig,
    TrackingConfig,
)
from segar.experiments.training.run import run
from tests.experiments.short_runs import before_iteration, run_killed, short_run
from tests.synthetic_runs import settings, write_run


def told(capsys, **asked):
    """What the command prints."""
    capsys.readouterr()
    results(**asked)
    return capsys.readouterr().out


def table_in(said):
    """The lines of the table, and of runs that have a problem."""
    return said.partition("\n\n")[0].splitlines()


@pytest.mark.usefixtures("finished")
def test_a_finished_run_is_of_every_sweep_that_asked_for_it(tmp_path, capsys):
    for name in ("first", "second", "second", ""):
        run(short_run(tmp_path / "run", tracking=TrackingConfig(name="none", sweep=name)), say=lambda _: None)
    (row,) = run_rows([tmp_path])
    assert row.sweeps == ("first", "second")
    for name in ("first", "second"):
        assert "finished" in table_in(told(capsys, root=str(tmp_path), sweep=name))[1]
    with pytest.raises(RunFolderError, match=r"the sweep third in .*; there are the sweeps first, second"):
        results(root=str(tmp_path), sweep="third")


def written(folder, **changes):
    """A finished run that nobody trained, in a folder of this name."""
    config = settings(folder.parent, folder=str(folder), **changes)
    write_run(config)
    return config


def test_the_table_says_what_differs_how_far_it_is_and_what_came_of_it(tmp_path, finished, capsys):
    sweep = TrackingConfig(name="none", sweep="mine")
    done = run(dataclasses.replace(finished, tracking=sweep))
    run_killed(short_run(tmp_path / "unfinished", tracking=sweep, seed=1), 2)
    written(tmp_path / "of no sweep", seed=2)
    said = told(capsys, root=str(tmp_path), sweep="mine")
    head, *lines = table_in(said)
    assert head.split("  ")[0] == "levels.train"
    assert [word for word in head.split() if "." in word] == ["levels.train", "algorithm.name"]
    assert " seed " in head and "levels.count" not in head
    assert "finished" in lines[0] and f"{done.summary['evaluation/test/return/deterministic']:.4g}" in lines[0]
    assert "failed after 128 frames" in lines[1]
    assert lines[2:-1] == [f"computed with {computed_with(read_versions(done.folder))}"]
    assert lines[-1].startswith("unfinished: Killed")
    assert "not counted: 1 of 2 runs;" in said


def test_the_table_says_of_each_run_what_it_was_computed_with_where_that_differs(tmp_path, capsys):
    for seed, name in enumerate("ab"):
        written(tmp_path / name, seed=seed)
    path = tmp_path / "b" / VERSIONS
    versions = json.loads(path.read_text())
    versions["arithmetic_before"] = [{**versions["arithmetic"], "processor": "Another"}]
    path.write_text(json.dumps(versions))
    head, *lines = table_in(told(capsys, root=str(tmp_path)))
    here = computed_with(read_versions(tmp_path / "a"))
    assert head.endswith("computed with")
    assert [line.rpartition("  ")[2] for line in lines] == [here, f"{here.rpartition(', ')[0]}, Another, then {here}"]


def recorded_with(folder, **parts):
    """Has a finished run say that it executed other parts of the code."""
    versions = read_versions(folder)
    write_json(folder / VERSIONS, {**versions, "code": {**versions["code"], **parts}})


def test_runs_of_different_code_in_one_table_are_told_with_the_parts_that_differ(tmp_path, capsys):
    for seed, name in enumerate("abc"):
        written(tmp_path / name, seed=seed)
        recorded_with(tmp_path / name, **{"my_lab.tasks": "as it was"})
    assert "different code" not in told(capsys, root=str(tmp_path))
    recorded_with(tmp_path / "b", **{"my_lab.tasks": "edited", "kernel": "edited"})
    said = told(capsys, root=str(tmp_path), output=str(tmp_path / "all.md"))
    (warning,) = (line for line in said.splitlines() if "different code" in line)
    assert "Others than in most runs are kernel, my_lab.tasks in b. " in warning
    assert "stale=anew" in (tmp_path / "all.md").read_text()
    assert mixed_code(run_rows([tmp_path])) == {"kernel": ["b"], "my_lab.tasks": ["b"]}
    rows = as_columns(run_rows([tmp_path]))
    assert rows[0]["code"] == rows[2]["code"] != rows[1]["code"]


def test_runs_stand_in_the_order_of_their_numbers(tmp_path):
    for count in (2, 8, 40):
        (tmp_path / f"lake-n{count}-s0").mkdir()
        (tmp_path / f"lake-n{count}-s0" / "config.yaml").write_text("")
    assert [row.folder.name for row in run_rows([tmp_path])] == ["lake-n2-s0", "lake-n8-s0", "lake-n40-s0"]


def test_scores_by_other_code_are_left_out_with_a_line(tmp_path, capsys):
    config = written(tmp_path / "a")
    folder = tmp_path / "a" / "evaluations" / f"test-n{config.levels.test_count}"
    folder.mkdir(parents=True)
    found = {"anchors": {"floor": 0}, "players": {"deterministic": {"score": 1.0, "regret": 0.0}}}
    for changed, shown in (([], True), (["kernel", "lab/x.py"], False)):
        write_json(folder / "summary.json", {**found, "changed_code": changed})
        head, *lines = told(capsys, root=str(tmp_path)).splitlines()
        assert ("score" in head) == shown
        warnings = [line for line in lines if "score and regret are left out" in line]
        assert all("that of a is by other code than the run's (kernel, lab/x.py)" in line for line in warnings)
        assert bool(warnings) != shown


def made_by(name, code, **settings):
    base = {"levels.train": "empty-easy", "task.name": "puttputt", "algorithm.kind": "ppo", "levels.seed": 0}
    return RunRow(Path(name), "finished", settings={**base, **settings}, code=code)


@pytest.mark.parametrize(
    ("part", "setting", "other", "shared"),
    [
        ("kernel", "levels.train", "empty-hard", False), ("kernel", "task.name", "mine:task", False),
        ("kernel", "levels.seed", 1, True), ("kernel", "algorithm.kind", "sac", True),
        ("levels", "levels.train", "empty-hard", False), ("levels", "task.name", "mine:task", True),
        ("learner", "algorithm.kind", "sac", False), ("learner", "levels.train", "empty-hard", True),
        ("environment", "levels.train", "empty-hard", True), ("my_lab.tasks", "algorithm.kind", "sac", True),
    ],
)  # fmt: skip
def test_a_part_of_the_code_must_be_the_same_only_in_runs_that_share_it(part, setting, other, shared):
    rows = [made_by("a", {part: "1"}), made_by("b", {part: "2"}, **{setting: other}), made_by("c", {"textures": "3"})]
    assert mixed_code(rows) == ({part: ["b"]} if shared else {})


def test_of_two_runs_of_different_code_all_parts_name_the_same_one():
    rows = [made_by("a", {"kernel": "2", "lab": "2"}), made_by("b", {"kernel": "1", "lab": "1"})]
    rows += [made_by(name, {"kernel": "3", "lab": "1"}, **{"levels.train": "empty-hard"}) for name in "cd"]
    assert mixed_code(rows) == {"kernel": ["a"], "lab": ["a"]}


def test_distances_stand_first_exact_w2_before_all_and_own_results_beside_success(tmp_path):
    config = short_run(tmp_path / "a", evaluation=EvaluationConfig(episodes=2))
    summary = run(config).summary
    (row,) = as_columns(run_rows([tmp_path]))
    figures = list(row)[list(row).index("state") + 1 :]
    assert figures[:4] == ["w2_exact", "w2_reference", "ks", "gap_deterministic"]
    episodes = read_episodes(tmp_path / "a").to_pylist()
    mine = [e for e in episodes if (e["levels"], e["action_mode"]) == ("test", "sampled")]
    mean = np.mean([episode["results/distance_to_goal"] for episode in mine])
    assert row["results/distance_to_goal_test_sampled"] == pytest.approx(mean)
    assert summary["evaluation/test/results/distance_to_goal/sampled"] == pytest.approx(mean)
    assert "results/velocity_test_sampled" not in row  # no single number
    names = {one["name"] for one in read_metrics(tmp_path / "a").to_pylist()}
    assert "evaluation/test/results/distance_to_goal/sampled" in names  # of which MLflow makes metrics


@pytest.mark.parametrize("suffix", ["csv", "parquet", "md"])
def test_all_rows_are_written_to_a_file_or_none(tmp_path, suffix, capsys):
    for name, seed, own in (("a", 0, True), ("c", 2, 0.5)):  # of a figure, in one table
        written(tmp_path / "runs" / name, seed=seed)
        summary = tmp_path / "runs" / name / SUMMARY
        write_json(summary, {**json.loads(summary.read_text()), "own": own})
    write_run(settings(tmp_path, folder=str(tmp_path / "runs" / "b"), seed=1), finished=False)
    path = tmp_path / f"all.{suffix}"
    said = told(capsys, root=str(tmp_path / "runs"), output=str(path))
    if suffix == "csv":
        names = [row["run"] for row in csv.DictReader(path.read_text().splitlines())]
    elif suffix == "parquet":
        names = pq.read_table(path)["run"].to_pylist()
    else:
        names = [line.split()[1] for line in path.read_text().splitlines()[2:5]]
    assert names == ["a", "b", "c"]
    means = f"all.means.{suffix}" if suffix != "md" else "(no file)"
    assert {one.name for one in tmp_path.iterdir()} - {"runs", path.name} == {means} - {"(no file)"}
    assert any(line.endswith(means) for line in said.splitlines()) == (suffix != "md")


def test_a_format_that_there_is_not_is_refused_before_anything_is_read(tmp_path):
    with pytest.raises(ConfigError, match=r"output: 'runs.xls' ends in none of .csv, .parquet, .md"):
        results(root=str(tmp_path), output="runs.xls")


def test_a_score_of_a_portable_evaluation_counts_where_there_is_no_other(tmp_path):
    config = settings(tmp_path)
    folder = write_run(config)
    assert "score_deterministic" not in run_rows([tmp_path])[0].figures
    for suffix, score in (("-portable", 0.5), ("", 0.75)):
        place = folder / "evaluations" / f"test-n{config.levels.test_count}{suffix}"
        place.mkdir(parents=True)
        found = {"anchors": {"floor": 0}, "players": {"deterministic": {"score": score, "regret": 0.0}}}
        write_json(place / "summary.json", found)
        assert run_rows([tmp_path])[0].figures["score_deterministic"] == score
    for damaged in (
        {"players": None},
        {"players": {"sampled": 3}},
        {"planner": 3},
        {"changed_code": -1},
        {"frames": []},
    ):
        write_json(place / "summary.json", found | damaged)
        (row,) = run_rows([tmp_path])
        assert row.state == "unreadable" and f"{next(iter(damaged))}" in row.problem
    write_json(place / "summary.json", {"anchors": {}})
    assert "score_deterministic" not in run_rows([tmp_path])[0].figures


def test_a_run_in_several_folders_counts_once_and_the_folders_are_named(tmp_path, capsys):
    folder, other = write_run(settings(tmp_path / "here")), write_run(settings(tmp_path / "here", seed=5))
    for place in ("copy", "changed"):
        shutil.copytree(folder, tmp_path / "there" / place)
    summary = tmp_path / "there" / "changed" / "summary.json"
    write_json(summary, {**json.loads(summary.read_text()), "ks": 0.75})
    said = told(capsys, root=str(tmp_path / "here"), more=(str(tmp_path / "there"),))
    copies = (
        f"{tmp_path}/there/changed (other results), {tmp_path}/there/copy (equal results) beside {folder}, which counts"
    )
    assert f"warning: the same run lies in several folders, and counts once: {copies}" in said
    with pytest.warns(UserWarning, match="the same run lies in several folders, and counts once"):
        table = read_runs(tmp_path / "there", tmp_path / "here")
    assert sorted(table["folder"]) == sorted([str(tmp_path / "there" / "changed"), str(other)])
    rows = once_each(run_rows([tmp_path / "here"]))
    assert [row.copies for row in rows] == [(), ()] and not copies_warning(rows)


def test_a_finished_folder_of_a_run_counts_before_an_unfinished_one(tmp_path):
    write_run(settings(tmp_path / "a"), finished=False)
    folder = write_run(settings(tmp_path / "b"))
    (row,) = once_each(run_rows([tmp_path / "a", tmp_path / "b"]))
    assert row.folder == folder and "(not begun)" in row.copies[0]


def test_several_folders_and_single_runs_make_one_table_and_a_run_counts_once(tmp_path):
    written(tmp_path / "one" / "a")
    written(tmp_path / "two" / "b", seed=1)
    rows = run_rows([tmp_path / "one", tmp_path / "two" / "b", tmp_path / "two"])
    assert [row.folder.name for row in rows] == ["a", "b"]
    with pytest.raises(RunFolderError, match=f"there is no folder {tmp_path}/three"):
        run_rows([tmp_path / "three"])


def test_a_run_that_cannot_be_read_is_a_row_that_says_why(tmp_path, capsys):
    written(tmp_path / "a")
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "config.yaml").write_text("levels: 3\n")
    written(tmp_path / "c", seed=1)
    table = pq.read_table(tmp_path / "c" / EPISODES)
    for damaged, why in (
        (table.drop_columns("success"), "has no column 'success', or several"),
        (table.set_column(3, "return", pa.array(["x"] * len(table))), "its column 'return' is of another kind"),
        (table.set_column(3, "return", pa.nulls(len(table))), "in its column 'return' something is absent;"),
        (
            table.set_column(5, "length", pa.array([-3] * len(table))),
            "in its column 'length' something is below 0",
        ),
        (table.append_column("trial", pa.array([{"a": 1}] * len(table))), "its column 'trial' is of another kind"),
    ):
        pq.write_table(damaged, tmp_path / "c" / EPISODES)
        assert f"c: {tmp_path}/c/{EPISODES}" in (said := told(capsys, root=str(tmp_path))) and why in said
    pq.write_table(table, tmp_path / "c" / EPISODES)
    summary = json.loads((tmp_path / "c" / SUMMARY).read_text())
    versions = read_versions(tmp_path / "c")
    write_json(tmp_path / "c" / VERSIONS, versions | {"libraries": {"segar": segar.__version__}})
    for changed, why in (
        ({"seconds": -1.0}, "frames and seconds cannot be below 0"),
        ({"label": "another"}, "config.yaml was edited: it is that of empty-hard-n1"),
        ({"w2": 3, "evaluation//": 2**70}, "c: "),
    ):
        (tmp_path / "c" / SUMMARY).write_text(json.dumps(summary | changed))
        assert (why in told(capsys, root=str(tmp_path))) == ("w2" not in changed)
    lines = table_in(told(capsys, root=str(tmp_path)))
    assert "unreadable" in "".join(lines[1:3])
    assert any(line.startswith("b: cannot read the settings of a run") for line in lines)


def test_a_run_at_work_is_told_from_one_that_was_cut_off(tmp_path):
    states = []

    def look(_):
        thread = threading.Thread(target=lambda: states.append(state_of(tmp_path / "run")))
        thread.start()
        thread.join()

    with before_iteration(2, look):
        run(short_run(tmp_path / "run"))
    assert states == ["at work"]
    with use_run_folder(short_run(tmp_path / "other")):
        pass
    assert state_of(tmp_path / "other") == "not begun"


def test_a_task_that_does_not_fit_the_levels_is_named_with_the_one_that_does(tmp_path):
    config = short_run(
        tmp_path / "run", levels=LevelsConfig("billiards", count=2, test_count=2), task=TaskConfig("puttputt")
    )
    with pytest.raises(ConfigError, match=r"levels of billiards are for task=billiards, and puttputt does not fit: "):
        run(config)


def test_settings_that_the_name_of_the_algorithm_decides_are_not_printed_beside_it():
    names = ["levels.count", "algorithm.name", "algorithm.gamma", "algorithm.clip", "seed"]
    rows = [{"levels.count": n, "algorithm.name": a, "algorithm.gamma": g, "algorithm.clip": {"ppo": 0.2}.get(a), "seed": 0}
            for n in (1, 2) for a, g in (("ppo", 0.9), ("ppo", 0.99), ("sac", 0.9))]  # fmt: skip
    assert in_short(rows, names) == ["levels.count", "algorithm.name", "algorithm.gamma", "seed"]
    assert in_short([row for row in rows if row["algorithm.name"] == "ppo"], names) == names  # nothing tells them apart
