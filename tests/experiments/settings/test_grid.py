"""Which runs the reproduction consists of, and which settings make two runs parts of one experiment."""

import dataclasses

import pytest

from segar.experiments.reproduction.experiment_file import GridConfig
from segar.experiments.reproduction.grid import grid_runs
from segar.experiments.settings import LevelsConfig, RunConfig, ScaleConfig
from segar.experiments.settings.grid import GridPoint, config_at, design_hash, grid_point


def cells_of(config):
    return list(grid_runs(GridConfig(), config))


def test_each_seed_has_training_levels_of_its_own_and_all_share_the_test_levels():
    cells = cells_of(RunConfig(seed=4, scale=ScaleConfig(seeds=3)))
    assert [(c.seed, c.levels.seed, c.levels.test_seed) for c in cells[::45]] == [(4, 4, 0), (5, 5, 0), (6, 6, 0)]


def test_cells_and_seeds_belong_to_one_experiment():
    config = RunConfig(seed=1, scale=ScaleConfig(seeds=2))
    assert {design_hash(cell) for cell in cells_of(config)} == {
        design_hash(config_at(config, GridPoint("tilesx1", "easy", 3, 9)))
    }


@pytest.mark.parametrize(
    "changes",
    [
        {"scale": ScaleConfig(frames=1)},
        {"levels": LevelsConfig(seed=1, test="empty-easy")},
        {"levels": LevelsConfig(seed=5)},
        {"levels": LevelsConfig(seed=1, test_count=7)},
    ],
)
def test_other_settings_make_another_experiment(changes):
    config = RunConfig(seed=1, levels=LevelsConfig(seed=1))
    assert design_hash(dataclasses.replace(config, **changes)) != design_hash(config)


@pytest.mark.parametrize(
    ("distribution", "family", "difficulty"),
    [
        ("objectsx3-hard", "objectsx3", "hard"),
        ("my_package.levels:icy", "my_package.levels:icy", ""),
        ("my-package:icy", "my-package:icy", ""),
    ],
)
def test_family_and_difficulty_are_read_from_the_distribution(distribution, family, difficulty):
    cell = grid_point(RunConfig(levels=LevelsConfig(train=distribution)))
    assert (cell.family, cell.difficulty, cell.panel) == (family, difficulty, distribution)
