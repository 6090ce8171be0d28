"""The plan of a reproduction: the runs that experiments need, each once; which of them are done; how long the rest takes."""

import dataclasses
import socket
import statistics
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime
from itertools import combinations
from pathlib import Path
from typing import Any

from segar.cli import table
from segar.experiments.evaluation.probing import ProbeConfig
from segar.experiments.evaluation.transfers import FactorSwap, RunTask, Transfer
from segar.experiments.levels.builders import Prepared
from segar.experiments.reproduction.checks import (
    check_claims,
    check_groups,
    check_objects,
    check_transfers,
    untestable_claims,
)
from segar.experiments.reproduction.experiment_file import Experiment, TransferConfig, other_panel
from segar.experiments.reproduction.grid import chosen, grid_runs
from segar.experiments.reproduction.imported_results import ImportedResults
from segar.experiments.runs.executed_code import changed_parts, executed_code
from segar.experiments.runs.files import read_json
from segar.experiments.runs.journal import read_journal
from segar.experiments.runs.run_folder import (
    CHECKPOINT,
    EVALUATIONS,
    VERSIONS,
    folder_path,
    is_finished,
    read_config,
    read_summary,
    run_folders,
    runs_root,
)
from segar.experiments.settings import ConfigError, RunConfig, RunFolderError, ScaleConfig, grid_point, require
from segar.levels import REST, SEPARATOR
from segar.support import counted

ASSUMED_BESIDE = 13.0  # [s] per run for preparation, where its kernel is compiled already, and evaluation
ASSUMED_PROBING = 60.0  # [s] per run
TRANSFER_SHARE = 0.3  # of that: a run's evaluation has two level sets instead of one
STUDY_SECONDS = 30.0


@dataclass(frozen=True)
class StudyTask:
    """A study without training: the plug-in that runs it, its options, and where its files go."""

    name: str
    study: str
    options: Mapping[str, Any]
    out: Path

    @property
    def done_file(self) -> Path:
        """Written when the study has succeeded; it holds the request."""
        return self.out / "study.json"

    def request(self) -> dict[str, Any]:
        """The plug-in that was asked for, with its options."""
        return {"study": self.study, "options": self.options}


@dataclass(frozen=True)
class ReproductionPlan:
    """The experiments, the runs of each, and all tasks without repetition."""

    experiments: tuple[Experiment, ...]
    members: Mapping[str, tuple[RunTask, ...]]  # of each experiment, with its transfers
    runs: tuple[RunTask, ...]  # all, each with the transfers of all experiments
    studies: tuple[StudyTask, ...]
    other_code: str = ""  # which results other code than today's made, and what becomes of them


@dataclass(frozen=True)
class Changed:
    """What other code than today's made: the labels of finished runs, of unfinished ones, and pairs of a run's label and the
    name of a transfer's folder; each with the parts that changed."""

    finished: dict[str, list[str]] = field(default_factory=dict)
    unfinished: dict[str, list[str]] = field(default_factory=dict)
    tested: dict[tuple[str, str], list[str]] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.finished or self.unfinished or self.tested)

    def __str__(self) -> str:
        """How many there are, what changed, and which is the first of them."""
        kinds = {"finished run": self.finished, "unfinished run": self.unfinished, "transfer": self.tested}
        counts = [counted(len(found), kind) for kind, found in kinds.items() if found]
        names = sorted({part for found in kinds.values() for parts in found.values() for part in parts})
        places = [*self.finished, *self.unfinished, *("/".join((run, EVALUATIONS, one)) for run, one in self.tested)]
        made = "was made" if len(places) == 1 else "were made"
        return (
            f"{' and '.join(counts)} {made} by other code than this; changed since: {', '.join(names)}. The first of them"
            f" is {places[0]}"
        )


def make_plan(
    experiments: Sequence[Experiment],
    base: RunConfig,
    results: Path,
    probes: ProbeConfig | None = None,
    imported: ImportedResults = ImportedResults(),  # noqa: B008 - nothing can change it
    left_out: Collection[str] = (),
) -> ReproductionPlan:
    """The plan for some experiments.

    ``probes`` says how the runs of experiments with probes are probed. A run that is not done here, but whose results are
    ``imported``, counts as done. Runs whose labels are ``left_out`` are none of the plan's.

    Raises:
        ConfigError: a file of ``conf/`` does not exist, or runs cannot be made, transferred or asked what claims ask.
    """
    members = {
        e.name: tuple(one for one in works_of(e, base, probes or ProbeConfig()) if one.run.label() not in left_out)
        for e in experiments
    }
    union: dict[str, RunTask] = {}
    for work in (work for works in members.values() for work in works):
        label = work.run.label()
        other = union.get(label, RunTask(work.run))
        by_folder = {one.folder_name(): one for one in (*other.transfers, *work.transfers)}
        union[label] = RunTask(work.run, tuple(by_folder.values()), other.probes or work.probes)
    check_objects(work.run for work in union.values())
    check_transfers(union.values())
    for experiment in experiments:
        check_claims(experiment, members[experiment.name])
        works, vary = members[experiment.name], [*experiment.grid.vary] if experiment.grid else []
        is_each_another = not vary or len({one.run.label() for one in works}) == len(works)
        require(is_each_another, f"grids.{experiment.name}.grid.vary", vary, "settings that make another run of each")
    changed = changed_code(union.values())
    for label, work in union.items():
        anew = changed.tested if work.run.stale == "anew" else {}
        retested = frozenset(folder for run, folder in anew if run == label)
        parts = tuple({**changed.unfinished, **changed.finished}.get(label, ()))
        work = dataclasses.replace(work, changed=parts, retested=retested)
        if not work.is_done_here():
            work = dataclasses.replace(work, imported=label in imported.runs, whole=imported.has_all(work))
        union[label] = work
    members = {
        name: tuple(
            dataclasses.replace(union[one.run.label()], transfers=one.transfers, probes=one.probes) for one in works
        )
        for name, works in members.items()
    }
    studies = [StudyTask(e.name, e.study, e.options, results / "studies" / e.name) for e in experiments if e.study]
    fate = "They are made anew" if base.stale == "anew" else "Finished ones are kept as they are"
    told = f"{changed}. {fate} (stale={base.stale})." if changed else ""
    return ReproductionPlan(tuple(experiments), members, tuple(union.values()), tuple(studies), told)


def changed_code(works: Collection[RunTask]) -> Changed:
    """The runs and their transfers that were made by other code than today's, with the parts that changed.

    Raises:
        ConfigError: there are such, and ``stale`` does not say what to do with them.
    """
    found = Changed()
    codes: dict[str, dict[str, str]] = {}  # by the settings, but for those that no code depends on
    for work in works:
        run, folder = work.run, folder_path(work.run)
        if not (folder / VERSIONS).exists():
            continue
        levels = dataclasses.replace(run.levels, seed=0, count=1)
        key = repr(dataclasses.replace(run, levels=levels, seed=0))
        codes[key] = codes.get(key) or executed_code(Prepared(run))
        runs = found.finished if is_finished(folder) else found.unfinished
        is_begun = is_finished(folder) or (folder / CHECKPOINT).exists()
        if is_begun and (parts := changed_parts(folder, codes[key])):
            runs[run.label()] = parts
        for one in (one for one in work.transfers if one.is_done(run)):
            mixture = None if one.mixture is None else FactorSwap({}, ())  # what it swaps is data and no code
            asked = repr((dataclasses.replace(one, label="", mixture=mixture), levels, run.task))
            codes[asked] = codes.get(asked) or one.code(run)
            if parts := one.changed_parts(run, codes[asked]):
                found.tested[run.label(), one.folder_name()] = parts
    if found and any(work.run.stale == "refuse" for work in works):
        raise ConfigError(f"{found}. stale=anew trains and tests them anew, stale=keep takes finished ones as they are")
    return found


def works_of(experiment: Experiment, base: RunConfig, probes: ProbeConfig) -> Iterable[RunTask]:
    """The runs of an experiment, their transfers and probes, seed after seed."""
    if experiment.grid is None:
        return
    for run in grid_runs(experiment.grid, base):
        found = [one for one in (transfer_of(transfer, run) for transfer in experiment.transfers) if one is not None]
        found += mixtures_of(experiment, run)
        once = {one.folder_name(): one for one in found}  # for some agents, `harder` is what another transfer names
        yield RunTask(run, tuple(once.values()), probes if experiment.probes else None)


def transfer_of(transfer: TransferConfig, run: RunConfig) -> Transfer | None:
    """A transfer of the agent of ``run``; None where there is no such panel, or it is tested there anyway."""
    cell = grid_point(run)
    panel = other_panel(cell.family, cell.difficulty, transfer)
    if panel is None:
        return None
    variation = run.levels.variation if transfer.variation is None else transfer.variation
    observation = chosen("observation", transfer.observation, run)
    if (panel, variation, observation) == (cell.panel, run.levels.variation, run.observation):
        return None  # what the run is tested on anyway
    parts = [panel if panel != cell.panel else "", transfer.variation or "", transfer.observation or ""]
    label = "-".join(part for part in parts if part) or "unvaried"
    return Transfer(label, panel, variation, observation, run.levels.test_count, run.levels.test_seed)


def mixtures_of(experiment: Experiment, run: RunConfig) -> Iterable[Transfer]:
    """Transfers to levels between training and test, for an experiment that attributes the gap; raises :class:`ConfigError`.

    Every training level counts equally, so that the evaluations on the training and the test levels complete the design.
    """
    if not experiment.attribution:
        return
    levels = run.levels
    if levels.test_count % levels.number:
        raise ConfigError(
            f"grids.{experiment.name}.attribution: {levels.test_count} test levels are no multiple of {levels.number} training "
            "levels, which each is paired with; choose other grid.counts, or levels.test_count"
        )
    check_groups(experiment, levels)
    names = (*experiment.attribution, REST)
    panel = grid_point(run).panel
    for size in range(1, len(names)):
        for changed in combinations(names, size):
            label = f"{SEPARATOR.join(changed)} of test levels"
            mixture = FactorSwap(experiment.attribution, changed)
            yield Transfer(
                label, panel, levels.variation, run.observation, levels.test_count, levels.test_seed, mixture
            )


@dataclass(frozen=True)
class Speeds:
    """Frames per second, and the seconds that runs take beside training, measured on runs of this machine as far as there are
    any."""

    frames: Mapping[tuple[str, str], float]  # by algorithm and observation
    beside: Mapping[tuple[str, str], float]  # for preparation and evaluation
    measured: int  # runs

    def seconds(self, work: RunTask) -> float:
        """How long the rest of a run takes, in seconds, if it runs alone."""
        left = len(work.transfers_left()) * TRANSFER_SHARE * self.beside.get(kind_of(work.run), ASSUMED_BESIDE)
        left += ASSUMED_PROBING * work.needs_probing()
        if is_finished(folder_path(work.run)) and not work.is_anew():
            return left
        return left + self.seconds_of_run(work.run, work.frames_left())

    def seconds_of_run(self, run: RunConfig, frames: int) -> float:
        """How long a run takes for its preparation, so many frames, and its evaluation, in seconds."""
        kind = kind_of(run)
        return self.beside.get(kind, ASSUMED_BESIDE) + frames / self.frames.get(kind, assumed_speed(run))

    def basis(self, runs: Iterable[RunConfig]) -> str:
        """What the times of these runs were measured on, in words."""
        unknown = {kind_of(run) for run in runs} - {*self.frames}
        if not unknown:
            return f"by {counted(self.measured, 'finished run')} here"
        named = f" for {', '.join('/'.join(kind) for kind in sorted(unknown))}" if self.measured else ""
        return f"by assumed speeds{named}, and without the time in which new kernels are compiled"


def assumed_speed(run: RunConfig) -> float:
    """Frames per second of one process where no such run has been measured: what two cores of a small server gave."""
    settings = run.algorithm
    steps, states = getattr(settings, "steps_per_update", 0), run.observation.name.startswith("state")
    speeds = [
        ((40.0 if states else 10.0) * steps, steps),  # so many gradient steps
        (6000.0, states and not hasattr(settings, "core")),
        (250.0, str(getattr(settings, "encoder", "")).startswith("impala")),
        (700.0, hasattr(settings, "core")),
        (900.0, hasattr(settings, "auxiliary_minibatches")),
        (1800.0, True),
    ]
    return next(speed for speed, holds in speeds if holds)


def measure_speeds(root: Path) -> Speeds:
    """The medians over the finished runs under ``root`` that this machine made in one go."""
    frames: dict[tuple[str, str], list[float]] = {}
    beside: dict[tuple[str, str], list[float]] = {}
    for folder in run_folders(root):
        journal = read_journal(folder)
        in_one_go = [entry["event"] for entry in journal] == ["started", "finished"]
        if not (in_one_go and journal[0].get("host") == socket.gethostname() and is_finished(folder)):
            continue
        with suppress(ValueError, TypeError):  # a run of somebody else, or by code that is gone, is nothing to a plan
            summary, kind = read_summary(folder), kind_of(read_config(folder))
            if summary["seconds"]:
                begun, ended = (datetime.fromisoformat(entry["time"]) for entry in journal)
                beside.setdefault(kind, []).append(max((ended - begun).total_seconds() - summary["seconds"], 0.0))
                frames.setdefault(kind, []).append(summary["frames"] / summary["seconds"])
    by_kind = [{kind: statistics.median(values) for kind, values in found.items()} for found in (frames, beside)]
    return Speeds(by_kind[0], by_kind[1], sum(map(len, frames.values())))


def as_text(plan: ReproductionPlan, speeds: Speeds, processes: int, scale: ScaleConfig) -> str:
    """The plan as a table: runs of each experiment, which are shared and done, and how long the rest takes."""
    rows, seen = [], set()
    for experiment in plan.experiments:
        works = plan.members[experiment.name]
        own = [work for work in works if work.run.label() not in seen]
        seen |= {work.run.label() for work in works}
        left = [work for work in own if not work.is_done()]
        rows.append(
            [
                experiment.name,
                experiment.figure or None,
                len(works) or None,
                len(works) - len(own) or None,
                sum(work.is_done() for work in works) if works else None,
                f"{sum(map(RunTask.frames_left, own)):,}" if works else "study",
                sum(map(RunTask.needs_probing, works)) if experiment.probes else None,
                in_minutes(sum(map(speeds.seconds, left)) / processes) if left else None,
            ]
        )
    head = ["experiment", "figure", "runs", "shared", "done", "frames to train", "to probe", "about"]
    waiting = [work for work in plan.runs if not work.is_done()]
    studies = [study for study in plan.studies if not is_study_done(study)]
    total = sum(map(speeds.seconds, waiting)) + STUDY_SECONDS * len(studies)
    closing = (
        f"{scale.name}: {counted(len(plan.runs), 'run')}, {len(plan.runs) - len(waiting)} done, {len(waiting)} to do with "
        f"{sum(map(RunTask.frames_left, waiting)):,} frames, {sum(map(RunTask.needs_probing, waiting))} to probe; "
        f"{len(studies)} of {len(plan.studies)} studies to do; "
        f"about {in_minutes(total / processes)} with {processes} at a time ({speeds.basis(work.run for work in waiting)})."
    )
    idle = [work.run.label() for work in waiting if work.run.takes_no_step()]
    warning = (
        f"warning: {counted(len(idle), 'run')} stay untrained, such as {idle[0]}: scale.frames are one rollout or less, and"
        " algorithm.anneal lowers the learning rate to 0 in the last one. Give more frames, or algorithm.anneal=false"
    ) if idle else ""  # fmt: skip
    claims = (line for one in plan.experiments for line in untestable_claims(one, plan.members[one.name]))
    more = (*claims, warning, plan.other_code)
    return "\n".join([table(head, rows), closing, *filter(None, more)])


def sweep_as_text(runs: Sequence[RunConfig], number: int, speeds: Speeds) -> str:
    """What a sweep of so many runs trains, where, and how long it takes, by some of its runs."""
    frames = statistics.mean(run.scale.frames for run in runs)
    seconds = number * statistics.mean(speeds.seconds_of_run(run, run.scale.frames) for run in runs)
    return (
        f"sweep: {counted(number, 'run')} of {frames:,.0f} frames, in {runs_root(runs[0])}; about {in_minutes(seconds)}, one"
        f" after the other ({speeds.basis(runs)}). Those that finished before are not trained again"
    )


def kind_of(run: RunConfig) -> tuple[str, str]:
    """The algorithm and the observation, on which speed depends."""
    return run.algorithm.name, run.observation.name


def is_study_done(study: StudyTask) -> bool:
    """Whether the study went through with these options."""
    try:
        return read_json(study.done_file) == study.request()
    except RunFolderError:
        return False


def in_minutes(seconds: float) -> str:
    """A duration, rounded for reading."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def as_data_of(plan: ReproductionPlan) -> list[dict[str, Any]]:
    """The plan as plain data, from which tables are made: each experiment with the folders of its runs and transfers."""
    return [
        {
            "name": experiment.name,
            "title": experiment.title,
            "figure": experiment.figure,
            "study": experiment.study,
            "vary": list(experiment.grid.vary) if experiment.grid else [],
            "runs": [
                {
                    "folder": folder_path(work.run).name,
                    "transfers": [one.folder_name() for one in work.transfers],
                    "probes": work.probes is not None,
                    "elsewhere": work.imported,
                    "whole": work.whole,
                }
                for work in plan.members[experiment.name]
            ],
        }
        for experiment in plan.experiments
    ]
