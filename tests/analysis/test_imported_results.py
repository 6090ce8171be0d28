"""Runs that were made on another machine: they count as done, and their rows join those of the runs here."""

import dataclasses
import shutil

import pandas as pd
import pytest

from segar.analysis.collect import CollectConfig, collect
from segar.experiments.reproduce import write_plan
from segar.experiments.reproduction.experiment_file import experiment_at
from segar.experiments.reproduction.imported_results import read_imported_results
from segar.experiments.reproduction.plan import as_text, make_plan, measure_speeds
from segar.experiments.runs.run_folder import folder_path
from segar.experiments.settings import ConfigError, RunFolderError
from tests.analysis.test_collect import planned, write_all

TABLES = ("runs", "transfers", "levels", "curves", "probes")


def planned_with(root, *tables):
    """The same reproduction under another root, with tables from elsewhere."""
    config, _ = planned(root)
    config = dataclasses.replace(config, imported=tuple(map(str, tables)))
    experiments = [experiment_at(k, v, "smoke") for k, v in config.grids.items()]
    plan = make_plan(experiments, config.run, config.folder, imported=read_imported_results(config.imported_folders()))
    write_plan(config, plan)
    return config, plan


@pytest.fixture
def there(tmp_path):
    """All runs, made elsewhere, and their results folder."""
    config, plan = planned(tmp_path / "there")
    write_all(plan)
    return config, plan, collect(CollectConfig(str(config.folder)))


def test_runs_from_two_machines_give_the_tables_that_one_would(there, tmp_path):
    other, plan, whole = there
    for work in plan.runs[2:]:  # these are here
        shutil.copytree(folder_path(work.run), tmp_path / "here" / work.run.label())
    config, mine = planned_with(tmp_path / "here", other.folder)
    assert [bool(work.imported) for work in mine.runs] == [True, True, False, False]
    for work in plan.runs[2:]:
        shutil.rmtree(folder_path(work.run))
    joined = collect(CollectConfig(str(config.folder)))
    assert joined.missing.empty
    for name in TABLES:
        pd.testing.assert_frame_equal(getattr(joined, name), getattr(whole, name))


def test_shipped_tables_are_tables_from_elsewhere(there, tmp_path):
    other, _, whole = there
    (tmp_path / "smoke").mkdir()
    for name in ("transfers", "curves", "probes"):  # levels are not shipped
        shutil.copy(other.folder / f"{name}.parquet", tmp_path / "smoke")
    whole.runs.assign(experiments="another").to_parquet(tmp_path / "smoke" / "runs.parquet")  # which the plan says
    config, plan = planned_with(tmp_path / "here", tmp_path / "smoke")
    assert all(work.is_done() and work.frames_left() == 0 for work in plan.runs)
    said = as_text(plan, measure_speeds(tmp_path / "here"), 2, config.run.scale)
    assert "smoke: 4 runs, 4 done, 0 to do with 0 frames" in said
    joined = collect(CollectConfig(str(config.folder)))
    pd.testing.assert_frame_equal(joined.runs, whole.runs)
    assert list(joined.transfers["transfer"]) == list(whole.transfers["transfer"])


def test_a_run_whose_tables_are_not_whole_is_made_here_and_its_rows_are_kept_until_then(there, tmp_path):
    other, of_others, whole = there
    shutil.copytree(folder_path(of_others.runs[0].run), tmp_path / "kept")
    whole.transfers.iloc[1:].to_parquet(other.folder / "transfers.parquet")
    whole.probes[whole.probes["n"] == 1].to_parquet(other.folder / "probes.parquet")
    config, plan = planned_with(tmp_path / "here", other.folder)
    assert [work.is_done() for work in plan.runs] == [False, False, True, True]
    joined = collect(CollectConfig(str(config.folder), tracking=False))
    pd.testing.assert_frame_equal(joined.runs, whole.runs)
    lost = whole.transfers.iloc[0]
    assert f"the imported tables lack {lost['transfer']}" in list(joined.missing["reason"])
    assert "the imported tables lack probes" in list(joined.missing["reason"])
    first = plan.runs[0].run.label()
    shutil.copytree(tmp_path / "kept", tmp_path / "here" / first)
    joined = collect(CollectConfig(str(config.folder), tracking=False))
    assert first not in list(joined.missing["run"])
    assert joined.runs.shape == whole.runs.shape


def test_folders_without_tables_are_refused(there, tmp_path):
    other, _, _ = there
    with pytest.raises(ConfigError, match=r"imported: .*nowhere holds no runs.parquet; name folders of tables"):
        planned_with(tmp_path / "here", tmp_path / "nowhere")
    config, _ = planned_with(tmp_path / "here", other.folder)
    (other.folder / "runs.parquet").unlink()
    with pytest.raises(RunFolderError, match=r"was to be found in .*, and is not there any more"):
        collect(CollectConfig(str(config.folder)))


def test_a_damaged_table_is_told(there, tmp_path):
    other, _, _ = there
    (other.folder / "probes.parquet").write_bytes(b"PAR1")
    with pytest.raises(ConfigError, match=r"imported: .*cannot read the table .*probes.parquet"):
        planned_with(tmp_path / "here", other.folder)
    pd.DataFrame({"seed": [1]}).to_parquet(other.folder / "probes.parquet")
    with pytest.raises(ConfigError, match=r"imported: .*probes.parquet has no column 'run'"):
        planned_with(tmp_path / "here", other.folder)
