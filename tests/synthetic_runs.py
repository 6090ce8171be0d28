"""Run folders without training: what a run leaves behind, with figures that a test chooses."""

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from segar.experiments.evaluation.transfers import Transfer
from segar.experiments.levels.builders import Prepared, make_levels
from segar.experiments.runs.executed_code import executed_code
from segar.experiments.runs.run_folder import (
    CONFIG,
    EPISODE_SCHEMA,
    EPISODES,
    LEVELS_TEST,
    LEVELS_TRAIN,
    METRIC_SCHEMA,
    METRICS,
    SUMMARY,
    VERSIONS,
    folder_path,
    write_json,
    write_rows,
)
from segar.experiments.settings import RunConfig, TrackingConfig, as_data, grid_point

TEST_LEVELS = 20
MADE_WITH: dict[str, Any] = {
    "python": "3.11.7",
    "libraries": {"segar": None, "torch": "2.13.0"},
    "git": {"commit": "89abcdef" * 5, "changed": True},
    "code": {"kernel": "0123456789abcdef"},
    "arithmetic": {
        "determinism": "machine",
        "device": "cpu",
        "precision": "bf16",
        "threads": 1,
        "instruction_set": "AVX512",
        "limits": {},
        "processor": "AMD EPYC",
    },
}


def settings(root: Path, **changes: Any) -> RunConfig:
    """A run under ``root`` that tells no MLflow."""
    return RunConfig(**{"root": str(root), "tracking": TrackingConfig(name="none"), **changes})


def write_run(
    config: RunConfig,
    *,
    gap: float = -1.0,
    w2: float = 0.5,
    finished: bool = True,
    code: Mapping[str, str] = MADE_WITH["code"],
    level_files: bool = False,
) -> Path:
    """The folder of a run with this mean gap (exactly) and W2; sampled actions cost 0.5 everywhere."""
    folder = folder_path(config)
    folder.mkdir(parents=True)
    (folder / CONFIG).write_text(yaml.safe_dump(as_data(config)))
    if level_files:
        for levels, name in zip(make_levels(config.levels), (LEVELS_TRAIN, LEVELS_TEST), strict=True):
            levels.save(folder / name)
    if not finished:
        return folder
    metrics = {"episode/return": -3.0, "w2/reference": w2, "w2/exact": 2 * w2}
    frames = config.scale.frames
    rows = [{"name": k, "frames": frames, "seconds": 1.0, "value": v} for k, v in metrics.items()]
    write_rows(folder / METRICS, rows, METRIC_SCHEMA)
    write_rows(folder / EPISODES, episodes(config, gap), EPISODE_SCHEMA)
    write_json(folder / VERSIONS, {**MADE_WITH, "code": code})
    write_json(folder / SUMMARY, {"frames": frames, "seconds": 1.0, "evaluation_seconds": 0.5, "ks": 0.25, **metrics})
    return folder


def write_transfer(transfer: Transfer, config: RunConfig, gap: float) -> None:
    """What a run leaves of a transfer with this mean gap."""
    folder = transfer.folder(config)
    folder.mkdir(parents=True)
    rows = [row for row in episodes(config, gap) if row["levels"] == "test"]
    write_rows(folder / EPISODES, rows, EPISODE_SCHEMA)
    write_json(folder / SUMMARY, {"transfer": as_data(transfer), "w2/exact": 3.0, "ks": 0.5})


def episodes(config: RunConfig, gap: float) -> list[dict[str, Any]]:
    """Each training level twice, each test level once, in both action modes."""
    rng = np.random.default_rng(config.levels.number)
    rows: list[dict[str, Any]] = []
    for mode, cost in (("deterministic", 0.0), ("sampled", 0.5)):
        for levels, number, mean in (("train", 2 * config.levels.number, -2.0), ("test", TEST_LEVELS, -2.0 + gap)):
            returns = rng.normal(size=number)
            returns += mean - cost - returns.mean()
            for i, value in enumerate(returns):
                level = i % config.levels.number if levels == "train" else i
                played = {"levels": levels, "action_mode": mode, "level": level, "length": 10, "death": False}
                rows.append({**played, "return": value, "return_ref": value + 0.25, "success": i % 4 > 0})
    return rows


def pretend_to_train(config: RunConfig) -> dict[str, float]:
    """Stands for training: leaves the folder of a finished run, and a line in ``trained`` beside it."""
    cell = grid_point(config)
    with open(Path(str(config.root)) / "trained", "a") as stream:
        stream.write(f"{cell.panel} n={cell.count} seed={cell.seed}\n")
    if config.stale == "anew":
        shutil.rmtree(folder_path(config), ignore_errors=True)
    w2 = 1.0 / config.levels.number
    write_run(config, gap=-2 * w2, w2=w2, code=executed_code(Prepared(config)))
    return {"evaluation/gap/deterministic": -2 * w2}
