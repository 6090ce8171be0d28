"""What comes before the first frame of a run: environments, learner, a checkpoint to go on from, and advice."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from segar.envs import VectorEnv
from segar.envs.torchrl_env import TorchRLEnv
from segar.errors import RuleError, SegarError
from segar.experiments.algorithms.learner import Learner, make_learner
from segar.experiments.commands.signals import SignalMonitor
from segar.experiments.curricula.training_levels import TrainingLevels, settings_of
from segar.experiments.evaluation.episodes import unseen_by_distances
from segar.experiments.levels.builders import Prepared, check_observations
from segar.experiments.levels.endless import stream_of
from segar.experiments.networks.devices import arithmetic
from segar.experiments.runs.executed_code import executed_code, executed_files
from segar.experiments.runs.journal import Journal
from segar.experiments.runs.run_folder import (
    LEVELS_TEST,
    LEVELS_TRAIN,
    VERSIONS,
    computed_as_begun,
    read_versions,
    write_json,
)
from segar.experiments.runs.versions import in_words, versions
from segar.experiments.settings import ConfigError, RunConfig
from segar.experiments.training.advice import advice
from segar.experiments.training.training_loop import Training
from segar.levels import Levels, hash_of_levels


def prepare(
    prepared: Prepared,
    kind: type[Learner],
    folder: Path,
    code: Mapping[str, str] | None,  # None: not computed yet
    journal: Journal,
    signals: SignalMonitor,
    say: Callable[[str], None],
) -> Training:
    """A run that is ready to be trained, or to be trained further; ``say`` gets what an agent will not learn from.

    Raises:
        SegarError: levels, task, observation, algorithm and what the folder holds do not fit each other.
    """
    config = prepared.config
    executed_files(prepared)  # as they are now: an edit from here on is noticed, also while the kernel is compiled
    if config.levels.is_endless:
        stream_of(prepared)  # which says what is wrong with levels that end
    train, test = prepared.level_sets
    chosen = training_levels(kind, prepared)
    env = make_environment(kind, prepared, train) if chosen is None else chosen.env
    check_observations(prepared, train, test)
    algorithm = computed_as_begun(folder, config).algorithm
    learner = make_learner(kind, algorithm, env, config.scale.frames, config.seed)
    if chosen is not None:
        chosen.connect(learner)
    for line in advice(prepared, learner.policy):
        say(line)
    code = executed_code(prepared) if code is None else code
    training = Training(prepared, folder, learner, env, journal, signals, code, chosen)
    hashes = {"train": hash_of_levels(train), "test": hash_of_levels(test)}
    training.resume(hashes, say)
    train.save(folder / LEVELS_TRAIN)
    test.save(folder / LEVELS_TEST)
    arithmetics = _arithmetics(config, learner, folder, say)
    write_json(folder / VERSIONS, {**versions(), "code": training.code, "levels": hashes, **arithmetics})
    for line in unseen_by_distances(train, test, config.evaluation.distances):
        say(line)
    return training


def _arithmetics(config: RunConfig, learner: Learner, folder: Path, say: Callable[[str], None]) -> dict[str, Any]:
    """What decides the last bits of the run, now and, where that was something else, before it was resumed."""
    now, here = arithmetic(computed_as_begun(folder, config)), arithmetic(config)["precision"]
    if now["precision"] != here:
        say(
            f"{config.label()}: goes on in {now['precision']}, in which it was begun, although algorithm.precision=auto means"
            f" {here} on this machine"
        )
    before = read_versions(folder) if learner.frames else {}
    earlier, last = before.get("arithmetic_before", []), before.get("arithmetic")
    if last is not None and last != now:
        earlier = [*earlier, last]
        differs = (
            "" if config.determinism == "portable" else "; in the last bits, its weights are those of no single machine"
        )
        say(f"{config.label()}: computed with {in_words(last)} so far, and now with {in_words(now)}{differs}")
    return {"arithmetic": now, **({"arithmetic_before": earlier} if earlier else {})}


def training_levels(kind: type[Learner], prepared: Prepared) -> TrainingLevels | None:
    """What chooses the levels of a run; None where its environments draw from all training levels alike."""
    if settings_of(prepared.config) is None:
        return None

    def make_trial_env(levels: Levels, number: int) -> VectorEnv:
        options = {**prepared.env_options(number, prepared.level_sets[0]), "trials": 1}
        return VectorEnv(levels, number, seed=prepared.config.seed, autoreset_mode="Disabled", **options)

    return TrainingLevels(prepared, lambda levels: make_environment(kind, prepared, levels), make_trial_env)


def make_environment(kind: type[Learner], prepared: Prepared, levels: Levels) -> Any:
    """The environments that a learner wants, on these levels; what is observed may depend on the training levels."""
    config, train = prepared.config, prepared.level_sets[0]
    make_env, num_envs = getattr(kind, "make_env", TorchRLEnv), config.algorithm.num_envs
    options = prepared.env_options(num_envs, train)
    is_on_gpu = getattr(config.algorithm, "env_device", "cpu") == "cuda"
    if is_on_gpu:
        options["device"] = config.algorithm.device  # type: ignore[attr-defined]
    try:
        return make_env(levels, num_envs, seed=config.seed, **options)
    except RuleError as error:
        if train.task in (None, prepared.task_name):
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
