"""From a plan and its run folders to tidy tables; what is missing is named, and doing it again changes no byte."""

import dataclasses
import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from segar.analysis.collect import CollectConfig, collect, collect_tables
from segar.analysis.collected_rows import curve_rows, level_rows, software
from segar.analysis.plotting.style import colours
from segar.errors import SegarError
from segar.experiments.reproduce import ReproduceConfig, write_plan
from segar.experiments.reproduction.experiment_file import experiment_at
from segar.experiments.reproduction.plan import make_plan
from segar.experiments.runs.executed_code import combined
from segar.experiments.runs.run_folder import (
    EPISODES,
    METRICS,
    PROBES,
    SUMMARY,
    VERSIONS,
    folder_path,
    read_episodes,
    write_json,
)
from segar.experiments.settings import RunFolderError, ScaleConfig, TrackingConfig, TrackingError
from tests.synthetic_runs import MADE_WITH, settings, write_run, write_transfer

SCALE = ScaleConfig(name="smoke", frames=1000, families=("empty",), difficulties=("easy", "hard"), counts=(1, 10))
MAIN = {"title": "Main", "figure": "3a", "grid": {"algorithms": ["base"]}, "scales": {"smoke": {}}}
HARDER = {"title": "Harder", "figure": "4a", "grid": {"difficulties": ["easy"]}, "scales": {"smoke": {}}}
HARDER |= {"probes": True, "transfers": [{"difficulty": "medium"}]}
TRANSFER_GAP = -5.0


def planned(root, **changes):
    """A reproduction of two experiments, of which the runs are written and not trained."""
    run = settings(root, **{"seed": 1, "scale": SCALE, "stale": "keep", **changes})
    config = ReproduceConfig(run, grids={"main": MAIN, "harder": HARDER})
    plan = make_plan([experiment_at(k, v, "smoke") for k, v in config.grids.items()], config.run, config.folder)
    write_plan(config, plan)
    return config, plan


def write_all(plan):
    for i, work in enumerate(plan.runs):
        write_run(work.run, gap=-1.0 - i, w2=0.1 * (i + 1))
        for transfer in work.transfers:
            write_transfer(transfer, work.run, TRANSFER_GAP)
        if work.probes is not None:
            probe_table(work.run.label(), 0.7 + i / 100).to_parquet(folder_path(work.run) / PROBES)


def probe_table(run, accuracy):
    """What the probes left in a run folder."""
    about = {"run": run, "levels": "test", "representation": "trained", "frames": 100, "level": 0.95, "note": ""}
    rows = [
        {"factor": "all", "probe": "jsd", "quantity": "accuracy", "estimate": accuracy + 1e-9, "n": 3},
        {"factor": "goal.Position.x", "probe": "ridge", "quantity": "r2", "estimate": 0.5, "n": 100, "static": True},
        {"factor": "goal.Position.x", "probe": "ridge", "quantity": "information", "estimate": 1.0, "n": 100},
    ]
    return pd.DataFrame([{**about, "low": 0.1, "high": 0.9, "p": 0.01, "entropy": 2.079, **row} for row in rows])


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    config, plan = planned(tmp_path_factory.mktemp("runs"))
    write_all(plan)
    return config, collect(CollectConfig(str(config.folder)))


@pytest.fixture
def found(made):
    return made[1]


def test_there_is_one_row_per_run_with_all_experiments_that_need_it(found):
    assert list(found.runs["experiments"]) == ["main harder", "main harder", "main", "main"]
    assert list(found.runs["difficulty"]) == ["easy", "easy", "hard", "hard"]


def test_a_run_has_its_gap_in_both_modes_its_distances_and_its_cost(found):
    row = found.runs.iloc[0]
    assert row["gap_deterministic"] == pytest.approx(-1.0)
    assert row["eta_train_sampled"] == pytest.approx(row["eta_train_deterministic"] - 0.5)
    assert (row["w2_reference"], row["w2_exact"], row["ks"]) == (0.1, 0.2, 0.25)
    assert row["hours"] == pytest.approx(1.5 / 3600)
    assert row["hash"] == row["run"].split("-")[-1]


def test_a_run_says_what_made_it(found):
    row = found.runs.iloc[0]
    assert row["code"] == combined({"kernel": "0123456789abcdef"})
    assert row["commit"] == "89abcdef" * 5 + "+", "files differed from the commit"
    assert row["libraries"] == "python 3.11.7, torch 2.13.0", "one that is not installed is not named"
    assert row["computed_with"] == "AVX512, bf16, 1 thread, AMD EPYC"
    assert software({**MADE_WITH, "git": None})["commit"] == "", "outside of a checkout"


def test_a_transfer_is_held_against_the_training_levels(found):
    assert list(found.transfers["test"]) == ["empty-medium"] * 2
    assert set(found.transfers["test_difficulty"]) == {"medium"}
    np.testing.assert_allclose(found.transfers["gap_deterministic"], TRANSFER_GAP)
    np.testing.assert_allclose(found.transfers["w2_exact"], 3.0)


def test_level_means_give_the_returns_of_the_runs_again(found):
    chosen = found.levels[(found.levels["levels"] == "test") & (found.levels["action_mode"] == "deterministic")]
    own = chosen[chosen["test"] == "own"].groupby("run")["return"].mean()
    runs = found.runs.set_index("run")["eta_test_deterministic"]
    np.testing.assert_allclose(own.loc[runs.index], runs)
    train = found.levels[(found.levels["levels"] == "train") & (found.levels["action_mode"] == "sampled")]
    assert set(train["episodes"]) == {2}  # each training level was played twice


def test_an_experiment_has_a_table_of_its_runs_and_of_the_transfers_that_it_asks_for(made):
    config, _ = made
    main, harder = (pd.read_csv(config.folder / "tables" / f"{name}.csv") for name in ("main", "harder"))
    assert list(main["test"]) == ["own"] * 4
    assert list(harder["test"]) == ["own"] * 2 + ["empty-medium"] * 2


def test_what_probes_say_stands_beside_what_the_run_is(found):
    assert list(found.probes["n"]) == [1, 1, 10, 10] and list(found.probes["units"]) == [3, 100, 3, 100]
    accuracy = found.probes[found.probes["probe"] == "jsd"]
    np.testing.assert_array_equal(accuracy["estimate"], np.float32([0.7, 0.71]))
    assert set(found.probes["family"]) == {"empty"} and set(found.probes["difficulty"]) == {"easy"}
    assert set(found.probes["quantity"]) == {"accuracy", "r2"}


def test_files_hold_the_tables(made):
    config, found = made
    for name in ("runs", "transfers", "levels", "curves", "probes"):
        pd.testing.assert_frame_equal(pd.read_parquet(config.folder / f"{name}.parquet"), getattr(found, name))


def test_doing_it_again_changes_no_byte(made):
    config, _ = made
    files = sorted(path for path in config.folder.rglob("*") if path.is_file())
    before = [path.read_bytes() for path in files]
    collect(CollectConfig(str(config.folder)))
    assert [path.read_bytes() for path in files] == before


def test_what_is_missing_is_named(tmp_path, capfd):
    config, plan = planned(tmp_path)
    write_run(plan.runs[0].run)  # without its transfer and its probes
    write_run(plan.runs[1].run, finished=False)
    found = collect(CollectConfig(str(config.folder)))
    assert len(found.runs) == 1 and found.transfers.empty
    reasons = [reason.split(" ")[-2:] for reason in found.missing["reason"]]
    assert sorted(map(tuple, reasons)) == [("not", "begun")] * 2 + [("not", "finished")] * 3
    assert "missing: empty-easy-n10" in capfd.readouterr().out
    assert len(pd.read_csv(config.folder / "missing.csv")) == 5


def test_a_transfer_of_other_weights_than_the_runs_is_missing(tmp_path):
    config, plan = planned(tmp_path)
    write_all(plan)
    work = next(one for one in plan.runs if one.transfers)
    place = work.transfers[0].folder(work.run) / SUMMARY
    write_json(place, {**json.loads(place.read_text()), "frames": 7})
    found = collect(CollectConfig(str(config.folder), tracking=False))
    (row,) = found.missing.to_dict("records")
    assert row["run"] == work.run.label() not in set(found.transfers["run"])
    assert "is of the agent after 7 frames, and the run has" in row["reason"]


def test_a_folder_without_a_plan_is_refused(tmp_path):
    with pytest.raises(RunFolderError, match="holds no plan"):
        collect(CollectConfig(str(tmp_path)))


@pytest.mark.parametrize(
    ("path", "change", "why"),
    [
        ("plan.json", lambda data: data.clear(), "'name' is absent"),
        ("plan.json", lambda data: data["experiments"][0].update(name="../../elsewhere"), "name: .* must be one part"),
        ("plan.json", lambda data: data["experiments"][0]["runs"][0].update(folder=3), "folder' must be str, not 3"),
        (SUMMARY, lambda data: data.update(seconds="long"), "'seconds' must be float"),
        (VERSIONS, lambda data: data.pop("code"), "'code' is absent"),
    ],
)
def test_what_is_wrong_with_a_plan_or_a_run_is_named(made, tmp_path, path, change, why):
    root = Path(shutil.copytree(made[0].run.root, tmp_path / "runs"))
    results = root / made[0].folder.relative_to(made[0].run.root)
    plan = json.loads((results / "plan.json").read_text())
    (results / "plan.json").write_text(json.dumps({**plan, "runs": str(root)}))
    file = results / path if path == "plan.json" else root / plan["experiments"][0]["runs"][0]["folder"] / path
    data = json.loads(file.read_text())
    change(data)
    file.write_text(json.dumps(data))
    with pytest.raises(SegarError, match=f"{file.name}: .*{why}"):
        collect(CollectConfig(str(results)))
    assert not list(tmp_path.rglob("elsewhere*"))


def test_what_pandas_wrote_of_a_table_is_not_believed_and_figures_end_with_the_run(made, tmp_path):
    folder = next(path.parent for path in Path(made[0].run.root).glob(f"*/{METRICS}"))
    shutil.copytree(folder, tmp_path / "run")
    for name in (METRICS, EPISODES):
        table = pq.read_table(folder / name)
        pq.write_table(table.replace_schema_metadata({b"pandas": b"no JSON"}), tmp_path / "run" / name)
    place = {"run": "x", "test": "own"}
    assert curve_rows(tmp_path / "run", place).equals(curve_rows(folder, place))
    assert level_rows(read_episodes(tmp_path / "run"), place).equals(level_rows(read_episodes(folder), place))
    pq.write_table(pq.read_table(folder / METRICS).slice(0, 0), tmp_path / "run" / METRICS)
    with pytest.raises(SegarError, match=f"{METRICS} does not end with the run"):
        curve_rows(tmp_path / "run", place)


def test_tables_of_others_do_not_choose_where_anything_is_sent(made, tmp_path):
    """Nor where a file of MLflow's is made: what a plan names counts where the caller asks for it, as a reproduction does."""
    results = shutil.copytree(made[0].folder, tmp_path / "theirs")
    plan = json.loads((results / "plan.json").read_text())
    plan["tracking"] = {"name": "mlflow", "uri": f"sqlite:///{tmp_path}/of_mine.db", "experiment": "theirs"}
    (results / "plan.json").write_text(json.dumps(plan))
    collect(CollectConfig(str(results)))
    assert not (tmp_path / "of_mine.db").exists()
    (tmp_path / "of_mine.db").mkdir()
    with pytest.raises(TrackingError):
        collect_tables(results)


def test_mlflow_has_a_parent_per_experiment_and_its_runs_as_children(tmp_path):
    from segar.experiments.tracking.mlflow_store import open_store
    from segar.experiments.tracking.mlflow_sync import RunSync

    tracking = TrackingConfig(experiment="here")
    config, plan = planned(tmp_path, scale=dataclasses.replace(SCALE, counts=(1,)), tracking=tracking)
    write_all(plan)
    for work in plan.runs:
        RunSync(work.run, tmp_path / work.run.label()).open()
    for _ in range(2):  # the second time, nothing is made anew
        collect(CollectConfig(str(config.folder), tracking=True))
    client, experiment = open_store(tracking, tmp_path)
    runs = client.search_runs([experiment])
    parents = {one.data.tags["experiments"]: one for one in runs if one.data.tags.get("kind") == "experiment"}
    children = [one for one in runs if "mlflow.parentRunId" in one.data.tags]
    assert sorted(parents) == ["harder", "main"] and len(runs) == 4
    assert {one.data.tags["figure"] for one in children} == {"3a", "3a, 4a"}
    assert {one.data.tags["mlflow.runColor"] for one in children} == {*colours(["empty"]).values()}
    assert {one.data.tags["mlflow.parentRunId"] for one in children} == {parents["main"].info.run_id}
    assert parents["main"].data.metrics["evaluation/gap/deterministic"] == pytest.approx(-1.5)
    assert [file.path for file in client.list_artifacts(parents["harder"].info.run_id)] == ["harder.csv"]
