"""The designs of the experiments give the verdicts the data that their rules ask for."""

import pytest

from segar.analysis.report.rules import LEAST_BLOCKS, WHOLE
from segar.experiments.commands.config_store import register_settings
from segar.experiments.commands.hydra_app import compose_data, initialized
from segar.experiments.reproduce import SETTINGS, build
from segar.experiments.reproduction.grid import grid_runs

WITHIN_ONE_PANEL = ("appendix_sac",)
COMPARING_PANELS = ("figure_3a", "figure_4b")  # 3a, and 4b-none in the 2022 metric: each panel is a block
OVER_PANELS = ("figure_3a", "figure_5a", "appendix_mass", "appendix_memory", "matched_sets", "rule_sets", "trials")


@pytest.mark.slow
def test_a_verdict_has_blocks_enough_at_standard():
    register_settings("reproduce", SETTINGS)
    with initialized():
        config = build(compose_data(["scale=standard"], "reproduce"))
    grids = {one.name: one.grid for one in config.at_scale()}
    for name, runs in WHOLE.items():
        assert len([*grid_runs(grids[name], config.run)]) == runs, name
    for name in COMPARING_PANELS:
        assert len({run.levels.train for run in grid_runs(grids[name], config.run)}) >= LEAST_BLOCKS, name
    for name in (*WITHIN_ONE_PANEL, *OVER_PANELS):
        blocks = {(run.levels.train, run.seed) for run in grid_runs(grids[name], config.run)}
        panels = {panel for panel, _ in blocks} if name in WITHIN_ONE_PANEL else {None}
        for panel in panels:
            assert len({one for one in blocks if panel in (None, one[0])}) >= LEAST_BLOCKS, f"{name}: {panel}"
