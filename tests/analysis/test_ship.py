"""Shipped tables are small, and give the same report."""

import numpy as np
import pandas as pd
import pytest

from analysis.report.claims.evidence import Evidence
from analysis.report.results import read_results
from analysis.ship import ENOUGH, ShipConfig, rounded, ship, thinned
from analysis.tables import CURVE_POINTS
from tests.synthetic_results import everything, write_results


def test_a_full_scale_fits_and_says_the_same(tmp_path):
    tables = everything(np.random.default_rng(0))
    source = write_results(tmp_path / "standard-1234", tables)
    (source / "missing.csv").write_text("run,reason\nempty-hard-n1,not begun\n")
    (source / "studies" / "anchors").mkdir(parents=True)
    (source / "studies" / "anchors" / "anchors.csv").write_text(
        "family,difficulty,player,return,success\nempty,easy,oracle,-0.123456789,1\n"
    )
    size = ship(ShipConfig(str(source), str(tmp_path / "standard")))
    assert size < ENOUGH
    before, after = (Evidence(read_results(folder)) for folder in (source, tmp_path / "standard"))
    assert after.results.missing_runs() == before.results.missing_runs() == ["empty-hard-n1: not begun"]
    one, other = (e.association("exact", "gap", "given panel and log n") for e in (before, after))
    assert other.estimate == pytest.approx(one.estimate, abs=1e-5)
    assert after.results.curves.groupby(["run", "name"]).size().max() <= CURVE_POINTS
    assert (tmp_path / "standard" / "studies" / "anchors" / "anchors.csv").read_text().endswith("-0.123457,1\n")
    assert not (tmp_path / "standard" / "levels.parquet").exists()


def test_a_short_run_keeps_its_curve_beside_a_long_one():
    curves = pd.DataFrame(
        {"run": run, "name": "episode/return", "frames": np.arange(1, 11) * length // 10, "value": np.arange(10.0)}
        for run, length in (("short", 1_000), ("long", 1_000_000))
    ).explode(["frames", "value"], ignore_index=True)
    curves = curves.astype({"frames": np.int64, "value": float})
    order, shown = ["run", "frames"], ["run", "frames", "value"]
    found, expected = (table.sort_values(order, ignore_index=True)[shown] for table in (thinned(curves), curves))
    pd.testing.assert_frame_equal(found, expected)


def test_six_digits_are_kept_of_any_size():
    table = pd.DataFrame({"x": [123456789.0, -0.000123456789, 0.0, np.nan, np.inf], "name": list("abcde")})
    np.testing.assert_allclose(rounded(table)["x"], [123457000, -0.000123457, 0, np.nan, np.inf], rtol=1e-12)
