"""Frames for probes: a fixed number of them, of all relevant factors, each with what is true at that very moment."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch

from segar.analysis.probes.pairs import NAME_OF_TYPE, Column, Frames
from segar.analysis.tables import Floats, Ints
from segar.envs import VectorEnv, play
from segar.errors import LevelError
from segar.evaluation import Random
from segar.experiments.algorithms.learner import PolicyNetwork
from segar.experiments.evaluation.episodes import Agent, action_rng, as_policy
from segar.experiments.evaluation.evaluator import load_agent, options_of
from segar.experiments.evaluation.transfers import OWN
from segar.experiments.levels.builders import distribution_of
from segar.experiments.runs.run_folder import read_config
from segar.language import Factor, GlobalFriction
from segar.levels import Levels
from segar.metrics import component, relevant_factors
from segar.noise import Choice, Noise

FRAMES = 5000
ENVS = 128  # episodes that are played at once
SCOUTS, SCOUT_STEPS, SCOUT_SEED = 256, 100, 0  # random play in which it shows what varies, and what changes
PAPER_FACTORS = ("Charge", "Magnetism", "Position.x", "Position.y", "Friction")  # of the 20 x 5 matrix of 2022


def collect_run(
    folder: Path | str,
    levels: str = "test",
    *,
    frames: int = FRAMES,
    num_envs: int = ENVS,
    mode: str = "deterministic",
    seed: int = 0,
) -> tuple[PolicyNetwork, Frames]:
    """The policy of a run, and the frames that it sees on levels.

    Args:
        folder: the run's.
        levels: "train" or "test", the run's own.
        mode: "deterministic" or "sampled" actions.

    Raises:
        SegarError: there is no such run, or no weights in it, or its agent cannot observe these levels.
    """
    folder = Path(folder).expanduser().resolve()
    trained = read_config(folder)
    if levels not in OWN:
        raise LevelError(f"levels must be 'train' or 'test', not '{levels}'")
    distribution = distribution_of(trained.levels, levels)
    played = dataclasses.replace(Levels.load(folder / OWN[levels]), world=distribution.world)
    policy, _ = load_agent(folder, trained, played, lambda line: None)
    options = options_of(folder, trained, levels)
    columns = varying_columns(distribution, {"task": options["task"]})
    found = collect(
        policy, played, columns, options, frames=frames, num_envs=num_envs, rng=action_rng(mode, seed), seed=seed
    )
    return policy, found


def collect(
    agent: Agent,
    levels: Levels,
    columns: Sequence[Column],
    options: Mapping[str, Any],
    *,
    frames: int = FRAMES,
    num_envs: int = ENVS,
    rng: torch.Generator | None = None,
    seed: int = 0,
) -> Frames:
    """Exactly ``frames`` frames of episodes that ``agent`` plays, level after level, as often as it takes.

    An agent that solves its levels in five steps gives as many frames as one that never does: it plays more episodes.

    Args:
        columns: which factors, see :func:`varying_columns`.
        options: of :class:`segar.envs.VectorEnv`.
        num_envs: episodes at once; at least that many are begun.
        rng: of sampled actions; None plays the deterministic policy.
        seed: of the environments, and of the order of levels.
    """
    if frames < 1:
        raise LevelError(f"frames must be at least 1, not {frames}")
    env = VectorEnv(levels, num_envs, seed=seed, **options)
    order = np.random.default_rng(seed)
    parts: list[dict[str, Any]] = []
    have, begun, queue = 0, 0, np.zeros(0, np.int64)
    while have < frames:
        while len(queue) < num_envs:
            queue = np.concatenate([queue, order.permutation(len(levels))])
        chosen, queue = queue[:num_envs], queue[num_envs:]
        wave = play_wave(agent, env, chosen, columns, rng, frames - have, begun)
        have, begun = have + sum(len(part["step"]) for part in wave), begun + num_envs
        parts += wave
    env.close()
    arrays = {name: np.concatenate([part[name] for part in parts])[:frames] for name in parts[0]}
    return Frames(columns=tuple(columns), **arrays)


def play_wave(
    agent: Agent,
    env: VectorEnv,
    levels: Ints,
    columns: Sequence[Column],
    rng: torch.Generator | None,
    enough: int,
    first_episode: int,
) -> list[dict[str, Any]]:
    """One episode in each environment, on the level that ``levels`` names, until all end or there are ``enough`` frames.

    Returns:
        for each step, the arrays of :class:`segar.analysis.probes.pairs.Frames` that it adds, by name.
    """
    parts: list[dict[str, Any]] = []
    observation, factors, frames = np.zeros(0), np.zeros(0), 0
    for now in play(env, as_policy(agent, rng), env.reset(options={"levels": levels})):
        # Where an episode ended, this is the first state of the next one already: "late" means what it meant in 2022.
        later = read_columns(env, columns)
        rows = np.flatnonzero(now.played)
        if len(rows):
            parts.append(
                {
                    "observation": observation[rows],
                    "factors": factors[rows],
                    "late": later[rows],
                    "episode": first_episode + rows,
                    "level": levels[rows],
                    "step": np.full(len(rows), now.time - 1),
                }
            )
        observation, factors, frames = now.observation, later, frames + len(rows)
        if frames >= enough:
            break
    return parts


def read_columns(env: VectorEnv, columns: Sequence[Column]) -> Floats:
    """The true factors of all environments, float64 ``[num_envs, k]``."""
    state, levels = env.state().state, env.levels
    out = np.empty((env.num_envs, len(columns)))
    for k, column in enumerate(columns):
        if column.slot == "world":
            names = [parameter.__name__ for parameter in levels.layout.parameters]
            out[:, k] = levels.parameters[state.level, names.index(column.factor)]
            continue
        slot = levels.layout.slot_index(column.slot)
        if column.factor == NAME_OF_TYPE:
            kind = levels.types[state.level, slot]
            out[:, k] = np.where(kind < 0, np.nan, kind)
        else:
            name, _, axis = column.factor.partition(".")
            first = levels.layout.by_name[name][1]
            out[:, k] = state.values[:, slot, first + (axis == "y")]
    return out


def varying_columns(distribution: Any, options: Mapping[str, Any] | None = None) -> tuple[Column, ...]:
    """Every factor, type and world parameter that varies under a level distribution: the same set for any sample of it.

    Found out by random play on 256 of its levels: what differs there between two states counts, and what never changed
    within an episode is static. What only tells how things are drawn, or follows from others, is left out, as distances
    between level sets leave it out (:data:`segar.metrics.points.IRRELEVANT`).
    """
    levels = distribution.sample(SCOUTS, seed=SCOUT_SEED, split="train")
    known = all_columns(distribution, levels)
    options = {**(options or {}), "observation": "state"}
    found = collect(Random(SCOUT_SEED), levels, known, options, frames=SCOUTS * SCOUT_STEPS, num_envs=SCOUTS)
    varied = []
    for k, column in enumerate(known):
        x = found.factors[:, k]
        there = np.isfinite(x)
        if not there.any() or np.ptp(x[there]) == 0:
            continue
        first = np.full(found.episode.max() + 1, np.nan)
        first[found.episode[found.step == 0]] = x[found.step == 0]
        static = np.array_equal(x, first[found.episode], equal_nan=True)
        varied.append(dataclasses.replace(column, is_static=static))
    return tuple(varied)


def all_columns(distribution: Any, levels: Levels) -> list[Column]:
    """Every relevant factor component of every slot, the type where several may fill a slot, and world parameters."""
    laws = distribution.marginals()
    columns = []
    for slot in levels.layout.slots:
        if all(issubclass(kind, GlobalFriction) for kind in slot.types):
            continue
        if len(slot.types) > 1:
            columns.append(Column(slot.name, NAME_OF_TYPE, True, law=type_law(distribution, levels, slot.name)))
        factors = dict.fromkeys(factor for kind in slot.types for factor in relevant_factors(kind))
        for factor in factors:
            law = laws.get(slot.name, {}).get(factor)
            columns += [Column(slot.name, name, law=part) for name, part in components(factor, law)]
    for parameter in levels.layout.parameters:
        columns.append(Column("world", parameter.__name__, law=laws["parameters"].get(parameter)))
    return columns


def components(factor: type[Factor], law: Noise | None) -> list[tuple[str, Noise | None]]:
    """Name and law of each number of a factor."""
    if factor.width == 1:
        return [(factor.__name__, law)]
    return [(f"{factor.__name__}.{axis}", law and component(law, k)) for k, axis in enumerate("xy")]


def type_law(distribution: Any, levels: Levels, name: str) -> Noise:
    """The law of the number of the type that fills a slot, given that it is filled."""
    for group in distribution.plan.groups:
        if name in [levels.layout.names[slot] for slot in group.slots]:
            return Choice([float(kind) for kind in group.types], list(group.probabilities))
    raise LevelError(f"no entry of numbers fills '{name}'")
