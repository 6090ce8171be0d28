"""The probes of a run in one table, beside what they say where the answer is known."""

import zlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pandas as pd
import torch
from sklearn.decomposition import PCA

from segar.analysis.probes.collection import PAPER_FACTORS, collect_run
from segar.analysis.probes.critics import CriticSettings
from segar.analysis.probes.factors import probe_factors
from segar.analysis.probes.information import CHANCE, Bound, estimate_bounds, mine_of_2022
from segar.analysis.probes.pairs import Frames, Pairs, standardised
from segar.analysis.stats.estimate import mean_of_replicates
from segar.errors import SegarError
from segar.experiments.algorithms.learner import PolicyNetwork
from segar.experiments.evaluation.evaluator import new_policy, options_of, shape_in
from segar.experiments.evaluation.probing import IDENTITY, KSG, ON_BOTH, READOUTS, TRAINED, ProbeConfig
from segar.experiments.networks.encoders import initialize
from segar.experiments.runs.run_folder import LEVELS_TRAIN, computed_as_begun, read_config
from segar.levels import Levels

TEST_LEVELS = 4  # at least two in each fold
COMPONENTS = 64  # of the pixels
FITTED_ON = 1000  # frames; more change little, and cost
POWER_ITERATIONS = 2  # of the randomised decomposition


def probe_run(folder: Path | str, config: ProbeConfig | None = None, seed: int = 0) -> pd.DataFrame:
    """All that the probes say of a run; one row per level set, representation, factor, probe and quantity.

    Probed on training and on test levels are the ``trained`` representation and ``identity``, z itself, which says how far
    accuracies can come: where an agent meets K states, to 1 - 1 / 2K. On test levels also ``random encoder``, phi of the
    same network before training; ``pixel PCA``, principal components of the observations; and ``shuffled``, phi of
    another episode, which must know nothing.

    On test levels all frames of a level count as one episode, so that results are about levels that were not fitted on.
    Training levels, of which there may be one, are divided by episodes: there, to know the level is to know its factors.

    Columns: ``run``, ``levels``, ``representation``, those of :func:`segar.analysis.probes.factors.probe_factors`, where
    ``factor`` is "all" for the bounds, whose ``probe`` is e.g. "jsd" and whose ``quantity`` is "accuracy" (chance 0.5) or
    "information" [nats]; there ``n`` counts replicates. Rows with ``probe`` "paper" are the accuracy of 2022: its
    factors, one step late, its shuffling and its critic, fitted on the training levels and scored there ("train", the
    very pairs that it was fitted on) and on the test levels.

    Raises:
        SegarError: there is no such run, or no weights in it, or there are too few frames or episodes.
    """
    folder, config = Path(folder).expanduser().resolve(), config or ProbeConfig()
    seen: dict[str, tuple[Frames, Pairs]] = {}
    for name in ("train", "test"):
        policy, frames = collect_run(
            folder, name, frames=config.frames, num_envs=config.num_envs, mode=config.mode, seed=seed
        )
        if name == "test":  # to know a level is to know its static factors; training levels may be too few to divide
            frames = replace(frames, episode=frames.level)
            found = len(np.unique(frames.level))
            if found < TEST_LEVELS:
                raise SegarError(
                    f"frames of {found} test levels cannot be divided by levels, {TEST_LEVELS} are needed: more of them"
                    " (levels.test_count), more frames (probes.<scale>.frames), or more episodes at once (num_envs)"
                )
        seen[name] = frames, frames.pairs(policy.represent)
    tables = []
    for kind, wanted in config.representations.items():
        for name in seen if kind in ON_BOTH else ("test",):
            rng = rng_of(seed, name, kind)  # so that no representation depends on which others are probed
            pairs = represent(kind, *seen[name], folder, rng)
            tables.append(place(probe_pairs(pairs, rng, wanted, config), folder, name, kind))
    if config.paper_replicates:
        tables += paper_rows(folder, seen, config, rng_of(seed, "paper"))
    return pd.concat([table for table in tables if len(table)], ignore_index=True)


def rng_of(seed: int, *names: str) -> np.random.Generator:
    """A generator of its own for each piece of the work."""
    return np.random.default_rng([seed, zlib.crc32(" ".join(names).encode())])


def probe_pairs(pairs: Pairs, rng: np.random.Generator, wanted: Sequence[str], config: ProbeConfig) -> pd.DataFrame:
    """The rows of :func:`probe_run` that concern one representation; ``wanted`` names bounds, readouts, and "ksg"."""
    settings = CriticSettings(steps=config.steps, batch=config.batch)
    bounds = [name for name in get_args(Bound) if name in wanted]
    rows = []
    if bounds:
        estimates = estimate_bounds(pairs, rng, bounds, replicates=config.replicates, settings=settings)
        for bound, found in estimates.items():
            for quantity, one in zip(("accuracy", "information"), found, strict=True):
                rows.append(one.row(factor="all", probe=bound, quantity=quantity, frames=len(pairs)))
    tables = [pd.DataFrame(rows)] if rows else []
    if readouts := [name for name in READOUTS if name in wanted]:
        tables.append(probe_factors(pairs, rng, probes=readouts, nearest=KSG in wanted))
    return pd.concat([table.astype(object) for table in tables], ignore_index=True).infer_objects()


def represent(kind: str, frames: Frames, trained: Pairs, folder: Path, rng: np.random.Generator) -> Pairs:
    """Frames in one representation; ``trained`` are the same frames in the run's own. Raises :class:`SegarError`."""
    if kind == TRAINED:
        return trained
    if kind == "random encoder":
        return frames.pairs(untrained(folder, rng).represent)
    if kind == "pixel PCA":
        return components(frames, rng)
    if kind == IDENTITY:
        return trained.with_representation(standardised(trained.factors, trained.columns))
    if kind == "shuffled":
        return shuffled(trained, rng)
    raise SegarError(f"representation '{kind}' is unknown")


def untrained(folder: Path, rng: np.random.Generator) -> PolicyNetwork:
    """The network of a run with fresh weights."""
    config = computed_as_begun(folder, read_config(folder))
    policy = new_policy(config, shape_in(Levels.load(folder / LEVELS_TRAIN), config, options_of(folder, config)))
    draw = getattr(policy, "initialize", None) or (lambda generator: initialize(policy, generator))
    draw(torch.Generator().manual_seed(int(rng.integers(2**31))))
    return policy


def components(frames: Frames, rng: np.random.Generator) -> Pairs:
    """At most 64 principal components of the observations, of frames drawn at random; they see no factor."""
    pairs = frames.pairs(lambda observation: observation.reshape(len(observation), -1))
    some = rng.permutation(len(pairs))[:FITTED_ON]
    size = min(COMPONENTS, len(some), pairs.representation.shape[1])
    start = int(rng.integers(2**31))
    model = PCA(size, svd_solver="randomized", iterated_power=POWER_ITERATIONS, random_state=start)  # type: ignore[arg-type]
    return pairs.with_representation(model.fit(pairs.representation[some]).transform(pairs.representation))


def shuffled(pairs: Pairs, rng: np.random.Generator) -> Pairs:
    """Each episode with representations of one other episode: what the probes say of knowing nothing.

    Which moment of the other episode is drawn anew for each frame: otherwise phi would know the time since the start,
    and so, for instance, how fast things are. Frames of an episode share theirs, as they share their static factors.
    """
    names = np.unique(pairs.episode)
    if len(names) < 2:
        raise SegarError("frames of one episode cannot be exchanged with those of another")
    order = rng.permutation(len(names))
    rows_of = [np.flatnonzero(pairs.episode == name) for name in names]
    source = np.empty(len(pairs), np.int64)
    for episode, other in zip(order, np.roll(order, 1), strict=True):
        rows, others = rows_of[episode], rows_of[other]
        source[rows] = others[rng.integers(len(others), size=len(rows))]
    return pairs.with_representation(pairs.representation[source])


def paper_rows(
    folder: Path, seen: dict[str, tuple[Frames, Pairs]], config: ProbeConfig, rng: np.random.Generator
) -> list[pd.DataFrame]:
    """The accuracy as in 2022, on training and test levels; and with nothing but the marginal put right."""
    sets = []
    for name in ("train", "test"):
        frames, pairs = seen[name]
        rows = rng.permutation(len(pairs))[: config.paper_frames]
        phi, factors, episode = (array[rows] for array in (pairs.representation, frames.late, pairs.episode))
        some = replace(pairs, representation=phi, factors=factors, episode=episode)
        sets.append(some.only([k for k, c in enumerate(some.columns) if c.factor in PAPER_FACTORS]))
    tables = []
    for probe, joint in (("paper", False), ("paper, joint marginal", True)):
        found = [mine_of_2022(sets[0], sets[1], rng, joint=joint) for _ in range(config.paper_replicates)]
        for name, values in zip(("train", "test"), zip(*found, strict=True), strict=True):
            one = mean_of_replicates(values, CHANCE).told_from(CHANCE, f"{len(sets[0])} frames")
            row = one.row(factor="all", probe=probe, quantity="accuracy", frames=len(sets[0]))
            tables.append(place(pd.DataFrame([row]), folder, name, TRAINED))
    return tables


def place(table: pd.DataFrame, folder: Path, levels: str, representation: str) -> pd.DataFrame:
    """The table after the columns that say what was probed."""
    head = {"run": folder.name, "levels": levels, "representation": representation}
    return pd.concat([pd.DataFrame([head] * len(table), index=table.index), table], axis=1)
