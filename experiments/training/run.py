"""One run from settings to run folder: levels, training, evaluation, distances, summary."""

import dataclasses
import shutil
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.algorithms.learner import Learner, learner_class, make_learner
from experiments.commands import process_defaults as runtime
from experiments.commands.kernels import choose_kernels
from experiments.commands.signals import SignalMonitor, watch_signals
from experiments.curricula.training_levels import TrainingLevels, settings_of
from experiments.evaluation.episodes import (
    distance_figures,
    diversity_figures,
    evaluate_run,
    evaluation_figures,
    unseen_by_distances,
    without_number,
)
from experiments.levels.builders import (
    check_observations,
    check_results,
    distribution_of,
    environment_options,
    make_levels,
    task_name,
)
from experiments.levels.endless import stream_of
from experiments.networks.devices import arithmetic
from experiments.runs.executed_code import changed_parts, executed_code
from experiments.runs.journal import PREPARATION, Journal
from experiments.runs.level_prints import is_own, prints_of, share_of
from experiments.runs.own_modules import folders_of
from experiments.runs.run_folder import (
    EPISODE_SCHEMA,
    EPISODES,
    LEVELS_TEST,
    LEVELS_TRAIN,
    SUMMARY,
    VERSIONS,
    computed_as_begun,
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
from experiments.runs.versions import computed_with, in_words, versions
from experiments.settings import ConfigError, RunConfig, RunFolderError, TrainingError
from experiments.tracking.mlflow_sync import files_of
from experiments.tracking.tracker import Tracker, start_tracking
from experiments.training.large_numbers import advice, large_numbers
from experiments.training.training_loop import Training
from experiments.training.trials import advice_on_trials
from experiments.training.unseen import (
    advice_on_entities,
    advice_on_parameters,
    unseen_entities,
    unseen_parameters,
)
from segar.envs import VectorEnv
from segar.envs.torchrl_env import TorchRLEnv
from segar.errors import RuleError, SegarError
from segar.levels import Levels, hash_of_levels

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


@dataclass(frozen=True)
class Prepared:
    """What is ready to be trained, or to be trained further."""

    training: Training
    train: Levels
    test: Levels
    env: Any


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
    is_new = not folder_path(config).exists()
    if is_new:
        _check_names(config)
    # The levels' own task may lie elsewhere than the levels; settings that do not name it say nothing of its place.
    config = dataclasses.replace(config, module_path=(*config.module_path, *folders_of(task_name(config))))
    with use_run_folder(config) as folder, watch_signals() as signals:
        code = executed_code(config) if (folder / VERSIONS).exists() else None
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
            prepared = _prepare(config.resolved(), kind, folder, code, journal, signals, say)
            tracker = start_tracking(config, folder)
            summary = _carry_out(prepared, tracker, say)
        except BaseException as error:
            if is_new and journal.doing == PREPARATION and isinstance(error, SegarError):
                shutil.rmtree(folder)  # nothing was trained, and the error says what to mend
                raise
            journal.end(error)
            tracker.finish("KILLED" if isinstance(error, KeyboardInterrupt | SystemExit) else "FAILED")
            raise
        journal.end()
        tracker.finish("FINISHED", files_of(folder))
    say(_closing_lines(config, folder, summary))
    return RunResult(folder, summary, trained=True)


def _check_names(config: RunConfig) -> None:
    """Raises :class:`ConfigError` if the levels, the task or the observation cannot be made; levels may define what the others
    name, so they are first."""
    for which in ("train", "test"):
        distribution_of(config.levels, which)
    environment_options(config)


def _prepare(
    config: RunConfig,
    kind: type[Learner],
    folder: Path,
    code: Mapping[str, str] | None,  # None: not computed yet
    journal: Journal,
    signals: SignalMonitor,
    say: Callable[[str], None],
) -> Prepared:
    if config.levels.is_endless:
        stream_of(config.levels)  # which says what is wrong with levels that end
    train, test = make_levels(config.levels)
    chosen = training_levels(kind, config, train, test)
    env = make_environment(kind, config, train, train) if chosen is None else chosen.env
    check_observations(config, train, test)
    for name in check_results(config, train, test):
        say(
            f"warning: the task's result '{name}' is several numbers per environment: the files of episodes hold it, and tables"
            " and claims have no column of it. Give each number a result of its own, such as lambda factors: ...[:, 0]"
        )
    task = environment_options(config)["task"]
    if not task.functions().reward:
        say(
            f"warning: the task {task.name} has no reward function: all rewards are 0, and an agent learns nothing by them"
        )
    if config.takes_no_step():
        rollout = config.algorithm.num_envs * config.algorithm.num_steps  # type: ignore[attr-defined]
        say(
            f"warning: the agent stays untrained: {config.scale.frames:,} frames are one rollout ({rollout:,} frames) or less,"
            f" and algorithm.anneal lowers the learning rate to 0 in the last one. Give scale.frames={2 * rollout} or more, or"
            " algorithm.anneal=false"
        )
    large = large_numbers(config, train)
    if large:
        say(advice(large, config))
    unseen = unseen_entities(config, train, test)
    if unseen:
        say(advice_on_entities(unseen, config, train))
    if parameters := unseen_parameters(config, train, test):
        say(advice_on_parameters(parameters, config))
    algorithm = computed_as_begun(folder, config).algorithm
    learner = make_learner(kind, algorithm, env, config.scale.frames, config.seed)
    if chosen is not None:
        chosen.connect(learner)
    for line in advice_on_trials(config, train, learner.policy):
        say(line)
    code = executed_code(config) if code is None else code
    training = Training(config, folder, learner, journal, signals, train, code, chosen)
    hashes = {"train": hash_of_levels(train), "test": hash_of_levels(test)}
    training.resume(hashes, say)
    train.save(folder / LEVELS_TRAIN)
    test.save(folder / LEVELS_TEST)
    arithmetics = _arithmetics(config, learner, folder, say)
    write_json(folder / VERSIONS, {**versions(), "code": training.code, "levels": hashes, **arithmetics})
    if is_own(config.levels.train) and (share := share_of(prints_of(test), prints_of(train))):
        say(
            f"warning: {share:.0%} of the test levels are training levels, too, so the gap says little or nothing of levels"
            " that the agent has not seen; name others: levels.test=..."
        )
    for line in unseen_by_distances(train, test, config.evaluation.distances):
        say(line)
    return Prepared(training, train, test, env)


def _carry_out(prepared: Prepared, tracker: Tracker, say: Callable[[str], None]) -> dict[str, Any]:
    training, train, test = prepared.training, prepared.train, prepared.test
    config, folder, learner, journal = training.config, training.folder, training.learner, training.journal
    journal.doing = "training"
    tracker.begin(training.history.rows)
    try:
        training.train(test)
    except TrainingError:
        with suppress(RunFolderError):  # the figures before the error help to explain it; a resumed run drops them
            training.history.write(folder)
        raise
    journal.doing = "evaluation"
    began = time.perf_counter()
    episodes = evaluate_run(learner.policy, config, train, test)
    for line in without_number(episodes):
        say(line)
    distances = distance_figures(train, test, config.evaluation.distances)
    final = {**evaluation_figures(episodes), **distances, **diversity_figures(train, test)}
    if training.chosen is not None:
        final |= training.chosen.finish(learner.frames)
        training.write_played()
    evaluation_seconds = time.perf_counter() - began
    training.history.log(final, learner.frames, training.seconds)
    write_rows(folder / EPISODES, episodes, EPISODE_SCHEMA)
    training.history.write(folder)
    took = {"seconds": training.seconds, "evaluation_seconds": evaluation_seconds}
    played = {
        row["name"]: row["value"] for row in training.history.rows if row["name"].startswith("played/")
    }  # the last ones
    summary = {"label": config.label(), "frames": learner.frames, **took, **final, **played}
    write_json(folder / SUMMARY, summary)
    prepared.env.close()
    return summary


def _arithmetics(config: RunConfig, learner: Learner, folder: Path, say: Callable[[str], None]) -> dict[str, Any]:
    """What decides the last bits of the run, now and, where that was something else, before it was resumed."""
    now, here = arithmetic(computed_as_begun(folder, config)), arithmetic(config)["precision"]
    if now["precision"] != here:
        say(
            f"{config.label()}: goes on in {now['precision']}, in which it was begun, although algorithm.precision=auto means"
            f" {here} on this machine"
        )
    before = read_versions(folder) if learner.frames and (folder / VERSIONS).exists() else {}
    earlier, last = before.get("arithmetic_before", []), before.get("arithmetic")
    if last is not None and last != now:
        earlier = [*earlier, last]
        differs = (
            "" if config.determinism == "portable" else "; in the last bits, its weights are those of no single machine"
        )
        say(f"{config.label()}: computed with {in_words(last)} so far, and now with {in_words(now)}{differs}")
    return {"arithmetic": now, **({"arithmetic_before": earlier} if earlier else {})}


def training_levels(kind: type[Learner], config: RunConfig, train: Levels, test: Levels) -> TrainingLevels | None:
    """What chooses the levels of a run; None where its environments draw from all training levels alike."""
    if settings_of(config) is None:
        return None

    def make_trial_env(levels: Levels, number: int) -> VectorEnv:
        options = {**environment_options(config, number, train), "trials": 1}
        return VectorEnv(levels, number, seed=config.seed, autoreset_mode="Disabled", **options)

    return TrainingLevels(
        config, lambda levels: make_environment(kind, config, levels, train), make_trial_env, train, test
    )


def make_environment(kind: type[Learner], config: RunConfig, levels: Levels, train: Levels) -> Any:
    """The environments that a learner wants, on these levels; what is observed may depend on ``train``."""
    make_env, num_envs = getattr(kind, "make_env", TorchRLEnv), config.algorithm.num_envs
    options = environment_options(config, num_envs, train)
    is_on_gpu = getattr(config.algorithm, "env_device", "cpu") == "cuda"
    if is_on_gpu:
        options["device"] = config.algorithm.device  # type: ignore[attr-defined]
    try:
        return make_env(levels, num_envs, seed=config.seed, **options)
    except RuleError as error:
        if train.task in (None, task_name(config)):
            raise
        raise ConfigError(
            f"task: the levels of {config.levels.train} are for task={train.task}, and {config.task.name} does not fit: {error}"
        ) from error
    except SegarError as error:
        if not is_on_gpu:
            raise
        raise ConfigError(
            f"algorithm.env_device: environments cannot run on the GPU ({error}); algorithm.env_device=cpu runs them on the"
            " processor"
        ) from error


def _closing_lines(config: RunConfig, folder: Path, summary: Mapping[str, Any]) -> str:
    speed = summary["frames"] / max(summary["seconds"], 1e-9)
    lines = [f"{config.label()}: {summary['frames']:,} frames in {summary['seconds']:.0f} s ({speed:,.0f} frames/s)"]
    lines.append(f"  task                        {task_name(config)}")
    lines += [f"  {name:<27} {summary[key]:8.3f}" for key, name in SHOWN.items() if key in summary]
    lines += [f"  W2, {key[3:]:<23} {value:8.3f}" for key, value in summary.items() if key.startswith("w2/")]
    lines.append(f"  computed with               {computed_with(read_versions(folder))}")
    return "\n".join([*lines, f"  run folder                  {folder}"])
