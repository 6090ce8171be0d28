"""The settings of a run: frozen dataclasses in which every default lives once.

YAML under ``conf/`` says only what differs. :func:`run_config` turns plain data (Hydra's result, or a run folder's
``config.yaml``) into a :class:`RunConfig`; nothing after it sees a ``DictConfig``.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from experiments.settings.algorithms import ADDED_LATER, TARGET, AlgorithmConfig, PPOConfig, kind_of, named_class
from experiments.settings.checks import require, require_design, require_known, require_seed
from segar.levels import families

CHECKOUT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class LevelsConfig:
    """Where the levels come from. A distribution is a family's name, or ``module:attribute`` for one of your own."""

    train: str = "empty-hard"
    test: str | None = None  # None: the same as train; another one makes the test out of distribution
    count: int = 10  # training levels
    seed: int = 0  # which training levels; a smaller count takes the first ones
    design: str = "iid"  # how the training levels are picked from their distribution, see require_design
    variation: str = ""  # of both distributions: a name in experiments.levels.variations, or ``module:function``
    test_variation: str | None = None  # None: the same
    test_count: int = 100
    test_seed: int = 0  # which test levels; they never meet training levels, whatever the seeds

    def __post_init__(self) -> None:
        require_design("levels.design", self.design)
        require(self.count >= 1, "levels.count", self.count, "at least 1")
        require(self.test_count >= 1, "levels.test_count", self.test_count, "at least 1")
        require_seed("levels.seed", self.seed)
        require_seed("levels.test_seed", self.test_seed)

    @property
    def test_distribution(self) -> str:
        """The distribution that test levels come from."""
        return self.test or self.train


@dataclass(frozen=True)
class TaskConfig:
    """What the agent is asked to do: a task's name, or ``module:attribute``."""

    name: str = "puttputt"
    options: Mapping[str, Any] = field(default_factory=dict)  # keyword arguments, e.g. reward, max_steps, sub_steps


@dataclass(frozen=True)
class ObservationConfig:
    """What the agent sees: ``state``, ``rgb``, ``textures``, or ``module:attribute``."""

    name: str = "state"
    options: Mapping[str, Any] = field(default_factory=dict)  # keyword arguments, where a class or function is named


@dataclass(frozen=True)
class ScaleConfig:
    """How much is run: the frames of a training run, and the cells of the reproduction."""

    name: str = "single"
    frames: int = 200_000
    families: tuple[str, ...] = ("empty", "objectsx1", "tilesx1")
    difficulties: tuple[str, ...] = ("easy", "medium", "hard")
    counts: tuple[int, ...] = (1, 10, 50, 100, 200)
    seeds: int = 1  # how many, from ``seed`` upwards

    def __post_init__(self) -> None:
        require(self.frames >= 1, "scale.frames", self.frames, "at least 1")
        require(self.seeds >= 1, "scale.seeds", self.seeds, "at least 1")
        named = [name.rsplit("-", 1) for name in families()]
        for name in self.families:
            require_known("scale.families", name, [family for family, _ in named])
        for name in self.difficulties:
            require_known("scale.difficulties", name, [difficulty for _, difficulty in named])
        for count in self.counts:
            require(count >= 1, "scale.counts", count, "at least 1")


@dataclass(frozen=True)
class EvaluationConfig:
    """How a trained agent is measured."""

    episodes: int = 100  # on training levels, at least; each level is played equally often
    seed: int = 0  # of sampled actions
    interval: int = 0  # frames between evaluations on the test levels while training; 0: only at the end
    distances: tuple[str, ...] = ("reference", "exact")  # Wasserstein-2 between training and test levels

    def __post_init__(self) -> None:
        require(self.episodes >= 1, "evaluation.episodes", self.episodes, "at least 1")
        require(self.interval >= 0, "evaluation.interval", self.interval, "0 or more")
        require_seed("evaluation.seed", self.seed)
        for name in self.distances:
            require_known("evaluation.distances", name, DISTANCES)


ACTION_MODES = ("deterministic", "sampled")  # of evaluation
DISTANCES = ("exact", "reference", "paper")  # the modes of segar.metrics.w2


@dataclass(frozen=True)
class TrackingConfig:
    """Where figures are shown: MLflow, or nowhere but in the run folder."""

    name: str = "mlflow"  # or none
    uri: str | None = None  # None: SQLite, <root>/mlflow.db
    experiment: str = "segar"
    sweep: str = ""  # a tag that the runs of one sweep share
    interval: float = 5.0  # [s] between batches

    def __post_init__(self) -> None:
        require_known("tracking.name", self.name, ("mlflow", "none"))
        is_address = self.uri is None or "://" in self.uri
        require(
            is_address, "tracking.uri", self.uri, "an address such as sqlite:////path/mlflow.db or http://host:5000"
        )
        require(self.interval >= 0, "tracking.interval", self.interval, "0 or more")


@dataclass(frozen=True)
class RunConfig:
    """One training run, whole."""

    levels: LevelsConfig = field(default_factory=LevelsConfig)
    task: TaskConfig = field(default_factory=TaskConfig)
    observation: ObservationConfig = field(default_factory=ObservationConfig)
    algorithm: AlgorithmConfig = field(default_factory=PPOConfig)
    scale: ScaleConfig = field(default_factory=ScaleConfig)
    evaluation: EvaluationConfig = field(default_factory=EvaluationConfig)
    tracking: TrackingConfig = field(default_factory=TrackingConfig)
    seed: int = 0  # of training: weights, actions, order of levels
    root: str | None = None  # where run folders are made; None: runs/ of the checkout
    folder: str | None = None  # the run folder; None: named by its settings, under root
    resume: bool = True  # go on with an unfinished run that the run folder holds; false: refuse to
    restart: bool = False  # throw away what the run folder holds
    stale: str = "keep"  # a run by other code than today's: keep it if it is finished, or train it "anew"
    num_threads: int = (
        1  # of the engine and of torch; weights depend on it in their last bits, as sums have another order
    )
    checkpoint_interval: float = 60.0  # [s] between checkpoints
    progress: bool = True

    def __post_init__(self) -> None:
        require_seed("seed", self.seed)
        require_known("stale", self.stale, ("keep", "anew"))
        require(self.num_threads >= 1, "num_threads", self.num_threads, "at least 1")
        require(self.checkpoint_interval >= 0, "checkpoint_interval", self.checkpoint_interval, "0 or more")

    def identity(self) -> dict[str, Any]:
        """The settings that decide the results, as plain data; where files go or what is printed is not among them."""
        data = as_data(self, without_later_defaults=True)
        data["algorithm"] = {"kind": kind_of(type(self.algorithm)), **data["algorithm"]}
        data["algorithm"].pop(TARGET, None)
        parts = {key: data[key] for key in ("levels", "task", "observation", "algorithm", "evaluation", "seed")}
        return {**parts, "frames": self.scale.frames}

    def hash(self) -> str:
        """Eight hexadecimal digits that are equal for equal :meth:`identity`."""
        text = json.dumps(self.identity(), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:8]

    def label(self) -> str:
        """The run's name, e.g. ``empty-hard-n10-state-ppo_fast-s1-3f9a12cd``."""
        levels = self.levels.train if self.levels.test is None else f"{self.levels.train}-to-{self.levels.test}"
        special = (self.levels.variation, self.levels.design if self.levels.design != "iid" else "")
        levels = "-".join((levels, *(name for name in special if name)))
        parts = (levels, f"n{self.levels.count}", self.observation.name, self.algorithm.name, f"s{self.seed}")
        return "-".join((*("".join(c if c.isalnum() or c in "_-." else "_" for c in p) for p in parts), self.hash()))


def as_data(config: Any, without_later_defaults: bool = False) -> dict[str, Any]:
    """Plain data (dict, list, numbers, text) from which :func:`run_config` makes the same settings again.

    Args:
        without_later_defaults: leave out the settings of :func:`added_later` that have their default.
    """

    def plain(value: Any) -> Any:
        if dataclasses.is_dataclass(value):
            content = {
                f.name: plain(getattr(value, f.name))
                for f in dataclasses.fields(value)
                if not (without_later_defaults and ADDED_LATER in f.metadata and getattr(value, f.name) == f.default)
            }
            return {**named_class(type(value)), **content} if isinstance(value, AlgorithmConfig) else content
        if isinstance(value, Mapping):
            return {key: plain(v) for key, v in value.items()}
        return [plain(v) for v in value] if isinstance(value, tuple | list) else value

    return plain(config)
