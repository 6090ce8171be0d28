"""The settings that make a row anew, from its description."""

import dataclasses
from collections.abc import Sequence

from experiments.benchmarking.protocol import PLAYERS
from experiments.benchmarking.row import Method, Row
from experiments.benchmarking.settings import BenchmarkConfig
from experiments.settings import as_data, run_config


def again(config: BenchmarkConfig, row: Row) -> list[BenchmarkConfig]:
    """The settings that make a row anew: of each range of seeds, for the suites that were played with them."""
    ranges: dict[tuple[int, int], list[str]] = {}
    for name in row.suites():
        seeds = sorted(piece.seed for piece in row.pieces if piece.suite == name)
        for first in (one for one in seeds if one - 1 not in seeds):
            count = next(n for n in range(1, len(seeds) + 1) if first + n not in seeds)
            ranges.setdefault((first, count), []).append(name)
    return [_again(config, row.method, names, *seeds) for seeds, names in ranges.items()]


def _again(config: BenchmarkConfig, method: Method, suites: Sequence[str], seed: int, seeds: int) -> BenchmarkConfig:
    """The settings that make a row anew on some suites, with so many seeds from one on."""
    data = {key: value for key, value in as_data(config.run).items() if key not in method.settings}
    data |= {key: value for key, value in method.settings.items() if key != "training_levels"}
    data |= {"seed": seed, "scale": {**data["scale"], "frames": method.frames or data["scale"]["frames"]}}
    return dataclasses.replace(
        config, run=run_config(data), suites=tuple(suites), seeds=seeds, row=method.name,
        budget=method.budget or config.budget, training_levels=method.settings.get("training_levels"),
        player=method.name if method.name in PLAYERS else "",
    )  # fmt: skip
