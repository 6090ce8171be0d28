"""A trained agent on any levels: what it achieves there beside players without training, and videos of it."""

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

from segar.cli import table
from segar.envs import VectorEnv, play
from segar.errors import RuleError, SegarError
from segar.evaluation import QUANTITIES, Baselines, Idle, find_baselines
from segar.experiments.algorithms.checkpoint import load_newest_policy
from segar.experiments.algorithms.learner import PolicyNetwork
from segar.experiments.algorithms.portable import PortableAgent, network_of
from segar.experiments.collection.collector import observation_shape
from segar.experiments.commands import process_defaults as runtime
from segar.experiments.evaluation.causes import CAUSES, play_twins, suite_played
from segar.experiments.evaluation.episodes import Agent, action_rng, as_policy, play_in_modes, trial_figures
from segar.experiments.evaluation.transfers import LEVELS, OWN
from segar.experiments.levels.builders import Prepared, find_distribution, in_own_world, levels_in
from segar.experiments.levels.suite_levels import levels_of_suite
from segar.experiments.runs.executed_code import changed_parts, code_after, differing_parts, executed_code, played_code
from segar.experiments.runs.files import absolute_path, make_folder
from segar.experiments.runs.own_modules import names_in, where_searched
from segar.experiments.runs.run_folder import (
    CONFIG,
    EPISODE_SCHEMA,
    EPISODES,
    EVALUATIONS,
    LEVELS_TRAIN,
    SUMMARY,
    computed_as_begun,
    read_config,
    read_evaluation,
    write_json,
    write_rows,
)
from segar.experiments.settings import (
    ConfigError,
    EvaluateConfig,
    LevelsConfig,
    RunConfig,
    RunFolderError,
    as_data,
    import_object,
    is_level_file,
    without_files,
)
from segar.levels import Levels, hash_of_levels
from segar.policies import NETWORK_FILE, Network
from segar.rendering import View, check_video, write_video
from segar.suites import twins, write_causes
from segar.support import counted, named_object

COUNT = 100  # levels of a distribution, where the number is not given
VIEW = View(size=384)  # of videos
GAIN = "adaptation_gain_return"  # a figure of several trials


@dataclass(frozen=True)
class RunEvaluation:
    """The results: one row per episode, the figures of each player, and the folder that holds them."""

    episodes: Sequence[Mapping[str, Any]]
    summary: Mapping[str, Any]
    folder: Path


def evaluate(config: EvaluateConfig, say: Callable[[str], None] = print) -> RunEvaluation:
    """Plays the levels, writes the results, and prints a table.

    Raises:
        SegarError: there is no such run or level set, or the agent cannot observe these levels; the message says why.
    """
    runtime.set_process_defaults()
    if config.videos != "none":
        check_video(Path(f"best.{config.videos}"))
    folder = absolute_path(config.run)
    if config.out and (absolute_path(config.out) / CONFIG).exists():
        raise ConfigError(f"out: {config.out} holds a run, whose results would be replaced; name another folder")
    found = read_config(folder, config.trusted)
    trained = dataclasses.replace(found, num_threads=config.num_threads)
    import_named(trained)
    changed = [part for part in changed_parts(folder, executed_code(Prepared(trained))) if part != "learner"]
    if changed:
        say(
            f"note: the run was made by other code; changed since: {', '.join(changed)}. These episodes are played by today's"
        )
    levels = find_levels(config, folder, trained)
    with_twins = suite_played(config, trained, levels) if config.twins else None
    code = {**played_code(Prepared(played(config, trained))), "levels": hash_of_levels(levels)}
    policy: Any  # of the run, or of its network as portable data
    policy, frames = load_agent(folder, trained, levels, say, found)
    options, network = options_of(folder, trained, config.levels, config.split), None
    env = VectorEnv(levels, 1, seed=0, **options)
    if config.portable:
        network = network_of(policy, observation_shape(env), options["task"])
        policy = PortableAgent(network, config.num_threads)
    repeated = config.episodes if env.is_random else 1
    rounds = {"deterministic": repeated, "sampled": config.episodes}
    rows = [
        row
        for mode in config.modes
        for row in play_in_modes(policy, config.levels, levels, options, config.seed, (mode,), rounds[mode])
    ]
    baselines = find_baselines(
        levels, options["task"], rng=np.random.default_rng(config.seed), seed=config.seed,
        samples=config.planner_samples, iterations=config.planner_iterations, num_threads=config.num_threads,
    ) if config.scores else None  # fmt: skip
    idle = play_in_modes(Idle(), config.levels, levels, options, config.seed, ("deterministic",), rounds=repeated)
    players = {mode: figures([row for row in rows if row["action_mode"] == mode], baselines) for mode in config.modes}
    players["no-op"] = figures(idle, baselines)
    summary = {"run": str(folder), "frames": frames, "levels": origin(config, levels), "players": players}
    summary["portable"] = config.portable
    summary["changed_code"] = changed  # parts of the code that are others than when the agent was trained
    if baselines is not None:
        summary["anchors"] = {name: float(getattr(baselines, name).mean()) for name in ("random", "floor", "oracle")}
        sizes = ("planner_samples", "planner_iterations")
        summary["planner"] = {name: getattr(config, name) for name in sizes}
    summary["code"] = code_after(code, say)
    out = absolute_path(config.out) if config.out else folder / EVALUATIONS / label(config, levels)
    before = (read_evaluation(out) or {}).get("code")
    if before is not None and (replaced := differing_parts(before, code)):
        say(f"note: an evaluation by other code lay there, and is replaced; changed since: {', '.join(replaced)}")
    write(out, levels, rows, summary, network)
    say(as_table(f"{folder.name} after {frames:,} frames, on {described(config, levels)}:", players, baselines))
    for line in scores_above_1(players, len(levels), config):
        say(line)
    if with_twins is not None:
        made = twins(with_twins, n=None if config.n is None else min(config.n, len(with_twins.test_levels)))
        causes = play_twins(
            policy, made, partial(options_of, folder, trained, with_twins.name), config.modes, config.seed
        )
        write_causes(out / CAUSES, [{"action_mode": mode, **row} for mode, one in causes.items() for row in one.rows()])
        for mode, found_causes in causes.items():
            say(f"{mode} actions, {found_causes}")
    if config.videos != "none":
        say(make_videos(out, config, policy, levels, options, rows))
    say(f"results: {out}")
    return RunEvaluation(rows, summary, out)


def import_named(trained: RunConfig) -> None:
    """Imports the modules that the settings of a run name, which define the entities in its level files; raises
    :class:`ConfigError` that says where they were looked for."""
    for place, name in names_in(as_data(trained)):
        try:
            named_object(str(name))
        except SegarError as error:
            raise ConfigError(f"run: {place}: {error}{where_searched(error.__cause__, trained.module_path)}") from error


def played(config: EvaluateConfig, trained: RunConfig) -> RunConfig:
    """The settings of the run, with the distribution that is played in place of its own, where one is named."""
    if config.levels in OWN or is_level_file(config.levels):
        return trained
    name = without_files(config.levels, "levels")
    task = dataclasses.replace(trained.task, name=Prepared(trained).task_name)
    return dataclasses.replace(trained, levels=LevelsConfig(train=name, test=name), task=task)


def find_levels(config: EvaluateConfig, folder: Path, trained: RunConfig) -> Levels:
    """The levels that ``config`` names; raises :class:`SegarError` if there are none, or fewer than asked for."""
    name = config.levels
    if of_suite := levels_of_suite(name, config.split, "levels"):
        return of_suite.sample(
            config.n or (COUNT if config.split == "train" else len(of_suite.suite.test_levels)), config.seed
        )
    if name not in OWN and not is_level_file(name):
        return find_distribution(name, "levels").sample(config.n or COUNT, seed=config.seed, split=config.split)
    if name in OWN:
        path = folder / OWN[name]
        if not path.exists():
            raise RunFolderError(f"the run in {folder} has no levels yet: there is no {path.name}")
        levels = in_own_world(Levels.load(path), trained.levels, name)
    else:
        levels = levels_in(Path(name).expanduser(), config.world, "levels", "world")
    if config.n is not None and config.n > len(levels):
        raise ConfigError(f"n: {name} has {len(levels)} levels, not {config.n}")
    return levels if config.n is None else levels[: config.n]


def load_agent(
    folder: Path, trained: RunConfig, levels: Levels, say: Callable[[str], None], recorded: RunConfig | None = None
) -> tuple[PolicyNetwork, int]:
    """The run's policy for these levels, and the frames that it was trained for.

    Args:
        trained: the settings by which it plays.
        recorded: those in the run folder; ``say`` gets a note if the weights were made by others. None: do not compare.

    Raises:
        ConfigError: what it would observe in these levels is not what it was trained to observe.
        CheckpointError: there are no weights, or they are damaged.
    """
    options, train = options_of(folder, trained), training_levels(folder)
    shape = shape_in(levels, trained, options)
    known = shape if train is None else shape_in(train, trained, options)
    if shape != known:
        raise ConfigError(
            f"levels: the agent of {folder.name} observes arrays of shape {known}; in these levels "
            f"'{trained.observation.name}' gives {shape}. A state vector depends on the entities that there can be; an agent "
            "that sees pixels can play all levels"
        )
    policy = new_policy(computed_as_begun(folder, trained), shape)
    return policy, load_newest_policy(folder, policy, say, recorded)


def as_played(run: str | Path, levels: str = "test") -> dict[str, Any]:
    """What :func:`segar.datasets.record` needs to record the agent of a run folder, which acts without noise.

    Returns:
        ``levels``, with the run's rules; ``policy``; and all options of the environments in which it was trained, among them
        ``unit_actions=True``, because agents act in [-1, 1].

    Args:
        levels: as :class:`segar.experiments.settings.EvaluateConfig` has them.

    Raises:
        SegarError: there is no such run or level set, no weights, or the agent cannot observe these levels.
    """
    folder = absolute_path(run)
    trained = read_config(folder)
    import_named(trained)
    found = find_levels(EvaluateConfig(str(folder), levels=levels), folder, trained)
    agent, _ = load_agent(folder, trained, found, print)
    return {"levels": found, "policy": as_policy(agent, None), **options_of(folder, trained, levels)}


def new_policy(trained: RunConfig, observation_shape: tuple[int, ...]) -> Any:
    """The run's policy, a :class:`segar.experiments.algorithms.learner.PolicyNetwork` and ``nn.Module``, without weights."""
    learner = import_object(trained.algorithm.learner, "algorithm")
    return learner.make_policy(trained.algorithm, observation_shape, len(Prepared(trained).task.action_low))


def options_of(folder: Path, trained: RunConfig, levels: str = "train", split: str = "test") -> dict[str, Any]:
    """Options of the environments in which a run's agent plays any levels: it observes them as it did in training.

    Args:
        levels: ``"test"`` for the run's own test levels, which look different in suites of textures; or the name of a suite,
            which says what is played, and what is seen of the levels of this split.
    """
    which = levels
    if levels_of_suite(levels, split, "levels") is not None:
        which, trained = split, dataclasses.replace(trained, levels=dataclasses.replace(trained.levels, train=levels))
    return Prepared(trained).env_options(train=training_levels(folder), which="test" if which == "test" else "train")


def training_levels(folder: Path) -> Levels | None:
    """The levels that the run's agent was trained on; None where it has none yet."""
    path = folder / LEVELS_TRAIN
    return Levels.load(path) if path.exists() else None


def shape_in(levels: Levels, trained: RunConfig, options: Mapping[str, Any]) -> tuple[int, ...]:
    """The shape of what the run's agent observes in these levels."""
    try:
        return observation_shape(VectorEnv(in_own_world(levels, trained.levels, "train"), 1, seed=0, **options))
    except RuleError as error:
        reason = str(error).partition("; choose the task")[0]
        raise ConfigError(
            f"levels: the agent plays the task {options['task'].name} that it was trained on, and these levels do not fit it:"
            f" {reason}. Name levels on which that task can be played"
        ) from error


def figures(rows: Sequence[Mapping[str, Any]], baselines: Baselines | None) -> dict[str, float]:
    """Means over episodes, the standard error of the mean return over levels, the normalised score, the regret, and on how
    many levels the mean return is above the best known one."""
    means = {name: float(np.mean([row[name] for row in rows])) for name in QUANTITIES}
    by_level = mean_returns(rows)
    of_levels = list(by_level.values())
    error = float(np.std(of_levels, ddof=1) / np.sqrt(len(of_levels))) if len(of_levels) > 1 else float("nan")
    found = {**means, "return_error": error, **trial_figures(rows)}
    if baselines is None:
        return found
    above = sum(value > baselines.oracle[level] for level, value in by_level.items())
    return {
        **found,
        "score": float(baselines.normalised(means["return"])),
        "regret": float(baselines.regret(means["return"])),
        "above_best_known": int(above),
    }


def scores_above_1(players: Mapping[str, Mapping[str, float]], levels: int, config: EvaluateConfig) -> list[str]:
    """A line for each player whose score is above 1, with the settings of a larger search."""
    larger = f"planner_samples={4 * config.planner_samples} planner_iterations={2 * config.planner_iterations}"
    return [
        f"note: {name} beats the best known return on {player['above_best_known']} of {levels} levels (score"
        f" {player['score']:.2f}). The planner that finds it is a search, not an optimum; enlarge it: {larger}"
        for name, player in players.items()
        if player.get("score", 0.0) > 1.0
    ]


def mean_returns(rows: Sequence[Mapping[str, Any]]) -> dict[int, float]:
    """The mean return on each level, by index of the level."""
    returns: dict[int, list[float]] = {}
    for row in rows:
        returns.setdefault(row["level"], []).append(row["return"])
    return {level: float(np.mean(values)) for level, values in returns.items()}


def write(
    out: Path,
    levels: Levels,
    rows: Sequence[Mapping[str, Any]],
    summary: Mapping[str, Any],
    network: Network | None = None,
) -> None:
    """Writes levels, episodes, summary, and the network that played where it is portable; raises :class:`SegarError` if that is
    impossible."""
    make_folder(out)
    for name in (SUMMARY, CAUSES, NETWORK_FILE):  # of an evaluation that is replaced; a summary belongs to the others
        (out / name).unlink(missing_ok=True)
    levels.save(out / LEVELS)
    if network is not None:
        network.save(out / NETWORK_FILE)
    write_rows(out / EPISODES, rows, EPISODE_SCHEMA)
    write_json(out / SUMMARY, summary)


def make_videos(
    out: Path,
    config: EvaluateConfig,
    policy: Agent,
    levels: Levels,
    options: Mapping[str, Any],
    rows: Sequence[Mapping[str, Any]],
) -> str:
    """Records videos of the best, the median and the worst level; returns lines that name them."""
    mode = config.modes[0]
    chosen = choose_levels([row for row in rows if row["action_mode"] == mode])
    lines = []
    for name, (level, value) in chosen.items():
        path = out / f"{name}.{config.videos}"
        record_video(path, policy, levels, level, options, rng=action_rng(mode, config.seed), seed=config.seed)
        lines.append(f"  {path.name:<11} level {level}, return {value:.2f}")
    return "\n".join([f"videos, {mode} actions:", *lines])


def record_video(
    path: Path,
    policy: Agent,
    levels: Levels,
    level: int,
    env_options: Mapping[str, Any],
    *,
    rng: torch.Generator | None,
    seed: int,
) -> int:
    """Record one episode of a policy on a level, or all trials; return the number of frames.

    Args:
        path: ends in .mp4 or .gif.
        rng: source of sampled actions; None plays the deterministic policy.
        seed: of the environment, for physics that is random.

    Raises:
        SegarError: the extra ``render`` is not installed, or the file cannot be written.
    """
    trials = env_options.get("trials", 1)
    mode = "Disabled" if trials == 1 else "SameStep"
    env = VectorEnv(levels, 1, seed=seed, autoreset_mode=mode, render_mode="rgb_array", view=VIEW, **env_options)

    def frames() -> Iterator[np.ndarray]:
        start = env.reset(seed=seed, options={"levels": np.array([level])})
        for now in play(env, as_policy(policy, rng), start, trials):
            images = env.render()
            assert images is not None  # the render mode is rgb_array
            if trials == 1 or now.running.all():  # after the last trial the next level is there
                yield images[0]

    try:
        return write_video(path, frames(), env.metadata["render_fps"])
    finally:
        env.close()


def choose_levels(rows: Sequence[Mapping[str, Any]]) -> dict[str, tuple[int, float]]:
    """Of the best, the median and the worst level: its index and its mean return."""
    ranked = sorted(mean_returns(rows).items(), key=lambda pair: pair[1])
    return {"best": ranked[-1], "median": ranked[len(ranked) // 2], "worst": ranked[0]}


def origin(config: EvaluateConfig, levels: Levels) -> dict[str, Any]:
    """Which levels they are, as plain data."""
    made = levels.provenance
    stored = {name: getattr(made, name) for name in ("name", "seed", "split", "distribution")}
    return {"asked": config.levels, "n": len(levels), **stored}


def label(config: EvaluateConfig, levels: Levels) -> str:
    """The name of the folder of results, e.g. ``objectsx3-hard-test-n100-s0``; the same however a path is spelled."""
    made, asked = levels.provenance, config.levels
    if asked in OWN:
        name = f"{asked}-n{len(levels)}"
    elif is_level_file(asked):
        name = f"{Path(asked).stem}-n{len(levels)}"
    else:
        name = f"{without_files(asked, 'levels')}-{made.split}-n{len(levels)}-s{made.seed}"
    name += "-portable" if config.portable else ""
    return "".join(c if c.isalnum() or c in "_-." else "_" for c in name)


def described(config: EvaluateConfig, levels: Levels) -> str:
    """Which levels they are, and whether torch computes the actions, for people."""
    how = " (portable)" if config.portable else ""
    if config.levels in OWN:
        return f"its own {counted(len(levels), f'{config.levels} level')}{how}"
    more = "" if is_level_file(config.levels) else f" (split {config.split}, seed {config.seed})"
    return f"{counted(len(levels), 'level')} of {config.levels}{more}{how}"


def as_table(title: str, players: Mapping[str, Mapping[str, float]], baselines: Baselines | None) -> str:
    """One line per player: mean return and its error, success, death, with several trials the adaptation gain of the return,
    score, regret."""
    gain = (GAIN,) if any(GAIN in player for player in players.values()) else ()
    scores = ("score", "regret") if baselines is not None else ()
    shown = ("return", "return_error", "success", "death", *gain, *scores)
    rows = [[name, *(player[key] for key in shown)] for name, player in players.items()]
    if baselines is not None:
        ends = {"random": baselines.random, "floor": baselines.floor, "best known": baselines.oracle}
        for name, returns in ends.items():
            value = float(returns.mean())
            nothing = [None] * (len(shown) - 3)
            rows.append([name, value, *nothing, baselines.normalised(value), baselines.regret(value)])
    head = ["", "return", "± error", *("gain" if key == GAIN else key for key in shown[2:])]
    return f"{title}\n{table(head, rows)}"
