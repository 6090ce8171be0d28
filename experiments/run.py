"""One run from settings to run folder: levels, training, evaluation, distances, summary."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch

from experiments import runtime
from experiments.cells import cell_of
from experiments.checkpoint import resume_checkpoint, save_checkpoint
from experiments.config import RunConfig
from experiments.construct import import_object
from experiments.errors import CheckpointError, TrackingError
from experiments.evaluate import ACTION_MODES, distance_figures, evaluate_run, evaluation_figures, mean_figures, play
from experiments.learner import Learner
from experiments.progress import Progress
from experiments.run_folder import (
    EPISODE_SCHEMA,
    EPISODES,
    LEVELS_TEST,
    LEVELS_TRAIN,
    METRIC_SCHEMA,
    METRICS,
    SUMMARY,
    VERSIONS,
    claim,
    is_finished,
    read_metrics,
    read_summary,
    read_versions,
    write_json,
    write_rows,
)
from experiments.tracking import Tracker, start_tracking
from experiments.versions import code_fingerprint, levels_hash, versions
from experiments.worlds import environment_options, make_levels
from segar.envs.torchrl_env import TorchRLEnv

SHOWN = {  # in the closing lines: what it is called there
    "evaluation/train/return/deterministic": "return on training levels",
    "evaluation/test/return/deterministic": "return on test levels",
    "evaluation/gap/deterministic": "generalization gap",
    "evaluation/train/success/deterministic": "success on training levels",
    "evaluation/test/success/deterministic": "success on test levels",
}


@dataclass(frozen=True)
class RunResult:
    """Where a run lies, what it came to, and whether it was trained now or found finished."""

    folder: Path
    summary: Mapping[str, Any]
    trained: bool


@dataclass
class History:
    """The figures of a run so far, as rows of ``metrics.parquet``; also tells the tracker."""

    tracker: Tracker
    rows: list[dict[str, Any]] = field(default_factory=list)

    def log(self, figures: Mapping[str, float], frames: int, seconds: float) -> None:
        """Adds figures at a time."""
        self.rows += [{"name": k, "frames": frames, "seconds": seconds, "value": float(v)} for k, v in figures.items()]
        self.tracker.log(figures, frames)


def run(config: RunConfig, say: Callable[[str], None] = print) -> RunResult:
    """Carries out a run, or goes on with it, or finds it finished; safe to call many times in one process.

    Raises:
        SegarError: settings, run folder, checkpoint or tracking store cannot be used; the message says what to do.
    """
    runtime.set_process_defaults()
    with claim(config) as folder:
        if is_finished(folder):
            say(f"{config.label()}: finished before, nothing to do{_other_code(config, folder)}; {folder}")
            return RunResult(folder, read_summary(folder), trained=False)
        tracker = start_tracking(config, folder, _tags(config))
        try:
            summary = _carry_out(config, folder, tracker, say)
        except BaseException:
            _close_after_failure(tracker)
            raise
        tracker.finish(finished=True)
    say(_closing_lines(config, folder, summary))
    return RunResult(folder, summary, trained=True)


def _carry_out(config: RunConfig, folder: Path, tracker: Tracker, say: Callable[[str], None]) -> dict[str, Any]:
    train, test = make_levels(config.levels)
    kind = import_object(config.algorithm.learner, "algorithm")
    make_env = getattr(kind, "make_env", TorchRLEnv)
    env = make_env(train, config.algorithm.num_envs, seed=config.seed, **environment_options(config))
    learner: Learner = kind(config.algorithm, env, config.scale.frames, config.seed)
    history = History(tracker)
    hashes = {"train": levels_hash(train), "test": levels_hash(test)}
    seconds = _resume(config, folder, learner, history, hashes, say)
    train.save(folder / LEVELS_TRAIN)
    test.save(folder / LEVELS_TEST)
    code = code_fingerprint(config.algorithm.learner)
    write_json(folder / VERSIONS, {**versions(), "code": code, "levels": hashes})

    seconds = train_learner(config, folder, learner, history, seconds, test)
    episodes = evaluate_run(learner.policy, config, train, test)
    final = {**evaluation_figures(episodes), **distance_figures(train, test, config.evaluation.distances)}
    history.log(final, learner.frames, seconds)
    write_rows(folder / EPISODES, episodes, EPISODE_SCHEMA)
    write_rows(folder / METRICS, history.rows, METRIC_SCHEMA)
    summary = {"label": config.label(), "frames": learner.frames, "seconds": seconds, **final}
    write_json(folder / SUMMARY, summary)
    for name in (SUMMARY, EPISODES):
        tracker.artifact(folder / name)
    env.close()
    return summary


def train_learner(
    config: RunConfig, folder: Path, learner: Learner, history: History, seconds: float, test: Any
) -> float:
    """Iterates until the frames are used up, with checkpoints; returns the seconds of training, ``seconds`` included."""
    total = config.scale.frames
    saved = time.monotonic()
    with closing(Progress(config.label(), total, learner.frames, shown=config.progress)) as progress:
        while learner.frames < total:
            began, frames = time.perf_counter(), learner.frames
            figures = learner.iterate()
            duration = time.perf_counter() - began
            seconds += duration
            speed = {"speed/frames_per_second": (learner.frames - frames) / duration}
            history.log({**figures, **speed}, learner.frames, seconds)
            progress.update(learner.frames, figures)
            if _crossed(frames, learner.frames, config.evaluation.interval):
                history.log(_test_figures(config, learner, test), learner.frames, seconds)
            if time.monotonic() - saved > config.checkpoint_interval or learner.frames >= total:
                _save(config, folder, learner, history, seconds)
                saved = time.monotonic()
    return seconds


def _save(config: RunConfig, folder: Path, learner: Learner, history: History, seconds: float) -> None:
    # Metrics first: rows beyond the checkpoint are dropped when the run goes on, rows that are missing would stay so.
    write_rows(folder / METRICS, history.rows, METRIC_SCHEMA)
    save_checkpoint(folder, config, learner, {"seconds": seconds})


def _resume(
    config: RunConfig,
    folder: Path,
    learner: Learner,
    history: History,
    hashes: Mapping[str, str],
    say: Callable[[str], None],
) -> float:
    """Puts learner and history where the run's last checkpoint was; returns the seconds of training until then.

    Raises:
        CheckpointError: the checkpoint belongs to other code or other levels, or is damaged.
    """
    extra = resume_checkpoint(folder, config, learner)
    if extra is None:
        return 0.0
    if read_versions(folder)["levels"] != hashes:  # the module that defines them is the user's; no fingerprint sees it
        raise CheckpointError(
            f"the run in {folder} was begun on other levels than those that {config.levels.train} gives now. "
            "Go back to that definition, or train anew with restart=true"
        )
    history.rows = [row for row in read_metrics(folder).to_pylist() if row["frames"] <= learner.frames]
    say(f"{config.label()}: goes on from {learner.frames:,} of {config.scale.frames:,} frames")
    return extra["seconds"]


def _test_figures(config: RunConfig, learner: Learner, test: Any) -> dict[str, float]:
    figures: dict[str, float] = {}
    for mode in ACTION_MODES:
        rng = torch.Generator().manual_seed(config.evaluation.seed) if mode == "sampled" else None
        rows = play(
            learner.policy,
            test,
            np.arange(len(test)),
            environment_options(config),
            rng=rng,
            seed=config.evaluation.seed,
        )
        figures |= mean_figures(rows, "test", mode)
    return figures


def _crossed(before: int, after: int, interval: int) -> bool:
    """Whether a multiple of ``interval`` lies in (before, after]; never for interval 0."""
    return interval > 0 and before // interval < after // interval


def _close_after_failure(tracker: Tracker) -> None:
    """Marks the run as failed where the store still answers; the error that ended the run is the one to be seen."""
    try:
        tracker.finish(finished=False)
    except TrackingError as error:
        print(error, file=sys.stderr)


def _other_code(config: RunConfig, folder: Path) -> str:
    same = read_versions(folder).get("code") == code_fingerprint(config.algorithm.learner)
    return "" if same else " (by other code than this; restart=true trains anew)"


def _tags(config: RunConfig) -> dict[str, str]:
    cell = cell_of(config)
    return {
        "family": cell.family,
        "difficulty": cell.difficulty,
        "n": str(cell.count),
        "seed": str(cell.seed),
        "algorithm": config.algorithm.name,
        "observation": config.observation.name,
        "test": config.levels.test_distribution,
    }


def _closing_lines(config: RunConfig, folder: Path, summary: Mapping[str, Any]) -> str:
    speed = summary["frames"] / max(summary["seconds"], 1e-9)
    lines = [f"{config.label()}: {summary['frames']:,} frames in {summary['seconds']:.0f} s ({speed:,.0f} frames/s)"]
    lines += [f"  {name:<27} {summary[key]:8.3f}" for key, name in SHOWN.items()]
    lines += [f"  W2, {key[3:]:<23} {value:8.3f}" for key, value in summary.items() if key.startswith("w2/")]
    return "\n".join([*lines, f"  run folder                  {folder}"])
