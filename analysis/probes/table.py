"""The probes of a run in one table, beside what they say where the answer is known."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from sklearn.decomposition import PCA

from analysis.probes.collection import ENVS, FRAMES, PAPER_FACTORS, collect_run
from analysis.probes.critics import CriticSettings
from analysis.probes.factors import probe_factors
from analysis.probes.information import REPLICATES, Bound, estimate_information, mine_of_2022
from analysis.probes.pairs import Frames, Pairs, standardised
from analysis.stats.estimate import mean_of_replicates
from experiments.construct import import_object
from experiments.evaluation import shape_in
from experiments.run_folder import LEVELS_TRAIN, read_config
from experiments.worlds import environment_options
from segar.errors import SegarError
from segar.levels import Levels

COMPONENTS = 64  # of the pixels
REPRESENTATIONS = ("trained", "random encoder", "pixel PCA", "identity", "shuffled")
"""What is probed: phi; phi of the same network before training; principal components of the observations; z itself,
which must saturate; and phi of another episode, which must know nothing."""


def probe_run(
    folder: Path | str,
    *,
    levels: Sequence[str] = ("train", "test"),
    representations: Sequence[str] = REPRESENTATIONS,
    bounds: Sequence[Bound] = ("jsd", "infonce", "smile"),
    probes: Sequence[str] = ("ridge", "mlp"),
    frames: int = FRAMES,
    num_envs: int = ENVS,
    replicates: int = REPLICATES,
    settings: CriticSettings | None = None,
    seed: int = 0,
) -> pd.DataFrame:
    """All that the probes say of a run; one row per level set, representation, factor, probe and quantity.

    Columns: ``run``, ``levels``, ``representation``, those of :func:`analysis.probes.factors.probe_factors`, where
    ``factor`` is "all" for the bounds, whose ``probe`` is e.g. "jsd" and whose ``quantity`` is "accuracy" (chance 0.5) or
    "information" [nats]; there ``n`` counts replicates. Rows with ``probe`` "paper" are the accuracy of 2022: its
    factors, one step late, its shuffling and its critic, fitted on the training levels and scored there ("train", the
    very pairs that it was fitted on) and on the test levels.

    Raises:
        SegarError: there is no such run, or no weights in it, or an argument is out of range.
    """
    folder = Path(folder).expanduser().resolve()
    rng = np.random.default_rng(seed)
    collected = {}
    tables = []
    for name in levels:
        policy, seen = collect_run(folder, name, frames=frames, num_envs=num_envs, seed=seed)
        collected[name] = policy, seen
        for kind, pairs in represent_all(folder, policy, seen, representations, rng).items():
            table = probe_pairs(pairs, rng, bounds=bounds, probes=probes, replicates=replicates, settings=settings)
            tables.append(place(table, folder, name, kind))
    if set(collected) >= {"train", "test"} and "trained" in representations:
        tables += paper_rows(folder, collected, replicates, rng)
    return pd.concat([table for table in tables if len(table)], ignore_index=True)


def probe_pairs(
    pairs: Pairs,
    rng: np.random.Generator,
    *,
    bounds: Sequence[Bound] = ("jsd", "infonce", "smile"),
    probes: Sequence[str] = ("ridge", "mlp"),
    replicates: int = REPLICATES,
    settings: CriticSettings | None = None,
) -> pd.DataFrame:
    """The rows of :func:`probe_run` that concern one representation."""
    rows = []
    for bound in bounds:
        found = estimate_information(pairs, rng, bound=bound, replicates=replicates, settings=settings)
        for quantity, one in zip(("accuracy", "information"), found, strict=True):
            rows.append({"factor": "all", "probe": bound, "quantity": quantity, "frames": len(pairs)} | asdict(one))
    tables = [pd.DataFrame(rows)] if rows else []
    if probes:
        tables.append(probe_factors(pairs, rng, probes=probes))
    return pd.concat([table.astype(object) for table in tables], ignore_index=True).infer_objects()


def represent_all(
    folder: Path, policy: Any, frames: Frames, names: Sequence[str], rng: np.random.Generator
) -> dict[str, Pairs]:
    """The same frames in each representation; raises :class:`SegarError` for an unknown one."""
    makers: Mapping[str, Callable[[], Pairs]] = {
        "trained": lambda: frames.pairs(policy.represent),
        "random encoder": lambda: frames.pairs(untrained(folder, rng).represent),
        "pixel PCA": lambda: components(frames, rng),
        "identity": lambda: identity(frames.pairs(flat)),
        "shuffled": lambda: shuffled(frames.pairs(policy.represent), rng),
    }
    unknown = [name for name in names if name not in makers]
    if unknown:
        raise SegarError(f"representation '{unknown[0]}' is unknown; known are {', '.join(makers)}")
    return {name: makers[name]() for name in names}


def untrained(folder: Path, rng: np.random.Generator) -> Any:
    """The network of a run with fresh weights."""
    from experiments.encoders import initialize

    config = read_config(folder)
    learner = import_object(config.algorithm.learner, "algorithm")
    shape = shape_in(Levels.load(folder / LEVELS_TRAIN), config)
    policy = learner.make_policy(config.algorithm, shape, len(environment_options(config)["task"].action_low))
    draw = getattr(policy, "initialize", None) or (lambda generator: initialize(policy, generator))
    draw(torch.Generator().manual_seed(int(rng.integers(2**31))))
    return policy


def components(frames: Frames, rng: np.random.Generator) -> Pairs:
    """Principal components of the observations, at most 64; they see all frames, but no factor."""
    pairs = frames.pairs(flat)
    size = min(COMPONENTS, *pairs.representation.shape)
    model = PCA(size, svd_solver="randomized", random_state=int(rng.integers(2**31)))
    return pairs.with_representation(model.fit_transform(pairs.representation))


def flat(observation: Any) -> Any:
    """Observations as vectors [n, d]."""
    return observation.reshape(len(observation), -1)


def identity(pairs: Pairs) -> Pairs:
    """The factors themselves as their representation: what the probes say of one that knows everything."""
    return pairs.with_representation(standardised(pairs.factors, pairs.columns))


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
    for mine, theirs in zip(order, np.roll(order, 1), strict=True):
        rows, others = rows_of[mine], rows_of[theirs]
        source[rows] = others[rng.integers(len(others), size=len(rows))]
    return pairs.with_representation(pairs.representation[source])


def paper_rows(
    folder: Path, collected: Mapping[str, tuple[Any, Frames]], replicates: int, rng: np.random.Generator
) -> list[pd.DataFrame]:
    """The accuracy as in 2022, on training and test levels; and with nothing but the marginal put right."""
    sets = []
    for name in ("train", "test"):
        policy, frames = collected[name]
        pairs = frames.pairs(policy.represent, alignment="late")
        sets.append(pairs.only([k for k, c in enumerate(pairs.columns) if c.factor in PAPER_FACTORS]))
    tables = []
    for probe, joint in (("paper", False), ("paper, joint marginal", True)):
        found = [mine_of_2022(sets[0], sets[1], rng, joint=joint) for _ in range(replicates)]
        for name, values in zip(("train", "test"), zip(*found, strict=True), strict=True):
            row = {"factor": "all", "probe": probe, "quantity": "accuracy", "frames": len(sets[0])}
            tables.append(place(pd.DataFrame([row | asdict(mean_of_replicates(values, 0.5))]), folder, name, "trained"))
    return tables


def place(table: pd.DataFrame, folder: Path, levels: str, representation: str) -> pd.DataFrame:
    """The table after the columns that say what was probed."""
    head = {"run": folder.name, "levels": levels, "representation": representation}
    return pd.concat([pd.DataFrame([head] * len(table), index=table.index), table], axis=1)
