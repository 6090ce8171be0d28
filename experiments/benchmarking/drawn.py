"""Levels that follow from a row: drawn by its commitment, so that nobody can have seen them before the row was what it is."""

import dataclasses
import hashlib
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from segar.envs import Policy
from segar.evaluation import Idle, PlayedEpisodes, Random, RecordedActions, Scripted, record_actions
from segar.experiments.benchmarking.level_sets import number_of_levels
from segar.experiments.benchmarking.playing import options_of, play_each, policy_in, read_actions
from segar.experiments.benchmarking.policy_process import SECONDS, PolicyProcess
from segar.experiments.benchmarking.row import RANDOM_PLAYS, Drawn, Method, Piece
from segar.experiments.runs.executed_code import code_of
from segar.experiments.runs.files import read_json
from segar.experiments.runs.run_folder import write_json
from segar.experiments.settings import ConfigError, RunFolderError, without_files
from segar.hardness import Plan, plan
from segar.levels import Levels, hash_of_levels
from segar.suites import Suite, suite
from segar.support import sha256_of

LEVELS = 1000  # of each suite with each seed
SAMPLES, ITERATIONS = 32, 4  # of the planner's search


@dataclass(frozen=True)
class DrawTask:
    """One piece whose levels are drawn and played; the result is written to ``path``."""

    method: Method
    piece: Piece
    file: Path
    commitment: str
    path: Path
    seconds: float = SECONDS

    def found(self) -> Drawn | None:
        """What was written for this commitment."""
        data = read_json(self.path) if self.path.exists() else {}
        return Drawn(**data["drawn"]) if data.get("commitment") == self.commitment else None


@dataclass(frozen=True, eq=False)
class Draw:
    """Drawn levels, with those that play them for comparison.

    Attributes:
        seed: of the draw. random: of :data:`RANDOM_PLAYS` episodes on each level, those that ended in success.
    """

    levels: Levels
    seed: int
    random: int
    plan: Plan


def draw_piece(task: DrawTask) -> None:
    """Plays the drawn levels of a piece and writes what came of them."""
    drawn = play_drawn(task.method, task.piece, task.file, task.commitment, seconds=task.seconds)
    write_json(task.path, {"commitment": task.commitment, "drawn": dataclasses.asdict(drawn)})


def draw(of: Suite, commitment: str, seed: int, train: Levels, salt: str = "") -> Draw:
    """The drawn levels of a suite with a seed: of the test distribution, none of which is among the levels ``train``.

    Args:
        commitment: what decides them; ``salt``: words of whoever verifies, for other levels that the author could not know.
    """
    digest = hashlib.sha256(f"{commitment}/{of.name}/{seed}/{salt}".encode()).digest()
    number = int.from_bytes(digest[:8], "big") >> 1
    levels = of.test.sample(LEVELS, seed=number, split="drawn", apart_from=train)
    random = play_each(levels, Random(number), {"task": of.task}, RANDOM_PLAYS).success
    rng = np.random.default_rng(number)
    return Draw(
        levels, number, int(random.sum()), plan(levels, of.task, rng=rng, samples=SAMPLES, iterations=ITERATIONS)
    )


def play_drawn(
    method: Method, piece: Piece, file: Path, commitment: str, salt: str = "", seconds: float = SECONDS
) -> Drawn:
    """What comes of the drawn levels of a piece: equal bits everywhere.

    Args:
        method: with the settings by which it plays, :data:`segar.experiments.benchmarking.row.DRAWN`.
        file: of the piece. seconds: the longest wait for a policy of somebody else's.

    Raises:
        SegarError: a policy fails, or acts otherwise than when its row was made.
    """
    of = suite(piece.suite)
    train = of.sample(piece.seed, number_of_levels(method))
    given = draw(of, commitment, piece.seed, train, salt)
    with _acting(method, of, piece, file, train, given, seconds) as (policy, options):
        played = play_each(given.levels, policy, options)
    return drawn_of(piece, file, given, played)


def drawn_of(piece: Piece, file: Path, given: Draw, played: PlayedEpisodes) -> Drawn:
    """The episodes of a method beside those of random play and of the planner."""
    episodes = hashlib.sha256()
    for array in (played.returns, played.length, played.success):
        episodes.update(np.ascontiguousarray(array).tobytes())
    both = played.success & given.plan.solved
    parts = np.minimum(np.where(given.plan.solved, given.plan.steps, np.inf) / played.length, 1.0)
    return Drawn(
        piece.suite, piece.seed, sha256_of(file, "file", RunFolderError) if piece.file else "",
        hash_of_levels(given.levels), LEVELS, int(played.success.sum()), given.random, int(given.plan.solved.sum()),
        int(played.length[both].sum()), int(given.plan.steps[both].sum()), episodes.hexdigest(),
        math.fsum(parts[played.success]),
    )  # fmt: skip


@contextmanager
def _acting(
    method: Method, of: Suite, piece: Piece, file: Path, train: Levels, given: Draw, seconds: float
) -> Iterator[tuple[Policy, dict[str, Any]]]:
    """The policy of a piece, and the options of the environments that it plays in."""
    options: dict[str, Any] = {"task": of.task}
    if method.kind == "player":
        players = {"idle": Idle, "script": Scripted, "random": lambda: Random(given.seed, 1)}
        yield RecordedActions(given.plan.actions) if method.name == "planner" else players[method.name](), options
        return
    known = piece.made_with.get("code", {})
    if changed := [name for name, now in code_of(without_files(method.settings)).items() if known.get(name) != now]:
        raise ConfigError(
            f"{', '.join(changed)} changed since the practice levels of {of.name} with seed {piece.seed} were played. Levels"
            " are drawn from the code, so that no other code may play them: make the row anew, or put the files back"
        )
    options = {**options_of(of, method, train, "test"), "unit_actions": False}
    if method.kind != "actions":
        policy, options["unit_actions"] = policy_in(file)
        yield policy, options
        return
    name = method.settings["policy"]
    with PolicyProcess(name, of, piece.seed, options, seconds) as policy:
        before, after = read_actions(file)["test"], record_actions(policy, of.test_levels, **options)
        if before.shape != after.shape or (before != after).any():
            raise ConfigError(
                f"policy: {name} acts otherwise on the practice levels of {of.name} with seed {piece.seed} than when its row"
                " was made. It must give the same policy each time: train once, keep the weights, and load them"
            )
        yield policy, options
