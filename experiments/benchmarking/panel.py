"""Players whose place is known beforehand: where one of them stands otherwise, the benchmark is wrong, or gamed."""

import dataclasses
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
from gymnasium.spaces import Box
from scipy.stats import betabinom, norm

from segar.envs import Policy, VectorEnv
from segar.evaluation import Idle, Random, RecordedActions, Scripted
from segar.experiments.benchmarking.drawn import LEVELS, draw, drawn_of
from segar.experiments.benchmarking.level_sets import number_of_levels
from segar.experiments.benchmarking.playing import options_of, play_each
from segar.experiments.benchmarking.row import PLAYED, RANDOM_PLAYS, Piece, Row
from segar.experiments.runs.files import read_json
from segar.experiments.runs.run_folder import write_json
from segar.metrics import cost_matrix
from segar.policies import Network, NetworkPolicy
from segar.suites import plans_on, suite

PANEL = "panel.json"
FORM = [{"player": str, "must": str, "suite": str, "drawn": float, "right": bool}]
COMMITMENT, SEED = "panel", 1  # what its levels follow from, and the seed of training levels
NOISE = 0.3  # share of random actions
SURPRISE = norm.sf(3)  # so improbable is more than this by chance


@dataclass(frozen=True)
class PanelTask:
    """One suite: the row whose network is played with noise, as of :func:`network_for`, and the file of what is found."""

    suite: str
    row: Row | None
    path: Path


def play_panel(task: PanelTask) -> None:
    """Plays the panel on a suite and writes its lines, :data:`FORM`."""
    of = suite(task.suite)
    train = of.sample(SEED)
    given = draw(of, COMMITMENT, SEED, train)
    piece, options = Piece(of.name, of.hash, SEED, {}), {"task": of.task}

    def corrected(policy: Policy, played_in: Mapping[str, Any] = options) -> float:
        return drawn_of(piece, Path(), given, play_each(given.levels, policy, played_in)).corrected

    chance, planner = given.random / (LEVELS * RANDOM_PLAYS), given.plan.solved.mean()
    by_chance = betabinom(LEVELS, given.random + 0.5, LEVELS * RANDOM_PLAYS - given.random + 0.5)  # levels solved
    most = (by_chance.isf(SURPRISE) / LEVELS - chance) / (planner - chance)
    lines = []

    def add(player: str, must: str, value: float, is_right: Any) -> None:
        lines.append({"player": player, "must": must, "suite": of.name, "drawn": value, "right": bool(is_right)})

    practised = play_each(of.test_levels, RecordedActions(of.plans.actions), options).success.all()
    nearest = plans_on(of, "train", train, SEED).actions[cost_matrix(given.levels, train).argmin(axis=1)]
    for player, policy in (("idle", Idle()), ("random", Random(SEED, 1))):
        value = corrected(policy)
        add(player, "be at chance", value, value <= most)
    value = corrected(RecordedActions(of.plans.actions[np.arange(LEVELS) % len(of.test_levels)]))
    add("replay of the practice plans", "solve all of practice, be at chance", value, value <= most and practised)
    add("plan of the nearest training level", "say what memory earns", corrected(RecordedActions(nearest)), True)
    add("script (privileged)", "", corrected(Scripted()), True)
    value = corrected(RecordedActions(given.plan.actions))
    add("planner (privileged)", "solve what the planner solves", value, value == 1.0)
    if task.row is not None:
        row, name = task.row, task.row.method.name
        (own,) = (one for one in row.pieces if one.suite == of.name and one.seed == SEED)
        seen = options_of(of, row.method, of.sample(SEED, number_of_levels(row.method)), "test")
        policy = NetworkPolicy(Network.load(row.folder / own.file), unit_actions=True)
        alone, noisy = corrected(policy, seen), corrected(Noisy(policy), seen)
        add(name, "", alone, True)
        below = "be below it where it beats chance"
        add(f"{name}, {NOISE:.0%} random", below, noisy, noisy < alone or alone <= most)
    write_json(task.path, lines)


class Noisy:
    """A policy some of whose actions are random."""

    def __init__(self, policy: NetworkPolicy) -> None:
        self.policy = policy

    def begin(self, env: VectorEnv) -> None:
        self.rng, self.space = np.random.default_rng(SEED), cast(Box, env.single_action_space)
        self.policy.begin(env)

    def __call__(self, observations: Any) -> np.ndarray:
        actions = self.policy(observations)
        noise = self.rng.uniform(self.space.low, self.space.high, actions.shape).astype(np.float32)
        return np.where(self.rng.random((len(actions), 1)) < NOISE, noise, actions)


def read_panel(path: Path) -> list[dict[str, Any]]:
    """The lines of a panel; raises :class:`RunFolderError` where the file is none."""
    return read_json(path, FORM)


def network_for(name: str, rows: Iterable[Row], trusted: Collection[str]) -> Row | None:
    """The first of some rows that has a network for a suite with the panel's seed; raises :class:`RunFolderError` where playing
    it brings in code that is not ``trusted``."""
    for row in rows:
        if row.method.kind == "networks" and any(
            (one.suite, one.seed) == (name, SEED) and one.file not in row.lacks for one in row.pieces
        ):
            return dataclasses.replace(row, method=row.trusted_method(trusted, PLAYED))
    return None
