"""The runs of the shipped tables are those that a plan of today has, by their names, on every processor."""

import hydra
import pyarrow.parquet as pq
import pytest

from segar.experiments.commands.config_store import conf_dir, register_settings
from segar.experiments.reproduce import SETTINGS, build
from segar.experiments.reproduction.plan import make_plan
from segar.support import WORKSPACE


@pytest.mark.results
@pytest.mark.processor
@pytest.mark.parametrize(("scale", "runs"), [("quick", 45), ("standard", 135)])
def test_the_shipped_main_grid_is_that_of_the_planned_runs(scale, runs, tmp_path):
    table = pq.read_table(WORKSPACE / "docs" / "results" / scale / "runs.parquet", columns=["run", "experiments"])
    stored = {row["run"] for row in table.to_pylist() if "figure_3a" in row["experiments"].split()}
    register_settings("reproduce", SETTINGS)
    with hydra.initialize_config_dir(str(conf_dir()), version_base="1.3"):
        config = build(hydra.compose("reproduce", [f"scale={scale}", f"root={tmp_path}"]))
        plan = make_plan(config.at_scale(), config.run, tmp_path)
    assert len(stored) >= runs
    assert stored <= {work.run.label() for work in plan.runs}
