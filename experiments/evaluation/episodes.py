"""What a policy achieves on given levels: one row per episode, and the figures that follow."""

import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
import torch

from segar import evaluation
from segar.envs import Policy, VectorEnv, begin_policy
from segar.errors import UnseenDifferenceWarning
from segar.evaluation import QUANTITIES, TRIAL_QUANTITIES, adaptation_gain
from segar.experiments.algorithms.learner import PolicyNetwork
from segar.experiments.levels.builders import Prepared
from segar.experiments.networks.encoders import forget_frames, successive
from segar.experiments.runs.run_folder import RESULTS
from segar.experiments.runs.run_rows import result_figures
from segar.experiments.settings import ACTION_MODES, ConfigError
from segar.levels import Levels
from segar.metrics import coverage, effective_number, ks, sample_entropy, unseen_differences, w2

NAMED = 3  # levels that a warning names
Agent: TypeAlias = Policy | PolicyNetwork
"""What is evaluated: a policy, or the network of a learner, which acts in two modes."""


class NetworkActions:
    """The policy that acts as a learner's network does.

    Args:
        network: see :class:`segar.experiments.algorithms.learner.PolicyNetwork`.
        rng: source of sampled actions; the actions are deterministic where it is None.
    """

    def __init__(self, network: PolicyNetwork, rng: torch.Generator | None) -> None:
        self.network, self.rng = network, rng
        self.only_running = not hasattr(network, "begin")  # one that remembers is given all observations

    def begin(self, env: VectorEnv) -> None:
        """Episodes start in ``env``; raises :class:`ConfigError` where its actions are not those of the network."""
        space: Any = env.single_action_space
        if not (np.all(space.low == -1) and np.all(space.high == 1)):
            raise ConfigError(
                f"a trained agent acts in [-1, 1], and these environments take actions from {space.low} to {space.high}: give"
                " them unit_actions=True, with which they scale them"
            )
        forget_frames(self.network)
        begin_policy(self.network, env)

    def __call__(self, observations: np.ndarray) -> np.ndarray:
        """Actions float32 ``(n, action size)``."""
        return self.network.act(observations, rng=self.rng)


def as_policy(agent: Agent, rng: torch.Generator | None) -> Policy:
    """The policy of an agent: a network acts with ``rng``, deterministically where it is None; a policy is itself."""
    return NetworkActions(agent, rng) if hasattr(agent, "act") else agent  # type: ignore[arg-type, return-value]


def evaluate_run(agent: Agent, prepared: Prepared, train: Levels, test: Levels) -> list[dict[str, Any]]:
    """Episodes on all training levels (each equally often, ``evaluation.episodes`` in all at least) and on each test
    level once, with deterministic and with sampled actions; rows as in ``run_folder.EPISODE_SCHEMA``."""
    asked = prepared.config.evaluation
    rounds = -(-asked.episodes // len(train))
    return [
        *play_in_modes(agent, "train", train, prepared.env_options(train=train), asked.seed, rounds=rounds),
        *play_in_modes(agent, "test", test, prepared.env_options(train=train, which="test"), asked.seed),
    ]


def play_in_modes(
    agent: Agent,
    name: str,
    levels: Levels,
    env_options: Mapping[str, Any],
    seed: int,
    modes: Iterable[str] = ACTION_MODES,
    rounds: int = 1,
) -> list[dict[str, Any]]:
    """``rounds`` episodes, or rows of trials, on each level in each action mode; rows as in ``run_folder.EPISODE_SCHEMA``, and
    ``trial`` where there are several.

    Args:
        name: what the column ``levels`` says.
        seed: of the environments, and of the sampled actions.
    """
    rows = []
    for mode in modes:
        indices, rng = np.tile(np.arange(len(levels)), rounds), action_rng(mode, seed)
        episodes = play_episodes(agent, levels, indices, env_options, rng=rng, seed=seed)
        rows += [{"levels": name, "action_mode": mode, **episode} for episode in episodes]
    return rows


def action_rng(mode: str, seed: int) -> torch.Generator | None:
    """The source of the actions of a mode: a generator for "sampled", None for "deterministic"."""
    return torch.Generator().manual_seed(seed) if mode == "sampled" else None


def play_episodes(
    agent: Agent,
    levels: Levels,
    indices: np.ndarray,
    env_options: Mapping[str, Any],
    *,
    rng: torch.Generator | None,
    seed: int,
) -> list[dict[str, Any]]:
    """One episode on each level that ``indices`` (int ``[n]``) names, in that order; with several trials, trial by trial.

    Args:
        rng: source of sampled actions; None plays the deterministic policy.
        seed: of the environments, for tasks whose physics is random.
    """
    with successive(agent):
        played = evaluation.play_episodes(levels, indices, as_policy(agent, rng), seed=seed, **env_options)
    columns = {**played.columns(), **{f"{RESULTS}{name}": values for name, values in played.results.items()}}
    plain = [values.tolist() for values in columns.values()]
    return [dict(zip(columns, row, strict=True)) for row in zip(*plain, strict=True)]


def mean_figures(rows: Sequence[Mapping[str, Any]], levels: str, mode: str) -> dict[str, float]:
    """Means over the episodes of a level set in an action mode, e.g. ``evaluation/test/success/sampled``, and those of
    the task's own results, e.g. ``evaluation/test/results/distance_to_goal/sampled``; of several trials, also those of
    :func:`trial_figures`."""
    chosen = [row for row in rows if row["levels"] == levels and row["action_mode"] == mode]
    means = {f"evaluation/{levels}/{key}/{mode}": float(np.mean([row[key] for row in chosen])) for key in QUANTITIES}
    of_trials = {f"evaluation/{levels}/{key}/{mode}": value for key, value in trial_figures(chosen).items()}
    return means | of_trials | result_figures(chosen, levels, mode)


def figures_in_modes(rows: Sequence[Mapping[str, Any]], levels: str) -> dict[str, float]:
    """:func:`mean_figures` of both action modes."""
    return {name: value for mode in ACTION_MODES for name, value in mean_figures(rows, levels, mode).items()}


def trial_figures(rows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Of return and success: the mean of each trial, as ``success_trial_0``, and the gain from the first to the last one with
    its interval of 95 % over levels, as ``adaptation_gain_success`` and that with ``_low`` and ``_high``. Nothing where rows
    are of a single trial; no interval where there is a single level."""
    if not rows or "trial" not in rows[0]:
        return {}
    level, trial = (np.array([row[key] for row in rows]) for key in ("level", "trial"))
    found: dict[str, float] = {}
    for quantity in TRIAL_QUANTITIES:
        values = np.array([row[quantity] for row in rows])
        found |= {f"{quantity}_trial_{k}": float(values[trial == k].mean()) for k in range(int(trial.max()) + 1)}
        gain = adaptation_gain(level, trial, values)
        ends = {"": gain.value, "_low": gain.low, "_high": gain.high}
        found |= {f"adaptation_gain_{quantity}{end}": value for end, value in ends.items() if np.isfinite(value)}
    return found


def evaluation_figures(rows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Means per level set and action mode, e.g. ``evaluation/test/success/sampled``, and the generalization gaps.

    ``evaluation/gap/<mode>`` is the mean return on test levels minus that on training levels; ``gap_ref`` the same
    of ``return_ref``.
    """
    figures: dict[str, float] = {}
    for mode in ACTION_MODES:
        for name in ("train", "test"):
            figures |= mean_figures(rows, name, mode)
        for gap, quantity in (("gap", "return"), ("gap_ref", "return_ref")):
            means = {name: figures[f"evaluation/{name}/{quantity}/{mode}"] for name in ("train", "test")}
            figures[f"evaluation/{gap}/{mode}"] = means["test"] - means["train"]
    return figures


def without_number(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """A line for each of the task's own results that is NaN or infinite in some episodes, with the levels where it is."""
    found = []
    for name in (key for key in (rows[0] if rows else ()) if key.startswith(RESULTS)):
        wrong = [row for row in rows if not _is_finite(row[name])]
        levels = sorted({(row["levels"], row["level"]) for row in wrong})
        if wrong:
            which = ", ".join(f"{where} level {k}" for where, k in levels[:NAMED]) + ", ..." * (len(levels) > NAMED)
            found.append(
                f"warning: the task's result '{name.removeprefix(RESULTS)}' is no finite number in {len(wrong)} of"
                f" {len(rows)} episodes ({len(wrong) / len(rows):.0%}), and so its mean is none: {which}"
            )
    return found


def _is_finite(value: Any) -> bool:
    """Whether a result has no NaN and no infinite number; true of what is no number."""
    array = np.asarray(value)
    return array.dtype.kind != "f" or bool(np.isfinite(array).all())


def distance_figures(train: Levels, test: Levels, modes: Sequence[Any]) -> dict[str, float]:
    """How far test levels are from training levels: Wasserstein-2 in each mode, e.g. ``w2/exact``, and ``ks``, the
    Kolmogorov-Smirnov statistic of all factors together. The mode ``exact``, which sees most, comes first; what a mode does
    not see, :func:`unseen_by_distances` says."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnseenDifferenceWarning)
        first = sorted(modes, key=lambda mode: mode != "exact")
        distances = {f"w2/{mode}": float(w2(train, test, mode=mode)) for mode in first}
        return {**distances, "ks": float(ks(train, test))}


def unseen_by_distances(train: Levels, test: Levels, modes: Sequence[Any]) -> list[str]:
    """A line for each mode of Wasserstein-2 that does not see all in which test levels differ from training levels; of
    ``exact`` alone where it is among them, for it stands beside what the others do not see."""
    found = {mode: unseen_differences(train, test, mode) for mode in (["exact"] if "exact" in modes else modes)}
    return [
        f"warning: w2/{mode} does not see that test levels (second) differ from training levels (first): {'. '.join(texts)}"
        for mode, texts in found.items()
        if texts
    ]


def diversity_figures(train: Levels, test: Levels) -> dict[str, float]:
    """How diverse training levels are, as ``diversity/<what>``.

    ``effective_number``: the number of levels without any likeness that they are worth. ``entropy``: of their
    distribution, in nats, factor by factor, from the share of values that ``entropy_left_out`` does not count.
    ``radius``: the largest distance of a test level from the nearest training level, in standard deviations.
    """
    entropy = sample_entropy(train, "mean_field")
    figures = {
        "effective_number": effective_number(train),
        "entropy": entropy.value,
        "entropy_left_out": entropy.left_out,
        "radius": coverage(train, test).radius,
    }
    return {f"diversity/{name}": float(value) for name, value in figures.items()}
