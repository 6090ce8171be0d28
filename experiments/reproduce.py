"""The paper's experiment, from training to the figure: ``python -m experiments.reproduce scale=quick``.

Trains the cells (families x difficulties x numbers of training levels) that are not finished yet, a few side by side,
then has ``analysis.report`` draw the figure. Killed, it goes on where it stopped when it is started again.
"""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from experiments.cells import cell_of, design_hash, paper_cells, paper_seeds
from experiments.config import RunConfig, require, run_config
from experiments.entry import plain, run_command
from experiments.errors import TrainingError
from experiments.run_folder import CHECKOUT, folder_path, is_finished, runs_root
from experiments.sweep import Job, Outcome, run_jobs
from experiments.train import train


@dataclass(frozen=True)
class ReproduceConfig:
    """The reproduction: a run whose levels and seed are those of each cell in turn, and how many run side by side."""

    run: RunConfig = field(default_factory=RunConfig)
    processes: int = 0  # 0: one per core

    def __post_init__(self) -> None:
        require(self.processes >= 0, "processes", self.processes, "0 or more")

    @property
    def name(self) -> str:
        """Names the experiment and its settings, e.g. ``paper-quick-3f9a12cd``."""
        return f"paper-{self.run.scale.name}-{design_hash(paper_cells(self.run)[0])}"

    @property
    def folder(self) -> Path:
        """Where report and logs go."""
        return runs_root(self.run) / "reports" / self.name


def reproduce(
    config: ReproduceConfig,
    work: Callable[[RunConfig], Any] = train,
    draw: Callable[[ReproduceConfig, Sequence[RunConfig]], bool] | None = None,
) -> None:
    """Trains what is not trained yet, draws the figure, and says where everything is.

    Args:
        work: trains one cell, in another process; importable by name.
        draw: makes the report and returns whether it could; None: :func:`report`.

    Raises:
        TrainingError: some cells failed; the others are finished and in the figure.
    """
    cells = paper_cells(with_sweep_tag(config))
    waiting = [cell for cell in cells if cell.restart or not is_finished(folder_path(cell))]
    processes = min(config.processes or cores(), max(len(waiting), 1))
    print(plan(config, cells, waiting, processes), flush=True)
    outcomes = train_cells(config, waiting, processes, work)
    failed = [outcome for outcome in outcomes if outcome.error is not None]
    reported = (draw or report)(config, cells)
    if failed or not reported:
        raise TrainingError(failures(failed, len(cells), reported))


def with_sweep_tag(config: ReproduceConfig) -> RunConfig:
    """The run's settings, with the experiment's name as MLflow tag unless another is given."""
    tracking = dataclasses.replace(config.run.tracking, sweep=config.run.tracking.sweep or config.name)
    return dataclasses.replace(config.run, tracking=tracking)


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0))


def plan(config: ReproduceConfig, cells: Sequence[RunConfig], waiting: Sequence[RunConfig], processes: int) -> str:
    """What is going to happen."""
    run = config.run
    done = len(cells) - len(waiting)
    lines = [
        f"{config.name}: {len(cells)} cells, {run.algorithm.name} on {run.observation.name}, "
        f"{run.scale.frames:,} frames each; {done} finished before, {len(waiting)} to train, {processes} at a time."
    ]
    if waiting:
        lines += [f"Run folders: {runs_root(run)}", f"Logs:        {config.folder / 'logs'}"]
    return "\n".join(lines)


def train_cells(
    config: ReproduceConfig, waiting: Sequence[RunConfig], processes: int, work: Callable[[RunConfig], Any]
) -> list[Outcome]:
    """Trains cells side by side and tells of each as it ends, with the time that the rest will take."""
    logs = config.folder / "logs"
    jobs = [Job(cell.label(), cell, logs / f"{cell.label()}.log") for cell in waiting]
    durations: list[float] = []

    def tell(outcome: Outcome) -> None:
        durations.append(outcome.seconds)
        left = (len(jobs) - len(durations)) * sum(durations) / len(durations) / processes
        after = f"about {in_minutes(left)} left" if len(durations) < len(jobs) else "all done"
        print(f"[{len(durations)}/{len(jobs)}] {ending(outcome)}; {after}", flush=True)

    return run_jobs(jobs, work, processes, tell)


def ending(outcome: Outcome) -> str:
    """How a cell ended, in one line."""
    cell, took = cell_of(outcome.job.argument), in_minutes(outcome.seconds)
    if outcome.error is not None:
        return f"{cell}: FAILED after {took}: {outcome.error} (log: {outcome.job.log})"
    figures = outcome.result or {}
    shown = {"gap": "evaluation/gap/deterministic", "test success": "evaluation/test/success/deterministic"}
    return ", ".join([f"{cell}: {took}", *(f"{k} {figures[v]:.2f}" for k, v in shown.items() if v in figures)])


def report(config: ReproduceConfig, cells: Sequence[RunConfig]) -> bool:
    """Has the analysis read the runs and write the report; returns whether it did.

    A process of its own, because experiments does not import analysis: what trains must not depend on what draws.
    """
    scale, run = config.run.scale, config.run
    settings = {
        "runs": runs_root(run),
        "out": config.folder,
        "design": design_hash(cells[0]),
        "families": scale.families,
        "difficulties": scale.difficulties,
        "counts": scale.counts,
        "seeds": paper_seeds(run),
        "distances": run.evaluation.distances,
        "tracking.name": run.tracking.name,
        "tracking.uri": run.tracking.uri,
        "tracking.experiment": run.tracking.experiment,
    }
    command = [sys.executable, "-m", "analysis.report", *(f"{key}={quoted(value)}" for key, value in settings.items())]
    began = time.monotonic()
    environment = {name: value for name, value in os.environ.items() if name != "HYDRA_FULL_ERROR"}  # ours, see entry
    done = subprocess.run(command, cwd=CHECKOUT, env=environment)  # from where the package is found, installed or not
    if done.returncode == 0:
        print(f"The report took {in_minutes(time.monotonic() - began)}. Figures and curves in the browser:")
        print(f"  {sys.executable} -m experiments.dashboard root={quoted(runs_root(run))}    (or: make dashboard)")
    return done.returncode == 0


def quoted(value: Any) -> str:
    """A value in the grammar of Hydra's command line."""
    if value is None:
        return "null"
    if isinstance(value, str | Path):
        text = str(value).replace("\\", "\\\\").replace("'", "\\'")
        return f"'{text}'"
    return "[" + ",".join(quoted(one) if isinstance(one, str) else str(one) for one in value) + "]"


def failures(failed: Sequence[Outcome], cells: int, reported: bool) -> str:
    """What went wrong, and what to do."""
    lines = [f"{len(failed)} of {cells} cells failed:"] if failed else []
    lines += [f"  {cell_of(one.job.argument)}: {one.error}\n    log: {one.job.log}" for one in failed]
    if not reported:
        lines.append("there is no report: see what it says above")
    lines.append("Finished cells are kept: the same command trains only what is missing.")
    if any("restart=true" in str(one.error) for one in failed):
        lines.append("restart=true trains all of them anew; to train one cell anew, delete its run folder.")
    return "\n".join(lines)


def in_minutes(seconds: float) -> str:
    """A duration, rounded for reading."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def build(config: DictConfig) -> ReproduceConfig:
    """Hydra's result as settings."""
    data = plain(config)
    processes = data.pop("processes")
    return ReproduceConfig(run_config(data), processes)


if __name__ == "__main__":
    run_command(reproduce, "reproduce", build, {"processes": ReproduceConfig.processes})
