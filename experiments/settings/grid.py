"""The cells of experiments, each of a family, a difficulty, a number of training levels and a seed, as run configurations."""

import dataclasses

from segar.experiments.settings.own_code import without_folder
from segar.experiments.settings.run import DIFFICULTIES, RunConfig, digest


@dataclasses.dataclass(frozen=True)
class GridPoint:
    """Where a run stands in the paper's grid."""

    family: str
    difficulty: str  # empty where the distribution is none of the named families
    count: int | str  # training levels, or endless
    seed: int

    @property
    def panel(self) -> str:
        """Family and difficulty, e.g. ``empty-hard``."""
        return f"{self.family}-{self.difficulty}" if self.difficulty else self.family


def config_at(config: RunConfig, cell: GridPoint) -> RunConfig:
    """``config`` with the levels and the seed of ``cell``."""
    levels = dataclasses.replace(config.levels, train=cell.panel, count=cell.count, seed=cell.seed)
    return dataclasses.replace(config, levels=levels, seed=cell.seed, folder=None)


def grid_point(config: RunConfig) -> GridPoint:
    """Where a run stands, read from its settings."""
    return GridPoint(*panel_parts(config.levels.train), config.levels.count, config.seed)


def panel_parts(name: str) -> tuple[str, str]:
    """Family and difficulty of ``empty-hard``; of any other distribution its name, level files without folder, and ""."""
    family, dash, difficulty = name.rpartition("-")
    return (family, difficulty) if dash and difficulty in DIFFICULTIES else (without_folder(name), "")


def design_hash(config: RunConfig) -> str:
    """Eight hexadecimal digits of the settings that decide the results and that all cells and seeds of one experiment share."""
    data = config.identity()
    levels = {key: value for key, value in data["levels"].items() if key not in ("train", "test", "count", "seed")}
    levels["shifted"] = config.levels.test_distribution != config.levels.train
    levels["seed"] = "that of the run" if config.levels.seed == config.seed else config.levels.seed
    return digest({**{key: value for key, value in data.items() if key != "seed"}, "levels": levels})
