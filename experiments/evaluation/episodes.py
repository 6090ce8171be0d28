"""What a policy achieves on given levels: one row per episode, and the figures that follow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
import torch

from experiments.collection.collector import action_size
from experiments.levels.builders import environment_options
from experiments.networks.encoders import successive
from experiments.runs.run_folder import RESULTS
from experiments.settings import ACTION_MODES, RunConfig
from segar.envs import VectorEnv

BATCH = 512  # episodes that are played at once
QUANTITIES = ("return", "return_ref", "length", "success", "death")


class Player(Protocol):
    """Whoever acts: a policy, see :class:`experiments.algorithms.learner.Policy`, or an agent of :mod:`experiments.evaluation.baselines`."""

    def act(self, observation: np.ndarray, *, rng: torch.Generator | None) -> np.ndarray:
        """Actions float32 [n, 2] for observations [n, ...]; sampled with ``rng``, deterministic where it is None."""
        ...


def evaluate_run(policy: Player, config: RunConfig, train: Any, test: Any) -> list[dict[str, Any]]:
    """Episodes on all training levels (each equally often, ``evaluation.episodes`` in all at least) and on each test
    level once, with deterministic and with sampled actions; rows as in ``run_folder.EPISODE_SCHEMA``."""
    rounds = -(-config.evaluation.episodes // len(train))
    rows = []
    for name, levels, indices in (
        ("train", train, np.tile(np.arange(len(train)), rounds)),
        ("test", test, np.arange(len(test))),
    ):
        for mode in ACTION_MODES:
            rng = torch.Generator().manual_seed(config.evaluation.seed) if mode == "sampled" else None
            episodes = play(policy, levels, indices, environment_options(config), rng=rng, seed=config.evaluation.seed)
            rows.extend({"levels": name, "action_mode": mode, **episode} for episode in episodes)
    return rows


def play(
    policy: Player,
    levels: Any,
    indices: np.ndarray,
    env_options: Mapping[str, Any],
    *,
    rng: torch.Generator | None,
    seed: int,
) -> list[dict[str, Any]]:
    """One episode on each level that ``indices`` (int ``[n]``) names, in that order.

    Args:
        rng: source of sampled actions; None plays the deterministic policy.
        seed: of the environments, for tasks whose physics is random.
    """
    rows: list[dict[str, Any]] = []
    for start in range(0, len(indices), BATCH):
        rows.extend(_play_batch(policy, levels, indices[start : start + BATCH], env_options, rng, seed + start))
    return rows


def _play_batch(policy, levels, indices, env_options, rng, seed) -> list[dict[str, Any]]:
    env = VectorEnv(levels, len(indices), seed=seed, **env_options)
    rows: list[dict[str, Any] | None] = [None] * len(indices)
    observation, _ = env.reset(seed=seed, options={"levels": indices})
    acts_for_all = hasattr(policy, "begin") or not isinstance(observation, np.ndarray)  # it remembers, or looks at env
    if hasattr(policy, "begin"):
        policy.begin(env)
    actions = np.zeros((len(indices), action_size(env)), np.float32)
    with successive(policy):
        while None in rows:
            # An environment whose episode is over starts another one, in which nobody acts and which nobody records.
            playing = np.array([row is None for row in rows])
            if acts_for_all or playing.all():
                actions[:] = policy.act(observation, rng=rng)
            else:
                actions[playing] = policy.act(observation[playing], rng=rng)
            observation, reward, terminated, truncated, info = env.step(actions)
            new = [i for i in np.flatnonzero(terminated | truncated).tolist() if rows[i] is None]
            if new:
                final = info["final_info"]
                said = {f"{RESULTS}{name}": np.asarray(values) for name, values in final["results"].items()}
                for i in new:
                    rows[i] = _row(final, i, reward[i]) | {name: values[i].tolist() for name, values in said.items()}
    env.close()
    return [row for row in rows if row is not None]


def _row(final: Mapping[str, Any], i: int, last_reward: float) -> dict[str, Any]:
    total = float(final["return"][i])
    return {
        "level": int(final["level"][i]),
        "return": total,
        "return_ref": total - float(last_reward),
        "length": int(final["length"][i]),
        "success": bool(final["success"][i]),
        "death": bool(final["death"][i]),
    }


def mean_figures(rows: Sequence[Mapping[str, Any]], levels: str, mode: str) -> dict[str, float]:
    """Means over episodes, e.g. ``evaluation/test/success/sampled``."""
    return {f"evaluation/{levels}/{key}/{mode}": float(np.mean([row[key] for row in rows])) for key in QUANTITIES}


def evaluation_figures(rows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Means per level set and action mode, e.g. ``evaluation/test/success/sampled``, and the generalization gaps.

    ``evaluation/gap/<mode>`` is the mean return on test levels minus that on training levels; ``gap_ref`` the same
    of ``return_ref``.
    """
    figures: dict[str, float] = {}
    for mode in ACTION_MODES:
        for name in ("train", "test"):
            chosen = [row for row in rows if row["levels"] == name and row["action_mode"] == mode]
            figures |= mean_figures(chosen, name, mode)
        for gap, quantity in (("gap", "return"), ("gap_ref", "return_ref")):
            means = {name: figures[f"evaluation/{name}/{quantity}/{mode}"] for name in ("train", "test")}
            figures[f"evaluation/{gap}/{mode}"] = means["test"] - means["train"]
    return figures


def distance_figures(train: Any, test: Any, modes: Sequence[Any]) -> dict[str, float]:
    """How far test levels are from training levels: Wasserstein-2 in each mode, e.g. ``w2/exact``, and ``ks``, the
    Kolmogorov-Smirnov statistic of all factors together."""
    from segar.metrics import ks, w2

    return {**{f"w2/{mode}": float(w2(train, test, mode=mode)) for mode in modes}, "ks": float(ks(train, test))}


def diversity_figures(train: Any, test: Any) -> dict[str, float]:
    """How diverse training levels are, as ``diversity/<what>``.

    ``effective_number``: how many levels without any likeness they are worth. ``entropy``: of their law, in nats, factor
    by factor, from the share of values that ``entropy_left_out`` does not count. ``radius``: how far the worst served
    test level is from the nearest of them, in standard deviations.
    """
    from segar.metrics import coverage, effective_number, sample_entropy

    entropy = sample_entropy(train, "mean_field")
    found = {
        "effective_number": effective_number(train),
        "entropy": entropy.value,
        "entropy_left_out": entropy.left_out,
        "radius": coverage(train, test).radius,
    }
    return {f"diversity/{name}": float(value) for name, value in found.items()}
