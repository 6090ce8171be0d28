"""A trained agent on any levels: what it achieves there, between chance and the oracle, and how that looks."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from experiments.algorithms.checkpoint import load_newest_policy
from experiments.collection.collector import observation_shape
from experiments.commands import process_defaults as runtime
from experiments.evaluation.baselines import Anchors, IdleAgent, find_anchors
from experiments.evaluation.episodes import QUANTITIES, play
from experiments.evaluation.videos import film
from experiments.levels.builders import distribution_of, environment_options, find_distribution
from experiments.runs.run_folder import (
    EPISODE_SCHEMA,
    EPISODES,
    EVALUATIONS,
    LEVELS_TEST,
    LEVELS_TRAIN,
    SUMMARY,
    read_config,
    write_json,
    write_rows,
)
from experiments.settings import ConfigError, EvaluateConfig, RunConfig, RunFolderError, import_object
from segar.cli.arguments import load_levels, table
from segar.envs import VectorEnv
from segar.levels import Levels

COUNT = 100  # levels of a distribution, where the number is not given
LEVELS = "levels.npz"
OWN = {"train": LEVELS_TRAIN, "test": LEVELS_TEST}  # the run's own level sets


@dataclass(frozen=True)
class Evaluation:
    """What came of it: one row per episode, the figures of each player, and where it lies."""

    episodes: Sequence[Mapping[str, Any]]
    summary: Mapping[str, Any]
    folder: Path


def evaluate(config: EvaluateConfig, say: Callable[[str], None] = print) -> Evaluation:
    """Plays the levels, writes what comes of it, and prints a table.

    Raises:
        SegarError: there is no such run or level set, or the agent cannot observe these levels; the message says why.
    """
    runtime.set_process_defaults()
    folder = Path(config.run).expanduser().resolve()
    trained = dataclasses.replace(read_config(folder), num_threads=config.num_threads)
    levels = find_levels(config, folder, trained)
    policy, frames = load_agent(folder, trained, levels, say)
    options = environment_options(trained)
    rows = play_levels(policy, levels, options, config)
    anchors = find_anchors(
        levels, options["task"], rng=np.random.default_rng(config.seed), num_threads=config.num_threads
    ) if config.scores else None  # fmt: skip
    idle = play(IdleAgent(), levels, np.arange(len(levels)), options, rng=None, seed=config.seed)
    players = {mode: figures([row for row in rows if row["action_mode"] == mode], anchors) for mode in config.modes}
    players["no-op"] = figures(idle, anchors)
    summary = {"run": str(folder), "frames": frames, "levels": origin(config, levels), "players": players}
    if anchors is not None:
        summary["anchors"] = {"random": anchors.random, "oracle": anchors.oracle}
    out = Path(config.out).expanduser().resolve() if config.out else folder / EVALUATIONS / label(config, levels)
    write(out, levels, rows, summary)
    say(as_table(f"{folder.name} after {frames:,} frames, on {described(config, levels)}:", players, anchors))
    if config.videos != "none":
        say(make_videos(out, config, policy, levels, options, rows))
    say(f"results: {out}")
    return Evaluation(rows, summary, out)


def find_levels(config: EvaluateConfig, folder: Path, trained: RunConfig) -> Levels:
    """The levels that ``config`` names; raises :class:`SegarError` if there are none, or fewer than asked for."""
    name = config.levels
    if name not in OWN and not name.endswith(".npz"):
        return find_distribution(name, "levels").sample(config.n or COUNT, seed=config.seed, split=config.split)
    if name in OWN:
        path = folder / OWN[name]
        if not path.exists():
            raise RunFolderError(f"the run in {folder} has no levels yet: there is no {path.name}")
        levels = Levels.load(path)
        if levels.provenance.rules:  # which a file does not hold; the run's distribution does
            levels = dataclasses.replace(levels, world=distribution_of(trained.levels, name).world)
    else:
        levels = load_levels(str(Path(name).expanduser()), config.world)
    if config.n is not None and config.n > len(levels):
        raise ConfigError(f"n: {name} has {len(levels)} levels, not {config.n}")
    return levels if config.n is None else levels[: config.n]


def load_agent(folder: Path, trained: RunConfig, levels: Levels, say: Callable[[str], None]) -> tuple[Any, int]:
    """The run's policy for these levels, and the frames that it was trained for.

    Raises:
        ConfigError: what it would observe in these levels is not what it was trained to observe.
        CheckpointError: there are no weights, or they are damaged.
    """
    shape = shape_in(levels, trained)
    known = shape_in(Levels.load(folder / LEVELS_TRAIN), trained) if (folder / LEVELS_TRAIN).exists() else shape
    if shape != known:
        raise ConfigError(
            f"levels: the agent of {folder.name} observes arrays of shape {known}; in these levels "
            f"'{trained.observation.name}' gives {shape}. A state vector depends on the entities that there can be; an agent "
            "that sees pixels can play all levels"
        )
    learner = import_object(trained.algorithm.learner, "algorithm")
    policy = learner.make_policy(trained.algorithm, shape, len(environment_options(trained)["task"].action_low))
    return policy, load_newest_policy(folder, policy, say)


def shape_in(levels: Levels, trained: RunConfig) -> tuple[int, ...]:
    """The shape of what the run's agent observes in these levels."""
    if levels.provenance.rules and levels.world is None:
        levels = dataclasses.replace(levels, world=distribution_of(trained.levels, "train").world)
    return observation_shape(VectorEnv(levels, 1, seed=0, **environment_options(trained)))


def play_levels(
    policy: Any, levels: Levels, options: Mapping[str, Any], config: EvaluateConfig
) -> list[dict[str, Any]]:
    """One episode on each level by the deterministic policy, ``config.episodes`` by the sampled one; rows as in
    ``run_folder.EPISODE_SCHEMA``, with ``config.levels`` as the name of the level set."""
    rows = []
    for mode in config.modes:
        sampled = mode == "sampled"
        indices = np.tile(np.arange(len(levels)), config.episodes if sampled else 1)
        rng = torch.Generator().manual_seed(config.seed) if sampled else None
        episodes = play(policy, levels, indices, options, rng=rng, seed=config.seed)
        rows += [{"levels": config.levels, "action_mode": mode, **episode} for episode in episodes]
    return rows


def figures(rows: Sequence[Mapping[str, Any]], anchors: Anchors | None) -> dict[str, float]:
    """Means over episodes, the standard error of the mean return over levels, and the normalised score."""
    means = {name: float(np.mean([row[name] for row in rows])) for name in QUANTITIES}
    by_level: dict[int, list[float]] = {}
    for row in rows:
        by_level.setdefault(row["level"], []).append(row["return"])
    of_levels = [np.mean(returns) for returns in by_level.values()]
    error = float(np.std(of_levels, ddof=1) / np.sqrt(len(of_levels))) if len(of_levels) > 1 else float("nan")
    score = {} if anchors is None else {"score": float(anchors.normalised(means["return"]))}
    return {**means, "return_error": error, **score}


def write(out: Path, levels: Levels, rows: Sequence[Mapping[str, Any]], summary: Mapping[str, Any]) -> None:
    """Writes levels, episodes and summary; raises :class:`SegarError` if that is impossible."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunFolderError(f"cannot make the folder {out}: {error.strerror}") from error
    levels.save(out / LEVELS)
    write_rows(out / EPISODES, rows, EPISODE_SCHEMA)
    write_json(out / SUMMARY, summary)


def make_videos(
    out: Path,
    config: EvaluateConfig,
    policy: Any,
    levels: Levels,
    options: Mapping[str, Any],
    rows: Sequence[Mapping[str, Any]],
) -> str:
    """Films the best, the median and the worst level; returns what to say of that."""
    mode = config.modes[0]
    chosen = choose_levels([row for row in rows if row["action_mode"] == mode])
    lines = []
    for name, (level, value) in chosen.items():
        path = out / f"{name}.{config.videos}"
        rng = torch.Generator().manual_seed(config.seed) if mode == "sampled" else None
        film(path, policy, levels, level, options, rng=rng, seed=config.seed)
        lines.append(f"  {path.name:<11} level {level}, return {value:.2f}")
    return "\n".join([f"videos, {mode} actions:", *lines])


def choose_levels(rows: Sequence[Mapping[str, Any]]) -> dict[str, tuple[int, float]]:
    """Of the best, the median and the worst level: its index and its mean return."""
    returns: dict[int, list[float]] = {}
    for row in rows:
        returns.setdefault(row["level"], []).append(row["return"])
    ranked = sorted(((float(np.mean(values)), level) for level, values in returns.items()), key=lambda pair: pair[0])
    places = {"best": len(ranked) - 1, "median": len(ranked) // 2, "worst": 0}
    return {name: (ranked[place][1], ranked[place][0]) for name, place in places.items()}


def origin(config: EvaluateConfig, levels: Levels) -> dict[str, Any]:
    """Which levels they are, as plain data."""
    made = levels.provenance
    return {
        "asked": config.levels,
        "n": len(levels),
        "name": made.name,
        "seed": made.seed,
        "split": made.split,
        "distribution": made.distribution,
    }


def label(config: EvaluateConfig, levels: Levels) -> str:
    """The name of the folder of results, e.g. ``objectsx3-hard-test-n100-s0``."""
    made = levels.provenance
    own = f"{config.levels}-n{len(levels)}" if config.levels in OWN else None
    drawn = f"{config.levels}-{made.split}-n{len(levels)}-s{made.seed}"
    name = own or (f"{Path(config.levels).stem}-n{len(levels)}" if config.levels.endswith(".npz") else drawn)
    return "".join(c if c.isalnum() or c in "_-." else "_" for c in name)


def described(config: EvaluateConfig, levels: Levels) -> str:
    """Which levels they are, for people."""
    if config.levels in OWN:
        return f"its own {len(levels)} {config.levels} levels"
    more = "" if config.levels.endswith(".npz") else f" (split {config.split}, seed {config.seed})"
    return f"{len(levels)} levels of {config.levels}{more}"


def as_table(title: str, players: Mapping[str, Mapping[str, float]], anchors: Anchors | None) -> str:
    """One line per player: mean return and its error, success, death, score."""
    shown = ("return", "return_error", "success", "death", *(("score",) if anchors is not None else ()))
    rows = [[name, *(player[key] for key in shown)] for name, player in players.items()]
    if anchors is not None:
        rows += [["random", anchors.random, None, None, None, 0.0], ["oracle", anchors.oracle, None, None, None, 1.0]]
    head = ["", "return", "± error", *shown[2:]]
    return f"{title}\n{table(head, rows)}"
