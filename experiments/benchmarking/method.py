"""What the row is of that a command asks for, and the settings that make a row anew."""

import dataclasses
from typing import Any

from segar.experiments.benchmarking.protocol import PLAYERS
from segar.experiments.benchmarking.row import ROW, TRAINED, Method, Row
from segar.experiments.benchmarking.settings import BenchmarkConfig
from segar.experiments.settings import ConfigError, LevelCount, RunConfig, RunFolderError, as_data, run_config

NOT_OF_METHOD = ("levels", "evaluation", "seed", "frames")  # parts of a run's identity that differ from piece to piece
SAYS = {
    "idle": "does nothing",
    "random": "acts uniformly at random",
    "script": "the scripted player of the task, which sees the true factors",
    "planner": "the best actions that a search in the simulator finds",
}


def method_of(config: BenchmarkConfig) -> Method:
    """What the row is of."""
    run = config.trained_run()
    if config.player:
        return Method(config.row or config.player, "player", SAYS[config.player])
    if config.actions:
        return Method(config.row, "actions", "actions of a method that was trained elsewhere")
    seen = {"name": run.observation.name, "options": dict(run.observation.options)}
    if config.is_onnx:
        return Method(
            config.row, "onnx", f"ONNX, trained elsewhere, on {run.observation.name}", settings={"observation": seen}
        )
    if config.policy:
        says = f"{config.policy}, trained elsewhere, on {run.observation.name}"
        settings: dict[str, Any] = {"observation": seen, "policy": config.policy}
        return Method(
            config.row, "actions", says, settings=settings | ({"privileged": True} if config.privileged else {})
        )
    settings = settings_of(run, config.training_levels)
    curriculum = [] if run.curriculum is None else [run.curriculum.name]
    name = "-".join([run.algorithm.name, *curriculum, run.observation.name, config.budget])
    says = f"{run.algorithm.name} on {run.observation.name}, {run.scale.frames:,} frames on each suite with each seed"
    return Method(config.row or name, "networks", says, config.budget, run.scale.frames, settings)


def settings_of(run: RunConfig, training_levels: LevelCount | None = None) -> dict[str, Any]:
    """The settings of a run that all pieces of a row share, as plain data."""
    data = as_data(run, without_later_defaults=True)
    shared = {key: data.get(key, value) for key, value in run.identity().items() if key not in NOT_OF_METHOD}
    return shared | ({"training_levels": training_levels} if training_levels else {})


def again(config: BenchmarkConfig, row: Row) -> list[BenchmarkConfig]:
    """The settings that make a row anew: of each seed, for the suites that were played with it.

    Raises:
        SegarError: its settings are none, or name Python objects that ``config`` does not trust.
    """
    method, settings = row.method, dict(row.settings(config.trusted, TRAINED))
    training_levels = settings.pop("training_levels", None)
    try:
        data = as_data(config.run) | settings
        data |= {"scale": {**data["scale"], "frames": method.frames or data["scale"]["frames"]}}
        whole = dataclasses.replace(
            config, seeds=1, row=method.name, budget=method.budget or config.budget,
            training_levels=training_levels, player=method.name if method.name in PLAYERS else "",
        )  # fmt: skip
        return [
            dataclasses.replace(
                whole,
                run=run_config({**data, "seed": seed}),
                suites=tuple(piece.suite for piece in row.pieces if piece.seed == seed),
            )
            for seed in sorted({piece.seed for piece in row.pieces})
        ]
    except ConfigError as error:
        raise RunFolderError(f"{row.folder / ROW}: {error}") from error
