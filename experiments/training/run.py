"""One run from settings to run folder: levels, training, evaluation, distances, summary."""

import dataclasses
import os
import shutil
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from segar.errors import SegarError
from segar.experiments.algorithms.learner import learner_class
from segar.experiments.commands import process_defaults as runtime
from segar.experiments.commands.kernels import choose_kernels
from segar.experiments.commands.signals import watch_signals
from segar.experiments.evaluation.episodes import (
    distance_figures,
    diversity_figures,
    evaluate_run,
    evaluation_figures,
    without_number,
)
from segar.experiments.levels.builders import Prepared
from segar.experiments.networks.devices import arithmetic
from segar.experiments.runs.executed_code import changed_parts, code_after, executed_code
from segar.experiments.runs.journal import PREPARATION, Journal
from segar.experiments.runs.own_modules import folders_of
from segar.experiments.runs.run_folder import (
    EPISODE_SCHEMA,
    EPISODES,
    SUMMARY,
    VERSIONS,
    empty,
    folder_path,
    is_finished,
    join_sweep,
    precision_in,
    read_summary,
    read_versions,
    use_run_folder,
    write_json,
    write_rows,
)
from segar.experiments.runs.versions import computed_with
from segar.experiments.settings import RunConfig, RunFolderError, TrainingError
from segar.experiments.tracking.mlflow_sync import files_of
from segar.experiments.tracking.tracker import Tracker, start_tracking
from segar.experiments.training.preparation import prepare
from segar.experiments.training.training_loop import Training

SHOWN = {  # figures of the closing lines, where there are such, and their names there
    "evaluation/train/return/deterministic": "return on training levels",
    "evaluation/test/return/deterministic": "return on test levels",
    "evaluation/gap/deterministic": "generalization gap",
    "evaluation/train/success/deterministic": "success on training levels",
    "evaluation/test/success/deterministic": "success on test levels",
    "evaluation/train/adaptation_gain_return/deterministic": "gain over training trials",
    "evaluation/test/adaptation_gain_return/deterministic": "gain over test trials",
}


@dataclass(frozen=True)
class RunResult:
    """The folder and the summary of a run, and whether it was trained now or had finished before."""

    folder: Path
    summary: Mapping[str, Any]
    trained: bool


def run(config: RunConfig, say: Callable[[str], None] = print) -> RunResult:
    """Carries out a run, or resumes it, or finds it finished; it can be called many times in one process.

    However the run ends, its folder holds a whole checkpoint, and its journal says what happened. A run that cannot begin
    leaves no folder.

    Raises:
        SegarError: settings, run folder, checkpoint or tracking store cannot be used, or training cannot go on; the
            message says what to do.
        Stopped: a signal stopped it; the same call goes on from there.
    """
    choose_kernels(config.determinism)
    # Sums are taken in another order by other numbers of threads, so all machines need the same.
    runtime.set_process_defaults(1 if config.determinism == "portable" else config.num_threads)
    kind = learner_class(config.algorithm)  # before a run folder is made: it may not fit
    prepared = Prepared(config)
    is_new = not os.path.exists(folder_path(config))  # of a name that is too long, too, as making it says
    if is_new:
        prepared.check_names()
    # The levels' own task may lie elsewhere than the levels; settings that do not name it say nothing of its place.
    config = dataclasses.replace(config, module_path=(*config.module_path, *folders_of(prepared.task_name)))
    with use_run_folder(config) as folder, watch_signals() as signals:
        code = executed_code(prepared) if (folder / VERSIONS).exists() else None
        changed = changed_parts(folder, code)
        differs = f"by other code than this: {', '.join(changed)} changed since"
        if changed and config.stale == "anew":
            say(f"{config.label()}: is trained anew, because it was made {differs}")
            empty(folder, config)
        if is_finished(folder):
            if changed and config.stale == "refuse":
                raise RunFolderError(
                    f"{config.label()}: finished before {differs}. stale=anew trains it anew, stale=keep takes its results as"
                    f" they are; {folder}"
                )
            join_sweep(folder, config.tracking.sweep)
            other, precision = f" ({differs})" if changed else "", precision_in(folder)
            if precision and precision != arithmetic(config)["precision"]:
                other += f" (in {precision}, which algorithm.precision=auto does not mean on this machine)"
            say(f"{config.label()}: finished before, nothing to do{other}; {folder}")
            return RunResult(folder, read_summary(folder), trained=False)
        journal = Journal(folder)
        before = journal.begin()
        if before is not None:
            say(f"{config.label()}: {before}")
        tracker = Tracker()
        try:
            training = prepare(prepared, kind, folder, code, journal, signals, say)
            tracker = start_tracking(config, folder, training.rows)
            summary = _carry_out(training, say)
        except BaseException as error:
            if is_new and journal.doing == PREPARATION and isinstance(error, SegarError):
                shutil.rmtree(folder)  # nothing was trained, and the error says what to mend
                raise
            journal.end(error)
            tracker.finish("KILLED" if isinstance(error, KeyboardInterrupt | SystemExit) else "FAILED")
            raise
        journal.end()
        tracker.finish("FINISHED", files_of(folder))
    say(_closing_lines(prepared, folder, summary))
    return RunResult(folder, summary, trained=True)


def _carry_out(training: Training, say: Callable[[str], None]) -> dict[str, Any]:
    folder, learner, journal = training.folder, training.learner, training.journal
    config, (train, test) = training.prepared.config, training.prepared.level_sets
    journal.doing = "training"
    try:
        training.train()
    except TrainingError:
        with suppress(RunFolderError):  # the figures before the error help to explain it; a resumed run drops them
            training.write_figures()
        raise
    journal.doing = "evaluation"
    began = time.perf_counter()
    episodes = evaluate_run(learner.policy, training.prepared, train, test)
    for line in without_number(episodes):
        say(line)
    distances = distance_figures(train, test, config.evaluation.distances)
    final = {**evaluation_figures(episodes), **distances, **diversity_figures(train, test)}
    if training.chosen is not None:
        final |= training.chosen.finish(learner.frames)
    evaluation_seconds = time.perf_counter() - began
    training.log(final)
    write_rows(folder / EPISODES, episodes, EPISODE_SCHEMA)
    training.write_figures()
    took = {"seconds": training.seconds, "evaluation_seconds": evaluation_seconds}
    played = {row["name"]: row["value"] for row in training.rows if row["name"].startswith("played/")}  # the last ones
    summary = {"label": config.label(), "frames": learner.frames, **took, **final, **played}
    write_json(folder / VERSIONS, {**read_versions(folder), "code": code_after(training.code, say)})
    write_json(folder / SUMMARY, summary)
    training.env.close()
    return summary


def _closing_lines(prepared: Prepared, folder: Path, summary: Mapping[str, Any]) -> str:
    speed = summary["frames"] / max(summary["seconds"], 1e-9)
    lines = [
        f"{prepared.config.label()}: {summary['frames']:,} frames in {summary['seconds']:.0f} s ({speed:,.0f} frames/s)"
    ]
    lines.append(f"  task                        {prepared.task_name}")
    lines += [f"  {name:<27} {summary[key]:8.3f}" for key, name in SHOWN.items() if key in summary]
    lines += [f"  W2, {key[3:]:<23} {value:8.3f}" for key, value in summary.items() if key.startswith("w2/")]
    lines.append(f"  computed with               {computed_with(read_versions(folder))}")
    return "\n".join([*lines, f"  run folder                  {folder}"])
