"""The settings of a run: frozen dataclasses in which every default lives once.

YAML under ``conf/`` says only what differs. :func:`run_config` turns plain data (Hydra's result, or a run folder's
``config.yaml``) into a :class:`RunConfig`; nothing after it sees a ``DictConfig``.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from experiments.settings.construct import construct, import_object
from experiments.settings.errors import ConfigError
from segar.errors import did_you_mean
from segar.levels import families

CHECKOUT = Path(__file__).resolve().parents[2]
LATER = "later"


def later(default: Any) -> Any:
    """A setting that came after runs had been made without it: at its default it is not part of what names a run, so that
    they are found again."""
    return field(default=default, metadata={LATER: True})


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


DESIGNS = ("iid", "clustered", "covering", "nuisance_only")  # kinds of segar.design that need no test levels
TARGET_DESIGN = re.compile(r"w2_(x?)(\d+(?:\.\d+)?)")  # its kind target, in the mode exact


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
class AlgorithmConfig:
    """What all algorithms share; each adds its hyper-parameters in a sub-class."""

    learner: ClassVar[str]  # "module:Class"; see experiments.algorithms.learner

    name: str
    num_envs: int = 64

    def __post_init__(self) -> None:
        require(self.num_envs >= 1, "algorithm.num_envs", self.num_envs, "at least 1")


@dataclass(frozen=True)
class PPOConfig(AlgorithmConfig):
    """PPO; the defaults are the paper's (Table 1), and the 2022 code's where the table is silent."""

    name: str = "ppo"
    learner: ClassVar[str] = "experiments.algorithms.ppo:PPO"

    num_steps: int = 30  # per environment and update
    epochs: int = 1
    minibatches: int = 4
    steps_together: int = 1  # successive steps of an environment that are in one minibatch: their stacks share frames
    learning_rate: float = 1e-4
    anneal: bool = False  # lower the learning rate linearly to zero
    adam_eps: float = 1e-5
    gamma: float = 0.999
    gae_lambda: float = 0.95
    clip: float = 0.2
    clip_value: float | None = 0.2  # in units of scaled return; None: the value loss is not clipped
    entropy_coef: float = 3e-4
    critic_coef: float = 0.1  # of half the squared error
    max_grad_norm: float = 10.0
    reward_transform: str = "none"  # what the learner sees of rewards: see experiments.collection.rewards
    reward_scale: float = 1.0  # times this
    reward_normalise: bool = False  # and divided by the standard deviation of discounted returns so far
    encoder: str = "impala"  # the CNN that reads frames; mlp: frames are refused. Vectors are read by an MLP
    widths: tuple[int, ...] = (256, 256)  # of that MLP; the last one is the representation's
    precision: str = "auto"  # of the CNN: bf16, fp32; auto: bf16 where the processor is made for it
    head_width: int = 256  # of the hidden layer of each head; 0: heads are linear
    shared: bool | None = True  # one encoder for policy and value, or one each; null: they share a CNN, but no MLP
    initial_std: float = 1.0  # of the policy, before tanh
    min_log_std: float = -3.0
    max_log_std: float = 2.0
    device: str = "cpu"  # where networks compute: cpu, cuda, cuda:1
    overlap: bool = later(False)  # collect the next rollout, with the weights as they are, while this one is learned on
    compile: bool = later(False)  # the loss, by torch.compile; on a GPU it is replayed as CUDA graphs

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("num_steps", "epochs", "minibatches"):
            require(getattr(self, name) >= 1, f"algorithm.{name}", getattr(self, name), "at least 1")
        for name in ("learning_rate", "adam_eps", "clip", "max_grad_norm", "reward_scale", "initial_std"):
            require(getattr(self, name) > 0, f"algorithm.{name}", getattr(self, name), "more than 0")
        for name in ("entropy_coef", "critic_coef", "head_width"):
            require(getattr(self, name) >= 0, f"algorithm.{name}", getattr(self, name), "0 or more")
        for name in ("gamma", "gae_lambda"):
            require(0 <= getattr(self, name) <= 1, f"algorithm.{name}", getattr(self, name), "between 0 and 1")
        none_or_positive = self.clip_value is None or self.clip_value > 0
        require(none_or_positive, "algorithm.clip_value", self.clip_value, "more than 0, or null")
        require_known("algorithm.reward_transform", self.reward_transform, REWARD_TRANSFORMS)
        require_encoder("algorithm.encoder", self.encoder)
        require_known("algorithm.precision", self.precision, PRECISIONS)
        positive = bool(self.widths) and min(self.widths) >= 1
        require(positive, "algorithm.widths", list(self.widths), "one or more numbers, each at least 1")
        room = self.max_log_std - self.min_log_std
        require(room > 0, "algorithm.min_log_std", self.min_log_std, f"less than max_log_std, {self.max_log_std}")
        most = self.num_envs * self.num_steps // 2  # advantages are normalised within a minibatch: one has no variance
        require(self.minibatches <= most, "algorithm.minibatches", self.minibatches, f"at most half the batch, {most}")
        together, pieces = self.steps_together, self.num_envs * self.num_steps // max(self.steps_together, 1)
        divides = together >= 1 and self.num_steps % together == 0
        require(divides, "algorithm.steps_together", together, f"a divisor of num_steps, {self.num_steps}")
        require(self.minibatches <= pieces, "algorithm.minibatches", self.minibatches, f"at most the {pieces} pieces "
                f"of steps_together={together}")  # fmt: skip


# The CNNs that have a name: functions in experiments.networks.encoders.
CNNS = ("small", "keypoints", "nature", "impala", "impala_15")
PRECISIONS = ("auto", "bf16", "fp32")
REWARD_TRANSFORMS = ("none", "sqrt")


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
        data = as_data(self, named=True)
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


def run_config(data: Mapping[str, Any]) -> RunConfig:
    """The :class:`RunConfig` that plain data states; raises :class:`ConfigError` for a wrong name, type or value.

    ``data["algorithm"]["type"]`` names the dataclass of the algorithm as ``module:Class``.
    """
    data = dict(data)
    algorithm = dict(data.pop("algorithm", {}))
    kind = algorithm.pop("type", class_name(PPOConfig))
    cls = import_object(kind, "algorithm.type")
    if not (isinstance(cls, type) and issubclass(cls, AlgorithmConfig)):
        raise ConfigError(f"algorithm.type: '{kind}' is not a sub-class of experiments.settings.config.AlgorithmConfig")
    return construct(RunConfig, data, "", algorithm=construct(cls, algorithm, "algorithm"))


def as_data(config: Any, named: bool = False) -> dict[str, Any]:
    """Plain data (dict, list, numbers, text) from which :func:`run_config` makes the same settings again; if ``named``,
    without those of :func:`later` that stand at their default."""

    def plain(value: Any) -> Any:
        if dataclasses.is_dataclass(value):
            kind = {"type": class_name(type(value))} if isinstance(value, AlgorithmConfig) else {}
            left_out = LATER if named else None
            content = {
                f.name: plain(getattr(value, f.name))
                for f in dataclasses.fields(value)
                if left_out not in f.metadata or getattr(value, f.name) != f.default
            }
            return {**kind, **content}
        if isinstance(value, Mapping):
            return {key: plain(v) for key, v in value.items()}
        return [plain(v) for v in value] if isinstance(value, tuple | list) else value

    return plain(config)


def class_name(cls: type) -> str:
    """``module:Class``, from which :func:`experiments.settings.construct.import_object` finds the class again."""
    return f"{cls.__module__}:{cls.__qualname__}"


def require(holds: bool, place: str, value: Any, wanted: str) -> None:
    """Raises :class:`ConfigError` unless ``holds``."""
    if not holds:
        raise ConfigError(f"{place}: {value!r} is not allowed; it must be {wanted}")


def require_known(place: str, name: str, names: Sequence[str]) -> None:
    """Raises :class:`ConfigError` that names the nearest of ``names``, unless ``name`` is one of them."""
    if name not in names:
        raise ConfigError(f"{place}: '{name}' is unknown.{did_you_mean(name, names)}")


def require_design(place: str, name: str) -> None:
    """Raises :class:`ConfigError` unless ``name`` is in DESIGNS, or says a W2 between training and test levels.

    ``w2_4.2`` is that distance; ``w2_x1.2`` is 1.2 times the mean distance of independent sets of as many levels.
    """
    target = TARGET_DESIGN.fullmatch(name)
    if target is None and name.startswith("w2_"):
        raise ConfigError(
            f"{place}: '{name}' says no distance; w2_4.2 does, and w2_x1.2, 1.2 times that of independent sets"
        )
    if target is None:
        require_known(place, name, DESIGNS)
    else:
        require(float(target[2]) > 0, place, name, "a distance above 0")


def require_encoder(place: str, name: str) -> None:
    """Raises :class:`ConfigError` unless ``name`` is that of a CNN, ``mlp``, or ``module:function``."""
    if ":" not in name:
        require_known(place, name, (*CNNS, "mlp"))


def require_seed(place: str, seed: int) -> None:
    """Raises :class:`ConfigError` unless all generators take ``seed``."""
    require(0 <= seed < SEEDS, place, seed, f"0 or more, and less than {SEEDS}")


SEEDS = 2**63
