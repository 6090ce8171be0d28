"""A search for good hyper-parameters with Optuna: ``segar search search=ppo_fast search.trials=20``.

Every trial is an ordinary run (or one per seed), with its run folder, its place in MLflow and its checkpoints. The trials
are stored in an SQLite file under ``searches/`` of the runs' root: the same command continues from there, and a trial that
was interrupted resumes from its checkpoint. ``conf/search.yaml`` gives trials validation levels of their own, so that the
test levels of a final run decide nothing.
"""

import dataclasses
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

import optuna
from omegaconf import DictConfig
from optuna.distributions import BaseDistribution, CategoricalDistribution, FloatDistribution, IntDistribution
from optuna.trial import Trial, TrialState
from sqlalchemy.exc import SQLAlchemyError

from segar.cli import table
from segar.errors import did_you_mean, naming
from segar.experiments.commands.hydra_app import run_command, to_plain
from segar.experiments.levels.builders import Prepared
from segar.experiments.reproduction.grid import with_settings
from segar.experiments.reproduction.process_pool import Job, JobResult, run_jobs
from segar.experiments.runs.executed_code import code_of, combined, executed_code
from segar.experiments.runs.run_folder import lock, runs_root
from segar.experiments.settings import (
    OWN_TASK,
    ConfigError,
    Count,
    RunConfig,
    RunFolderError,
    Seed,
    Settings,
    TrainingError,
    as_data,
    construct,
    one_of,
    path_of,
    plain_name,
    require,
    run_config,
    sqlite_address,
    without_folder,
)
from segar.experiments.settings.run import digest
from segar.experiments.train import train
from segar.support import first_line

SHOWN = 5  # trials in the closing table
ERROR = "error"  # attribute of a failed trial; an interrupted trial has none
SPACE = "search.space"


@dataclass(frozen=True)
class Dimension:
    """The interval from which one setting takes its values."""

    low: float
    high: float
    log: bool = False  # whether all orders of magnitude are equally likely
    whole: bool = False  # whether only whole numbers are meant


def distributions(space: Mapping[str, Any], place: str = "") -> dict[str, BaseDistribution]:
    """Dotted name and values of each setting in a space, which is nested as the settings are; choices are JSON, because Optuna
    takes no lists, such as widths.

    Raises:
        ConfigError: an entry is neither a group of settings nor an interval nor a list of choices.
    """
    found: dict[str, BaseDistribution] = {}
    for key, value in space.items():
        name = path_of(place, key)
        if not isinstance(value, Mapping):
            raise ConfigError(f"{SPACE}.{name}: {value!r} must say low and high, or choices")
        if {"low", "high", "choices"} & value.keys():
            found[name] = _distribution(value, f"{SPACE}.{name}")
        else:
            found |= distributions(value, name)
    return found


def _distribution(data: Mapping[str, Any], place: str) -> BaseDistribution:
    if "choices" in data:
        choices = data["choices"]
        is_list = isinstance(choices, list) and bool(choices) and len(data) == 1
        require(is_list, place, dict(data), "a list of choices alone; or low and high")
        return CategoricalDistribution([json.dumps(choice) for choice in choices])
    made = construct(Dimension, data, place)
    is_whole = made.low.is_integer() and made.high.is_integer()
    wanted = f"{'whole numbers ' if made.whole else ''}low and high, low < high; or choices"
    require(0 < made.high - made.low < math.inf and (is_whole or not made.whole), place, dict(data), wanted)
    require(not made.log or made.low > 0, place, made.low, "above 0, where log is true")
    if made.whole:
        return IntDistribution(int(made.low), int(made.high), log=made.log)
    return FloatDistribution(made.low, made.high, log=made.log)


def example_of(distribution: Any) -> Any:
    """One of the values."""
    return distribution.choices[0] if isinstance(distribution, CategoricalDistribution) else distribution.low


def with_values(run: RunConfig, values: Mapping[str, Any]) -> RunConfig:
    """``run`` with values of Optuna's for some settings; raises :class:`ConfigError` for an unknown name or a wrong value."""
    with naming(SPACE, ConfigError):
        return with_settings(run, {name: json.loads(x) if isinstance(x, str) else x for name, x in values.items()})


@dataclass(frozen=True)
class SearchConfig(Settings):
    """The space of a search, its budget, and the figure that it optimises."""

    group: ClassVar[str] = "search"

    # Settings by name, each with a :class:`Dimension` or choices.
    space: Mapping[str, Any] = field(default_factory=dict)
    trials: Count = 20  # in all, those of earlier calls included
    processes: Count = 1  # runs at a time
    seeds: Count = 1  # runs per trial, of which the mean counts; from ``seed`` upwards
    metric: str = "evaluation/test/return/deterministic"  # a final figure of a run
    direction: Annotated[str, one_of("maximize", "minimize")] = "maximize"
    sampler_seed: Seed = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        distributions(self.space)


@dataclass(frozen=True)
class Search:
    """A search: the settings that all trials share, its own settings, and the function that carries out a run."""

    run: RunConfig
    config: SearchConfig
    work: Callable[[RunConfig], Mapping[str, float]] = train  # importable by name

    @property
    def space(self) -> dict[str, BaseDistribution]:
        """The settings that vary."""
        return distributions(self.config.space)

    @property
    def name(self) -> str:
        """Levels and algorithm, with a hash of the code and all settings that decide the trials; their number does not."""
        settings = as_data(self.config)
        decisive = {key: settings[key] for key in ("space", "seeds", "metric", "direction")}
        run = with_values(self.run, {name: example_of(one) for name, one in self.space.items()})
        code = combined(executed_code(Prepared(run)) | code_of(self.config.space))
        decided = digest([self.run.identity(), decisive, code])
        return plain_name(f"{without_folder(self.run.levels.train)}-{self.run.algorithm.name}-{decided}")


def search(spec: Search) -> optuna.Study:
    """Tries settings until enough trials have ended, and prints the best.

    Raises:
        ConfigError: a setting of the space does not exist, or there is none.
        RunFolderError: another process is at work on the same search, or its trials cannot be stored or read.
        TrainingError: all trials failed.
    """
    require(bool(spec.space), "search.space", {}, "one setting or more; search=ppo_fast has some")
    name = spec.name  # which tries a value of each setting
    folder = runs_root(spec.run) / "searches" / name
    with lock(folder):
        study = open_study(sqlite_address(folder / "trials.db"), spec)
        # An interrupted trial is to be repeated; one that failed is not.
        ended = [t for t in study.get_trials(deepcopy=False) if t.state is TrialState.COMPLETE or ERROR in t.user_attrs]
        left = max(spec.config.trials - len(ended), 0)
        print(f"{name}: {left} of {spec.config.trials} trials to do; logs: {folder / 'logs'}", flush=True)
        together = max(spec.config.processes // spec.config.seeds, 1)  # trials that run side by side
        while left > 0:
            trials = [study.ask(spec.space) for _ in range(min(left, together))]
            jobs: dict[int, list[Job]] = {}
            for trial in trials:
                try:
                    jobs[trial.number] = jobs_of(spec, trial, folder / "logs")
                except ConfigError as error:  # a value of the space, or several together, are not allowed
                    record_failure(study, trial, str(error))
            outcomes = run_jobs([job for some in jobs.values() for job in some], spec.work, spec.config.processes)
            if spec.name != name:
                raise ConfigError(f"{name}: a file of the code changed while trials ran; give the command again")
            for trial in (one for one in trials if one.number in jobs):
                record_trial(study, trial, [one for one in outcomes if one.job in jobs[trial.number]], spec.config)
            left -= len(trials)
    print(report(study, spec), flush=True)
    return study


def open_study(storage: str, spec: Search) -> optuna.Study:
    """The study in this storage, made if need be; interrupted trials are put back into its queue. Raises
    :class:`RunFolderError` where that is impossible."""
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    direction = "maximize" if spec.config.direction == "maximize" else "minimize"
    try:
        study = optuna.create_study(study_name=spec.name, storage=storage, direction=direction, load_if_exists=True)
    except SQLAlchemyError as error:
        raise RunFolderError(
            f"cannot read or write {storage}: {first_line(error)}. Without this file the search begins anew, and finds its runs"
        ) from error
    # From one seed, a search that goes on would draw the numbers of its first trials again.
    seed = spec.config.sampler_seed + len(study.get_trials(deepcopy=False))
    study.sampler = optuna.samplers.TPESampler(seed=seed % 2**32, constant_liar=spec.config.processes > 1)
    for trial in study.get_trials(states=(TrialState.RUNNING,)):  # interrupted, as this process holds the lock
        study.tell(trial.number, state=TrialState.FAIL)
        study.enqueue_trial(trial.params)
    return study


def jobs_of(spec: Search, trial: Trial, logs: Any) -> list[Job]:
    """The runs of a trial."""
    run = dataclasses.replace(with_values(spec.run, trial.params), folder=None)
    runs = [dataclasses.replace(run, seed=run.seed + k) for k in range(spec.config.seeds)]
    return [
        Job(f"trial-{trial.number}-s{one.seed}", one, logs / f"trial-{trial.number}-s{one.seed}.log") for one in runs
    ]


def record_trial(study: optuna.Study, trial: Trial, outcomes: Sequence[JobResult], config: SearchConfig) -> None:
    """Reports a trial's result to the study, and prints it; raises :class:`ConfigError` if runs have no such figure."""
    wrong = next((outcome for outcome in outcomes if outcome.error is not None), None)
    if wrong is not None:
        return record_failure(study, trial, f"{wrong.error} (log: {wrong.job.log})")
    figures = [outcome.result for outcome in outcomes]
    if config.metric not in figures[0]:
        raise ConfigError(f"search.metric: runs have no '{config.metric}'.{did_you_mean(config.metric, figures[0])}")
    values = [each[config.metric] for each in figures]
    if not all(isinstance(one, int | float) and math.isfinite(one) for one in values):
        return record_failure(study, trial, f"{config.metric} is no number in all of its runs: {values}")
    value = sum(values) / len(values)
    study.tell(trial, value)
    settings = ", ".join(f"{name.rpartition('.')[2]} {in_short(setting)}" for name, setting in trial.params.items())
    print(f"trial {trial.number}: {value:.4g} with {settings}", flush=True)


def record_failure(study: optuna.Study, trial: Trial, why: str) -> None:
    """Reports to the study that a trial failed, and prints why."""
    trial.set_user_attr(ERROR, why)
    study.tell(trial, state=TrialState.FAIL)
    print(f"trial {trial.number}: FAILED: {why}", flush=True)


def report(study: optuna.Study, spec: Search) -> str:
    """The best trials, and the command that trains with the best one; raises :class:`TrainingError` if there is none."""
    found = [(trial.value, trial) for trial in study.get_trials(deepcopy=False) if trial.value is not None]
    if not found:
        raise TrainingError("no trial of the search went through; see the logs above")
    found.sort(key=lambda pair: pair[0], reverse=spec.config.direction == "maximize")
    best = found[0][1].params
    rows = [[trial.number, value, *map(in_short, trial.params.values())] for value, trial in found[:SHOWN]]
    run = spec.run
    groups = f"levels={run.levels.train} observation={run.observation.name} algorithm={run.algorithm.name}"
    groups += f" task={run.task.name}" * (run.task.name != OWN_TASK)
    settings = " ".join(f"{name}={in_short(value, '')}" for name, value in best.items())  # all digits
    listed = table(["trial", spec.config.metric, *best], rows)
    return f"{listed}\ntrain with the best: segar train {groups} {settings}"


def in_short(value: Any, form: str = ".4g") -> str:
    """A parameter of Optuna's as the command line writes it, a number in a ``form``; text holds a choice as JSON."""
    return json.dumps(json.loads(value), separators=(",", ":")) if isinstance(value, str) else format(value, form)


SETTINGS = {"search": as_data(SearchConfig())}  # and their defaults


def build(config: DictConfig) -> Search:
    """Hydra's result as settings."""
    data = to_plain(config)
    settings = construct(SearchConfig, data.pop("search"), "search")
    return Search(run_config(data), settings)


def main() -> None:
    """The command, with what the command line states."""
    run_command(search, "search", build, SETTINGS)


if __name__ == "__main__":
    main()
