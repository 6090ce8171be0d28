"""The paper's experiments, from training to tables and report: ``segar reproduce scale=quick``.

Every file of ``conf/experiment/`` is an experiment: a grid of runs, transfers of its agents to other levels, a study that
needs no training. A run that several experiments need is trained once. Finished runs are found by the hash of their
settings, and interrupted runs are resumed. The command prints a plan first, and the places of tables and report at the end.
The first time, the smallest scale comes before that, so that there is a report within minutes. Where the plan takes longer
than ten minutes, its report is made again as runs finish. Until all are there, it says that it is preliminary.

  make reproduce-paper SCALE=quick

Settings, as name=value (make: ARGS="name=value ..."):
  scale=NAME                 how much is run, see below (make: SCALE=NAME)
  experiments=[a,b]          only these; empty: all that the scale has
  dry_run=true               print the plan and run nothing
  processes=N                runs side by side; 0, the default: one per core
  report=false               tables only
  preview=false              not the smallest scale first, whose report is there within minutes
  imported=[FOLDER]          tables of runs that were made on other machines: they count as done, and are joined in
  ++grids.NAME.grid.counts=[5]  instead of what its file says; what the file says of the scale wins, and is
                             ++grids.NAME.scales.quick.counts=[5]; ++grids.NAME.scales.quick={} adds a scale
  probes.SCALE.frames=N      how finished runs are probed at a scale; grids.NAME.probes=false: not at all
  +experiment@grids.NAME=NAME  an experiment of your own, conf/experiment/NAME.yaml
  root=FOLDER                where run folders are, and are looked for; runs/ of the checkout by default
  seed, algorithm, observation, scale.frames, evaluation.episodes, tracking, ... as for segar train
"""

import dataclasses
import shlex
import statistics
import sys
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from omegaconf import DictConfig
from tqdm import tqdm

from segar.experiments.commands.config_store import CONF
from segar.experiments.commands.hydra_app import compose_data, initialized, run_command, to_plain
from segar.experiments.commands.kernels import choose_kernels
from segar.experiments.commands.plugin import REPORTS, STUDIES, find_plugin, run_plugin
from segar.experiments.evaluation.probing import PREFIX, ProbeConfig, probe_finished
from segar.experiments.evaluation.transfers import RunTask
from segar.experiments.reproduction.experiment_file import PLAN, SCALES, STUDY, Experiment, chosen_names, experiment_at
from segar.experiments.reproduction.imported_results import read_imported_results
from segar.experiments.reproduction.plan import (
    STUDY_SECONDS,
    ReproductionPlan,
    StudyTask,
    as_data_of,
    as_text,
    in_minutes,
    is_study_done,
    make_plan,
    measure_speeds,
)
from segar.experiments.reproduction.process_pool import Job, JobResult, run_jobs
from segar.experiments.runs.files import absolute_path, write_text
from segar.experiments.runs.run_folder import runs_root, write_json
from segar.experiments.runs.trust import signed
from segar.experiments.settings import (
    ConfigError,
    GridPoint,
    RunConfig,
    TrainingError,
    as_data,
    config_at,
    construct,
    design_hash,
    hand_on_password,
    require,
    run_config,
    without_password,
)
from segar.experiments.tracking.mlflow_store import is_server
from segar.experiments.train import train
from segar.support import cores, read_yaml

SMALLEST, PREVIEW = SCALES[0], "preview"  # the scale of a first report, and the folder of its runs within the root
PAGE = "report.html"
INTERIM = (0.25, 0.5, 0.75)  # parts of the expected time after which the report is made again
LONG = 600.0  # [s] a plan that takes longer is worth reports in between


@dataclass(frozen=True)
class ReportTask:
    """Tables and report of a results folder, of the runs that are finished when its turn comes."""

    folder: Path


Work = RunTask | StudyTask | ReportTask


@dataclass(frozen=True)
class ReproduceConfig:
    """The settings that all runs share, the experiments, and how many runs work side by side."""

    run: RunConfig = field(default_factory=RunConfig)
    processes: int = 0  # 0: one per core
    experiments: tuple[str, ...] = ()  # none: all of this scale
    grids: Mapping[str, Any] = field(default_factory=dict)  # of each experiment, as its file says
    probes: Mapping[str, Any] = field(default_factory=dict)  # of each scale: settings of probes
    imported: tuple[str, ...] = ()  # folders with tables of runs that were made on other machines
    dry_run: bool = False  # print the plan, and run nothing
    report: bool = True  # have the plug-in "report" write the claims, figures, page and PDF
    preview: bool = True  # carry out the smallest scale first, where there is no report yet
    study: Mapping[str, Any] = field(default_factory=dict)  # what a file of segar study says; empty: the paper's

    def __post_init__(self) -> None:
        require(self.processes >= 0, "processes", self.processes, "0 or more")
        chosen_names(self.experiments, list(self.grids))
        for scale, settings in self.probes.items():
            construct(ProbeConfig, settings, f"probes.{scale}")

    @property
    def name(self) -> str:
        """Names scale and settings, e.g. ``quick-3f9a12cd``."""
        scale = self.run.scale
        cell = GridPoint(scale.families[0], scale.difficulties[0], scale.counts[0], self.run.seed)
        return f"{self.study.get('name', scale.name)}-{design_hash(config_at(self.run, cell))}"

    @property
    def folder(self) -> Path:
        """The folder of tables, report and logs."""
        return runs_root(self.run) / "results" / self.name

    def imported_folders(self) -> list[Path]:
        """Absolute paths of the folders of ``imported``."""
        return [absolute_path(folder) for folder in self.imported]

    def at_scale(self) -> list[Experiment]:
        """The chosen experiments at this scale; raises :class:`ConfigError` if one is wrong, or none is left."""
        found = []
        for name in chosen_names(self.experiments, list(self.grids)):
            experiment = experiment_at(name, self.grids[name], self.run.scale.name)
            if experiment is not None:
                found.append(experiment)
            elif self.experiments:
                raise ConfigError(
                    f"experiments: {name} has no scale '{self.run.scale.name}'; it has "
                    f"{', '.join(self.grids[name].get('scales', {})) or 'none'}"
                )
        if not found:
            raise ConfigError(f"scale.name: no experiment has a scale '{self.run.scale.name}'")
        return found


def reproduce(
    config: ReproduceConfig,
    work: Callable[[Work], Any] | None = None,
    finish: Callable[[ReproduceConfig, ReproductionPlan], bool] | None = None,
    left_out: Collection[str] = (),
) -> None:
    """Carries out all tasks that are not done yet, makes tables and report, and prints where they are.

    Args:
        work: carries out one task in another process; importable by name. None: :func:`carry_out`.
        finish: makes tables and report, and returns whether it succeeded; None: :func:`tables_and_report`.
        left_out: labels of runs that the plan has no need of.

    Raises:
        TrainingError: some runs failed; the others are finished and in the tables.
        ConfigError: a study is not known.
    """
    imported = read_imported_results(config.imported_folders())
    scale = config.run.scale.name
    probes = construct(ProbeConfig, config.probes.get(scale, {}), f"probes.{scale}")
    plan = make_plan(config.at_scale(), with_sweep_tag(config), config.folder, probes, imported, left_out)
    for study in plan.studies:
        find_plugin(STUDIES, study.study)
    if finish is None and any(work.run.levels.is_endless for work in plan.runs):
        advice = "numbers, of which tables have a column; endless levels: segar sweep levels.count=10,endless"
        raise ConfigError(f"grid.counts: endless is not allowed; it must be {advice}")
    speeds = measure_speeds(runs_root(config.run))
    processes = config.processes or cores()
    print(as_text(plan, speeds, processes, config.run.scale), flush=True)
    print(f"Runs: {runs_root(config.run)}\nTables, report, logs: {config.folder}", flush=True)
    if config.dry_run:
        return
    # Studies first: the longest takes a minute, in which other processes would be idle at the end.
    waiting: dict[str, tuple[Work, float]] = {
        one.name: (one, STUDY_SECONDS) for one in plan.studies if not is_study_done(one)
    }
    waiting |= {
        one.run.label(): (one, speeds.seconds(one)) for one in plan.runs if one.run.restart or not one.is_done()
    }
    write_plan(config, plan)
    if config.report and plan.runs and finish is None:
        waiting = with_reports(waiting, config.folder, processes)
    failed = do_all(config.folder / "logs", waiting, processes, work or carry_out)
    finished = (finish or tables_and_report)(config, plan)
    if failed or not finished:
        lacks = [] if finished else ["there are no tables or no report: see what it says above"]
        raise TrainingError(failures(failed, len(waiting), *lacks, KEPT))


def reproduce_with_preview(config: ReproduceConfig) -> None:
    """:func:`reproduce`; where there is no report yet, the smallest scale first, in a folder of its own."""
    if config.preview and config.report and not (config.dry_run or config.experiments or config.imported):
        with initialized():
            small = build(compose_data([f"scale={SMALLEST}", "tracking=none"], "reproduce"))
        run = dataclasses.replace(small.run, root=str(runs_root(config.run) / PREVIEW))
        small = dataclasses.replace(small, run=run, processes=config.processes)
        if config.run.scale.name != SMALLEST and not any((one.folder / PAGE).exists() for one in (small, config)):
            print(f"First the scale {SMALLEST}, for a preliminary report within some minutes (preview=false: not).")
            reproduce(small)
            print(
                f"Preliminary report, whose numbers mean nothing yet: {small.folder / PAGE}\n"
                f"Now the scale {config.run.scale.name}. The line below its plan says how long it takes, and its report"
                f" replaces this one: {config.folder / PAGE}"
            )
    reproduce(config)


def with_reports(
    waiting: Mapping[str, tuple[Work, float]], folder: Path, processes: int
) -> dict[str, tuple[Work, float]]:
    """Tasks with their expected seconds, and where they take long, reports between them."""
    total, begun, found = sum(seconds for _, seconds in waiting.values()), 0.0, {}
    due = list(INTERIM) if total / processes > LONG else []
    for name, (one, seconds) in waiting.items():
        if due and begun >= due[0] * total:
            found[f"report-after-{due.pop(0):.0%}"] = ReportTask(folder), 0.0
        found[name] = one, seconds
        begun += seconds
    return found


def write_plan(config: ReproduceConfig, plan: ReproductionPlan) -> None:
    """Writes the plan into the results folder, where the tables are made from it, and what a study asks."""
    uri = config.run.tracking.uri
    tracking = {**dataclasses.asdict(config.run.tracking), "uri": uri and hand_on_password(uri)}  # to the plug-ins
    about = {"name": config.name, "scale": config.run.scale.name, "runs": str(runs_root(config.run))}
    imported = [str(folder) for folder in config.imported_folders()]
    experiments = as_data_of(plan)
    write_json(config.folder / PLAN, {**about, "elsewhere": imported, "tracking": tracking, "experiments": experiments})
    if config.study:
        write_text(config.folder / STUDY, signed(yaml.safe_dump(dict(config.study), sort_keys=False)))


def with_sweep_tag(config: ReproduceConfig) -> RunConfig:
    """The run's settings, with the reproduction's name as MLflow tag unless another is given."""
    tracking = dataclasses.replace(config.run.tracking, sweep=config.run.tracking.sweep or config.name)
    return dataclasses.replace(config.run, tracking=tracking)


def carry_out(work: Work) -> dict[str, float]:
    """Trains or resumes a run, then tests and probes its agent as far as needed; or runs a study. Returns final figures.

    The module that tests agents imports torch. It is imported here, so that planning does not load torch.
    """
    if isinstance(work, StudyTask):
        work.out.mkdir(parents=True, exist_ok=True)
        if not run_plugin(STUDIES, work.study, work.out, work.options):
            raise TrainingError(f"the study {work.study} failed")
        write_json(work.done_file, work.request())
        return {}
    if isinstance(work, ReportTask):
        if not all(run_plugin(REPORTS, name, work.folder) for name in ("tables", "report")):
            raise TrainingError("the report failed")
        return {}
    choose_kernels(work.run.determinism)
    from segar.experiments.evaluation.transfer_evaluation import evaluate_transfer

    figures = train(work.run)
    for transfer in work.transfers_left():
        evaluate_transfer(work.run, transfer)
    if work.probes is not None and work.needs_probing():
        figures = {**figures, **probe_finished(work.run, work.probes)}
    return figures


def do_all(
    logs: Path, waiting: Mapping[str, tuple[Any, float]], processes: int, work: Callable[[Any], Any]
) -> list[JobResult]:
    """Carries out tasks side by side and prints how each ended; returns the failed ones.

    Args:
        logs: the folder of their logs.
        waiting: name to task and expected seconds.
    """
    jobs = [Job(name, one, logs / f"{name}.log") for name, (one, _) in waiting.items()]
    left = {name: seconds for name, (_, seconds) in waiting.items()}
    times = [1.0]  # what was expected, and of each task that ended, how many times that it took

    def end(outcome: JobResult) -> None:
        expected = left.pop(outcome.job.name)
        bar.update()
        times.append(outcome.seconds / expected if expected and outcome.error is None else 1.0)
        # The median, because the first tasks also load libraries and compile kernels.
        seconds = sum(left.values()) * statistics.median(times) / processes
        rest = f"about {in_minutes(seconds)} left" if left else "all done"
        bar.write(f"[{len(jobs) - len(left)}/{len(jobs)}] {ending(outcome)}; {rest}", file=sys.stdout)
        sys.stdout.flush()

    with tqdm(total=len(jobs), unit="task", leave=False, disable=None) as bar:  # a bar on a terminal alone
        outcomes = run_jobs(jobs, work, max(min(processes, len(jobs)), 1), end)
    return [outcome for outcome in outcomes if outcome.error is not None]


def ending(outcome: JobResult) -> str:
    """The result of a task in one line."""
    name, took = outcome.job.name, in_minutes(outcome.seconds)
    if outcome.error is not None:
        return f"{name}: FAILED after {took}: {outcome.error} (log: {outcome.job.log})"
    figures = outcome.result or {}
    shown = {
        "gap": "evaluation/gap/deterministic",
        "test success": "evaluation/test/success/deterministic",
        "probe accuracy": f"{PREFIX}accuracy/test",
    }
    return ", ".join([f"{name}: {took}", *(f"{k} {figures[v]:.2f}" for k, v in shown.items() if v in figures)])


def tables_and_report(config: ReproduceConfig, plan: ReproductionPlan) -> bool:
    """Has the plug-ins make the tables, and the report if anything is trained; returns whether they could."""
    began = time.monotonic()
    done = run_plugin(REPORTS, "tables", config.folder)
    if done and config.report and plan.runs:
        done = run_plugin(REPORTS, "report", config.folder)
    elif done and (folder_report := config.folder / PAGE).exists():
        print(f"note: {folder_report} and what is beside it are of the tables before these; report=true renews them")
    if done:
        print(f"Tables and report took {in_minutes(time.monotonic() - began)}. Figures and curves in the browser:")
        print(f"  {dashboard(config.run)}")
    return done


def dashboard(run: RunConfig) -> str:
    """The server's address, or the command that opens MLflow's pages over the runs."""
    uri = run.tracking.uri
    if uri is None:
        return f"{sys.executable} -m segar dashboard root={shlex.quote(str(runs_root(run)))}"
    uri = without_password(uri)
    return uri if is_server(uri) else f"{sys.executable} -m mlflow server --backend-store-uri '{uri}'"


KEPT = "What is finished is kept: the same command does only what is missing."


def failures(failed: Sequence[JobResult], pieces: int, *closing: str) -> str:
    """The failed tasks, and what to do about them; ``closing`` says what became of the rest, which is kept."""
    lines = [f"{len(failed)} of {pieces} failed:"] if failed else []
    lines += [f"  {one.job.name}: {one.error}\n    log: {one.job.log}" for one in failed]
    lines += closing or [KEPT]
    if any("restart=true" in str(one.error) for one in failed):
        lines.append("restart=true trains all of them anew; to train one anew, delete its run folder.")
    if any("stale=anew" in str(one.error) for one in failed):
        lines.append("stale=anew trains anew what other code made, and nothing else.")
    return "\n".join(lines)


def build(config: DictConfig, **stated: Any) -> ReproduceConfig:
    """Hydra's result as settings, but for those that are ``stated``."""
    data = to_plain(config)
    own = {key: data.pop(key) for key in SETTINGS} | stated
    return construct(ReproduceConfig, own, "", run=run_config(data))


SETTINGS = {name: value for name, value in as_data(ReproduceConfig()).items() if name not in ("run", "study")}


def help_text() -> str:
    """What this module says of the command, with the scales and experiments in ``conf/``."""
    lines = [(__doc__ or "").strip(), "", "Scales:"]
    for file in sorted((CONF / "scale").glob("*.yaml")):
        about = [
            line[2:]
            for line in file.read_text(encoding="utf-8").splitlines()
            if line.startswith("# ") and "@package" not in line
        ]
        if file.stem != "single":
            lines.append(f"  {file.stem:<10} {' '.join(about)}")
    lines += ["", "Experiments, and the scales that they have:"]
    for name, data in experiment_files().items():
        lines.append(f"  {name:<24} {data['title']} ({', '.join(data.get('scales', {}))})")
    return "\n".join(lines)


def experiment_files() -> dict[str, dict[str, Any]]:
    """Name and content of the files of ``conf/experiment``."""
    return {file.stem: read_yaml(file.read_bytes()) for file in sorted((CONF / "experiment").glob("*.yaml"))}


def main() -> None:
    """The command."""
    run_command(reproduce_with_preview, "reproduce", build, SETTINGS, help_text)


if __name__ == "__main__":
    from segar.experiments import reproduce as module  # jobs of launchers find functions by their module

    module.main()
