"""The figure of what runs played, against frames."""

import dataclasses

import pytest

from analysis.played_plot import PANELS, PlayedPlotConfig, curves_of, names_of, played_plot
from experiments.runs.run_folder import read_config, read_summary, run_folders
from experiments.settings import LevelsConfig, RunConfig, RunFolderError, UniformConfig
from experiments.training.run import run
from tests.experiments.short_runs import FRAMES, short_run


def test_runs_that_differ_in_their_seeds_alone_are_one_curve(tmp_path):
    for seed in (1, 2):
        run(
            short_run(tmp_path / f"run{seed}", curriculum=UniformConfig(log_interval=FRAMES), seed=seed),
            say=lambda _: None,
        )
    runs = [(read_config(folder), folder) for folder in run_folders(tmp_path)]
    curves = curves_of(runs)
    assert list(curves) == [("empty-easy, 2 levels", "ppo, uniform")]
    (points,) = curves.values()
    assert all(points[name] for name in PANELS)
    last = {read_summary(folder)["played/w2_target"] for _, folder in runs}
    assert last <= {value for _, value in points["w2_target"]}
    played_plot(PlayedPlotConfig(root=str(tmp_path), out=str(tmp_path / "played")))
    assert (tmp_path / "played.png").stat().st_size > 1000


def test_runs_that_differ_in_another_setting_are_told_apart_by_it():
    one = RunConfig(levels=LevelsConfig(train="empty-easy"), curriculum=UniformConfig())
    other = dataclasses.replace(one, curriculum=UniformConfig(log_interval=7), seed=5)
    curriculum = "ppo, uniform, curriculum.log_interval="
    target = f"empty-easy, {one.levels.count} levels"
    assert names_of([one, other]) == [(target, f"{curriculum}50000"), (target, f"{curriculum}7")]


def test_runs_that_logged_nothing_are_named(tmp_path):
    run(short_run(tmp_path / "run"), say=lambda _: None)
    with pytest.raises(RunFolderError, match="logged which levels it played; runs with"):
        played_plot(PlayedPlotConfig(root=str(tmp_path), out=str(tmp_path / "played")))
