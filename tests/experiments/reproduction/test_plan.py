"""A plan trains what several experiments need once, knows what is done, and estimates the rest from runs of this machine."""

import dataclasses
import json
import shutil
import socket
from itertools import combinations

import pytest

from segar.experiments.levels.builders import Prepared
from segar.experiments.reproduction.experiment_file import experiment_at
from segar.experiments.reproduction.plan import ASSUMED_BESIDE, Speeds, as_text, in_minutes, make_plan, measure_speeds
from segar.experiments.runs.executed_code import executed_code
from segar.experiments.runs.run_folder import CHECKPOINT, CONFIG, JOURNAL, SUMMARY, folder_path, write_json
from segar.experiments.settings import ConfigError, ScaleConfig, as_data
from tests.synthetic_runs import settings, write_run

SCALE = ScaleConfig(name="quick", frames=1000, families=("empty",), difficulties=("easy", "hard"), counts=(1, 10))
MAIN = {"title": "Main", "grid": {"algorithms": ["base"]}, "scales": {"quick": {}}}
HARDER = {**MAIN, "title": "Harder", "transfers": [{"difficulty": "harder"}, {"variation": "gravity_40"}]}
AGAIN = {**MAIN, "title": "Again", "transfers": [{"variation": "gravity_40"}]}


def plan_of(root, stale="refuse", **files):
    base = settings(root, seed=1, scale=SCALE, stale=stale)
    return make_plan([experiment_at(name, data, "quick") for name, data in files.items()], base, root / "results")


def test_a_run_that_two_experiments_need_is_planned_once_with_the_transfers_of_both(tmp_path):
    plan = plan_of(tmp_path, main=MAIN, harder=HARDER, again=AGAIN)
    assert [len(plan.members[name]) for name in ("main", "harder", "again")] == [4, 4, 4]
    assert len(plan.runs) == 4
    wanted = {work.run.levels.train: [one.label for one in work.transfers] for work in plan.runs}
    assert wanted == {"empty-easy": ["empty-medium", "gravity_40"], "empty-hard": ["gravity_40"]}


def test_settings_of_a_grid_are_those_of_the_files_that_it_names(tmp_path):
    grid = {"counts": [10], "difficulties": ["hard"], "observations": ["textures_far"], "algorithms": ["curl_fast"]}
    grid |= {"designs": ["covering"], "variations": ["ball_mass"], "frames": 7, "seeds": 2, "interval": 3}
    first, second = (work.run for work in plan_of(tmp_path, mine={**MAIN, "grid": grid}).runs)
    assert (first.seed, second.seed, first.levels.seed) == (1, 2, 1)
    assert (first.observation.name, first.observation.options) == ("textures", {"textures": "far"})
    algorithm = first.algorithm
    assert (algorithm.name, type(algorithm).__name__, algorithm.gamma) == ("curl_fast", "CURLConfig", 0.9)
    assert (first.levels.design, first.levels.variation) == ("covering", "ball_mass")
    assert (first.scale.frames, first.evaluation.interval) == (7, 3)


def test_a_setting_that_no_file_states_is_told(tmp_path):
    with pytest.raises(ConfigError, match="no algorithm is called 'curl_fst'"):
        plan_of(tmp_path, mine={**MAIN, "grid": {"algorithms": ["curl_fst"]}})


def test_a_setting_that_makes_no_other_run_does_not_vary(tmp_path):
    grid = {"counts": [1], "difficulties": ["easy"], "vary": {"root": [str(tmp_path / "a"), str(tmp_path / "b")]}}
    with pytest.raises(ConfigError, match=r"mine.grid.vary: \['root'\] is not allowed; it must be settings that"):
        plan_of(tmp_path, mine={**MAIN, "grid": grid})


def test_a_transfer_that_two_entries_name_for_some_agents_is_one(tmp_path):
    grid = {**MAIN["grid"], "counts": [10], "difficulties": ["easy", "medium"]}
    data = {**MAIN, "grid": grid, "transfers": [{"difficulty": "harder"}, {"difficulty": "hard"}]}
    works = plan_of(tmp_path, mine=data).members["mine"]
    assert {work.run.levels.train: [one.label for one in work.transfers] for work in works} == {
        "empty-easy": ["empty-medium", "empty-hard"],
        "empty-medium": ["empty-hard"],
    }


def test_where_a_run_is_tested_anyway_is_no_transfer(tmp_path):
    grid = {"counts": [1], "observations": ["textures_far"]}
    data = {**MAIN, "grid": grid, "transfers": [{"observation": "textures_far"}, {"observation": "textures_close"}]}
    (labels,) = {tuple(one.label for one in work.transfers) for work in plan_of(tmp_path, mine=data).runs}
    assert labels == ("textures_close",)


def test_what_makes_the_gap_is_asked_in_every_combination_but_those_of_the_run_itself(tmp_path):
    data = {**MAIN, "attribution": {"position": ["Position"], "size": ["Size", "Mass", "World"]}}
    work = plan_of(tmp_path, mine=data).runs[0]
    groups = ("position", "size", "rest")
    assert [one.mixture.changed for one in work.transfers] == [*combinations(groups, 1), *combinations(groups, 2)]
    assert {one.test_count for one in work.transfers} == {work.run.levels.test_count}
    assert work.transfers[3].label == "position+size of test levels"


def test_training_levels_that_would_count_unequally_are_told(tmp_path):
    data = {**MAIN, "grid": {"counts": [7]}, "attribution": {"position": ["Position"]}}
    with pytest.raises(ConfigError, match=r"grids.mine.attribution: .* test levels are no multiple of 7 training"):
        plan_of(tmp_path, mine=data)


@pytest.mark.parametrize(
    ("groups", "message"),
    [
        ({"where": ["Positon"]}, "no factor or parameter 'Positon'. Did you mean 'Position'"),
        ({"where": ["Position"], "again": ["Mass", "Position"]}, "Position is in the groups 'where' and 'again'"),
    ],
)
def test_groups_of_factors_that_levels_lack_are_told_before_anything_is_trained(tmp_path, groups, message):
    with pytest.raises(ConfigError, match=rf"^grids.mine.attribution: empty-easy: .*{message}"):
        plan_of(tmp_path, mine={**MAIN, "attribution": groups})


def test_done_are_runs_whose_transfers_are_finished_too(tmp_path):
    plan = plan_of(tmp_path, harder=HARDER)
    work = plan.runs[0]
    assert not work.is_done() and work.frames_left() == 1000
    write_run(work.run)
    assert not work.is_done() and work.frames_left() == 0
    for transfer in work.transfers:
        transfer.folder(work.run).mkdir(parents=True)
        write_json(transfer.folder(work.run) / SUMMARY, {"transfer": as_data(transfer)})
    assert work.is_done()


def test_transfers_of_other_code_are_refused_kept_or_made_anew_without_their_runs(tmp_path):
    files = {"harder": {**HARDER, "grid": {"counts": [1], "difficulties": ["easy"]}}}
    (work,) = plan_of(tmp_path, **files).runs
    write_run(work.run, code=executed_code(Prepared(work.run)))
    for transfer in work.transfers:
        transfer.folder(work.run).mkdir(parents=True)
        made = {"transfer": as_data(transfer), "code": transfer.code(work.run)}
        write_json(transfer.folder(work.run) / SUMMARY, made)
    assert plan_of(tmp_path, **files).runs[0].is_done()
    first = work.transfers[0]
    other = {**first.code(work.run), "levels": "another"}
    write_json(first.folder(work.run) / SUMMARY, {"transfer": as_data(first), "code": other})
    told = (
        f"1 transfer was made by other code than this; changed since: levels. The first of them is {work.run.label()}"
    )
    with pytest.raises(ConfigError, match=f"^{told}/evaluations/{first.folder_name()}. stale=anew"):
        plan_of(tmp_path, **files)
    kept, anew = (plan_of(tmp_path, stale=stale, **files) for stale in ("keep", "anew"))
    assert kept.runs[0].is_done() and f"{told}/evaluations/" in kept.other_code and "are kept" in kept.other_code
    assert not anew.runs[0].is_done() and "made anew" in anew.other_code
    assert (anew.runs[0].transfers_left(), anew.runs[0].frames_left()) == ([first], 0)


def test_finished_runs_are_done_whatever_setting_with_code_of_its_own_a_grid_varies(tmp_path):
    vary = {"curriculum": [None, {"kind": "plr"}, {"kind": "sfl"}]}
    grid = {"counts": [1], "difficulties": ["easy"], "algorithms": ["ppo_fast", "curl_fast"], "vary": vary}
    files = {"mine": {**MAIN, "grid": grid}}
    for work in plan_of(tmp_path, **files).runs:
        write_run(work.run, code=executed_code(Prepared(work.run)))
    assert all(work.is_done() for work in plan_of(tmp_path, **files).runs)


@pytest.mark.parametrize("whole", [True, False])
def test_runs_of_other_code_are_refused_before_others_are_trained_kept_or_made_anew(tmp_path, whole):
    files = {"harder": {**HARDER, "grid": {"counts": [1], "difficulties": ["easy"]}}}
    (work,) = plan_of(tmp_path, **files).runs
    folder = write_run(work.run, code={**executed_code(Prepared(work.run)), "kernel": "another"})
    if not whole:
        (folder / SUMMARY).unlink()
        plan_of(tmp_path, **files)  # nothing is trained yet
        (folder / CHECKPOINT).parent.mkdir()
        (folder / CHECKPOINT).touch()
    told = f"1 {'finished' if whole else 'unfinished'} run was made by other code than this; changed since: kernel"
    with pytest.raises(ConfigError, match=told):
        plan_of(tmp_path, **files)
    if whole:
        assert plan_of(tmp_path, stale="keep", **files).runs[0].frames_left() == 0
    anew = plan_of(tmp_path, stale="anew", **files)
    (work,) = anew.runs
    speeds = Speeds({}, {}, 0)
    assert work.frames_left() == 1000 and work.transfers_left() == list(work.transfers)
    assert speeds.seconds(work) == speeds.seconds(dataclasses.replace(work, changed=(), run=unmade(work.run, tmp_path)))
    assert "1 to do with 1,000 frames" in as_text(anew, speeds, 1, SCALE)


def unmade(run, root):
    """The same run, where nothing is made yet."""
    return dataclasses.replace(run, root=str(root / "elsewhere"))


def test_a_run_that_was_cut_off_has_fewer_frames_left(tmp_path):
    work = plan_of(tmp_path, main=MAIN).runs[0]
    run = work.run
    folder = write_run(run, finished=False)
    (folder / JOURNAL).write_text(json.dumps({"event": "stopped", "time": "", "frames": 400}) + "\n")
    assert work.frames_left() == 600


def test_speeds_are_medians_of_what_this_machine_ran(tmp_path):
    plan = plan_of(tmp_path, main=MAIN)
    for work, seconds, host in zip(
        plan.runs, (1.0, 2.0, 4.0, 100.0), [socket.gethostname()] * 3 + ["other"], strict=True
    ):
        folder = write_run(work.run)
        write_json(folder / SUMMARY, {"frames": 1000, "seconds": seconds})
        events = [
            ("started", "2026-01-01T12:00:00+00:00"),
            ("finished", f"2026-01-01T12:00:{int(seconds) % 60 + 8:02}+00:00"),
        ]
        lines = [json.dumps({"event": event, "host": host, "time": time}) + "\n" for event, time in events]
        (folder / JOURNAL).write_text("".join(lines))
    lines[0] = json.dumps({"event": "started", "host": socket.gethostname(), "time": "2026-01-01"}) + "\n"
    (folder / JOURNAL).write_text("".join(lines))  # as nobody writes it: without a zone
    theirs = tmp_path / "theirs"  # whose settings name code that is not here, which is nothing to a plan
    shutil.copytree(folder_path(plan.runs[0].run), theirs)
    (theirs / CONFIG).write_text((theirs / CONFIG).read_text().replace("name: state", "name: not_here:Eyes"))
    speeds = measure_speeds(tmp_path)
    kind = (plan.runs[0].run.algorithm.name, plan.runs[0].run.observation.name)
    assert (speeds.measured, speeds.frames[kind]) == (3, 500.0)
    fresh = dataclasses.replace(plan.runs[0], run=dataclasses.replace(plan.runs[0].run, seed=9))
    assert speeds.seconds(fresh) == pytest.approx(8 + 1000 / 500)
    assert speeds.basis([fresh.run]) == "by 3 finished runs here"


def test_what_is_not_measured_is_assumed_by_what_an_algorithm_does(tmp_path):
    def seconds(algorithm, observation="state"):
        grid = {**MAIN["grid"], "algorithms": [algorithm], "observations": [observation], "frames": 10**6}
        run = plan_of(tmp_path, main={**MAIN, "grid": grid}).runs[0].run
        return Speeds({}, {}, 0).seconds_of_run(run, 10**6) - ASSUMED_BESIDE

    assert seconds("sac") == pytest.approx(32 * seconds("sac_fast"))  # gradient steps
    assert seconds("drq", "rgb_stack2") > seconds("sac") / 8 > seconds("sac_fast")
    assert seconds("ppo_fast") < seconds("sac_fast") and 3 * seconds("ppo_fast") < seconds("ppo_recurrent")


def test_the_plan_says_what_is_shared_done_and_left(tmp_path):
    plan = plan_of(tmp_path, main=MAIN, again=MAIN)
    write_run(plan.runs[0].run)
    lines = as_text(plan, measure_speeds(tmp_path), 2, SCALE).splitlines()
    assert lines[1].split()[:6] == ["main", "-", "4", "-", "1", "3,000"]
    assert lines[2].split() == ["again", "-", "4", "4", "1", "0", "-", "-"]
    assert lines[3].startswith("quick: 4 runs, 1 done, 3 to do with 3,000 frames, 0 to probe; 0 of 0 studies to do")
    assert lines[3].endswith(
        "with 2 at a time (by assumed speeds, and without the time in which new kernels are compiled)."
    )
    assert folder_path(plan.runs[0].run).parent == tmp_path


@pytest.mark.parametrize(("seconds", "words"), [(3.2, "3 s"), (600, "10 min"), (7200, "2.0 h")])
def test_durations_are_rounded_for_reading(seconds, words):
    assert in_minutes(seconds) == words


def test_a_plan_tells_runs_that_stay_untrained(tmp_path):
    plan = plan_of(tmp_path, main={**MAIN, "grid": {"algorithms": ["ppo_fast"]}})
    text = as_text(plan, Speeds({}, {}, 0), 1, SCALE)
    assert "warning: 4 runs stay untrained, such as empty-" in text
    longer = plan_of(tmp_path, main={**MAIN, "grid": {"algorithms": ["ppo_fast"], "frames": 10**6}})
    assert "untrained" not in as_text(longer, Speeds({}, {}, 0), 1, SCALE)
