"""The loop of a training run: iterations, figures, and checkpoints on time and on signal."""

import math
import time
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from segar.experiments.algorithms.checkpoint import resume_checkpoint, save_checkpoint
from segar.experiments.algorithms.learner import Learner
from segar.experiments.commands.signals import SignalMonitor
from segar.experiments.curricula.played_log import PLAYED_SCHEMA
from segar.experiments.curricula.training_levels import TrainingLevels
from segar.experiments.evaluation.episodes import figures_in_modes, play_in_modes
from segar.experiments.levels.builders import Prepared
from segar.experiments.runs.journal import Journal
from segar.experiments.runs.run_folder import (
    METRIC_SCHEMA,
    METRICS,
    PLAYED,
    VERSIONS,
    read_metrics,
    read_played,
    read_versions,
    write_rows,
)
from segar.experiments.settings import CheckpointError, RunConfig, TrainingError, digest
from segar.experiments.training.progress import Progress


@dataclass
class Training:
    """A run in training: its learner, the figures so far, and the folder to which they are written."""

    prepared: Prepared
    folder: Path
    learner: Learner
    env: Any
    journal: Journal
    signals: SignalMonitor
    code: Mapping[str, str]  # that the run executes
    chosen: TrainingLevels | None = None  # what chooses the training levels, where something does
    rows: list[dict[str, Any]] = field(default_factory=list)  # the figures so far, those of ``metrics.parquet``
    seconds: float = 0.0  # of training, also in processes before this one

    @property
    def config(self) -> RunConfig:
        """The settings of the run."""
        return self.prepared.config

    def resume(self, hashes: Mapping[str, str], say: Callable[[str], None]) -> None:
        """Restores the run's last checkpoint, if there is one.

        Args:
            hashes: of the training and test levels, which must be those that the run was begun on.

        Raises:
            CheckpointError: the checkpoint belongs to other code or other levels, or is damaged.
        """
        extra = resume_checkpoint(self.folder, self.config, self.learner, self.code, say)
        if extra is None:
            return
        # The fingerprint of the code does not cover a user's module that defines levels.
        if read_versions(self.folder, begun=True).get("levels") != hashes:
            raise CheckpointError(
                f"the run in {self.folder} was begun on other levels than those that {self.config.levels.train} gives "
                f"now, or its {VERSIONS} was changed. Go back to that definition, or train anew with restart=true"
            )
        self.seconds = extra["seconds"]
        frames = self.journal.frames = self.learner.frames
        # By their number, not by their frames: the evaluation adds rows of the last frames, and comes again.
        self.rows = read_metrics(self.folder).to_pylist()[: extra.get("rows")]
        if self.chosen is not None:
            self.chosen.load_state_dict(extra["levels"])
            self.chosen.log.rows = read_played(self.folder).to_pylist()[: extra.get("played")]
        if extra.get("figures", now := digest(self.rows)) != now:
            raise CheckpointError(f"{self.folder / METRICS} is not that of the checkpoint: restore it; or restart=true")
        say(f"{self.config.label()}: goes on from {frames:,} of {self.config.scale.frames:,} frames")

    def train(self) -> None:
        """Iterates until the budget is used up; evaluates on the test levels every ``evaluation.interval`` frames before.

        Raises:
            TrainingError: a figure or a weight is not finite. The last checkpoint is from before that.
            Stopped: a signal stopped the run; its checkpoint is written.
        """
        config, learner, total = self.config, self.learner, self.config.scale.frames
        saved = time.monotonic()
        with closing(Progress(config.label(), total, learner.frames, shown=config.progress)) as progress, self.signals:
            if self.chosen is not None and learner.frames == 0:
                began = time.perf_counter()
                figures = self.chosen.begin(learner)
                self.seconds += time.perf_counter() - began
                self.log(figures)
            while learner.frames < total:
                before = learner.frames
                figures = self.iterate()
                progress.update(learner.frames, figures)
                every = config.evaluation.interval
                if learner.frames < total and every and before // every < learner.frames // every:
                    self.log(self.evaluate())
                is_time = time.monotonic() - saved > config.checkpoint_interval
                if is_time or learner.frames >= total or self.signals.pending:
                    self.save()
                    saved = time.monotonic()
                self.signals.handle_pending(f" after {learner.frames:,} of {total:,} frames; the checkpoint is written")

    def iterate(self) -> Mapping[str, float]:
        """One iteration of the learner, in the history; raises :class:`TrainingError`."""
        before, began = self.learner.frames, time.perf_counter()
        figures = self.learner.iterate()
        if self.chosen is not None:
            figures = {**figures, **self.chosen.advance(self.learner)}
        duration = time.perf_counter() - began
        self.seconds += duration
        self.journal.frames = self.learner.frames
        speed = {"speed/frames_per_second": (self.learner.frames - before) / duration}
        self.log({**figures, **speed})
        for name, value in figures.items():
            if not math.isfinite(value):
                raise TrainingError(
                    f"{name} became {value} after {self.learner.frames} frames; lower algorithm.learning_rate"
                )
        return figures

    def save(self) -> None:
        """Writes metrics and checkpoint; raises :class:`RunFolderError`, and :class:`TrainingError` as :meth:`train`."""
        # Metrics first: a resumed run drops rows that are newer than its checkpoint, but cannot restore missing rows.
        self.write_figures()
        extra: dict[str, Any] = {"seconds": self.seconds, "rows": len(self.rows), "figures": digest(self.rows)}
        if self.chosen is not None:
            extra |= {"levels": self.chosen.state_dict(), "played": len(self.chosen.log.rows)}
        save_checkpoint(self.folder, self.config, self.learner, extra, self.code)

    def log(self, figures: Mapping[str, float]) -> None:
        """Adds figures of this moment."""
        moment = {"frames": int(self.learner.frames), "seconds": self.seconds}
        self.rows += [{"name": name, **moment, "value": float(value)} for name, value in figures.items()]

    def write_figures(self) -> None:
        """Replaces ``metrics.parquet`` and, where something chooses levels, ``played.parquet``.

        Raises:
            RunFolderError: a file cannot be written.
        """
        write_rows(self.folder / METRICS, self.rows, METRIC_SCHEMA)
        if self.chosen is not None:
            write_rows(self.folder / PLAYED, self.chosen.log.rows, PLAYED_SCHEMA)

    def evaluate(self) -> dict[str, float]:
        """Mean figures on the test levels, one episode each, in both action modes."""
        train, test = self.prepared.level_sets
        options = self.prepared.env_options(train=train, which="test")
        seed = self.config.evaluation.seed
        return figures_in_modes(play_in_modes(self.learner.policy, "test", test, options, seed), "test")
