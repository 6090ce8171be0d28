"""The settings of the algorithms, without torch: a dataclass for each kind, and the kinds by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from experiments.settings.checks import import_object, require, require_known
from experiments.settings.errors import ConfigError

# The CNNs that have a name: functions in experiments.networks.encoders.
CNNS = ("small", "keypoints", "nature", "impala", "impala_15", "cnn_2022")
PRECISIONS = ("auto", "bf16", "fp32")
REWARD_TRANSFORMS = ("none", "sqrt")
CORES = ("gru", "lstm")  # of a recurrent policy
TARGET = "_target_"  # as in Hydra: the setting that holds an import path
NAMES_OF_CLASS = ("kind", TARGET)  # settings that name the class of an algorithm
PREDICTION_MODELS = ("action_projection", "transition")  # of SPR

ADDED_LATER = "added later"


def added_later(default: Any) -> Any:
    """A field for a setting that was added after runs had been made without it.

    At its default it is not part of a run's identity, so that those runs keep their names.
    """
    return field(default=default, metadata={ADDED_LATER: True})


@dataclass(frozen=True)
class AlgorithmConfig:
    """The settings that all algorithms share; each algorithm adds its hyper-parameters in a sub-class.

    An algorithm of your own is such a sub-class in your package. A YAML file names it by ``_target_``, its import path.
    """

    kind: ClassVar[str]  # a short name that never changes, of the algorithms that are built in
    learner: ClassVar[str]  # "module:Class" of the class that learns; see experiments.algorithms.learner

    name: str
    num_envs: int = 64

    def __post_init__(self) -> None:
        require(self.num_envs >= 1, "algorithm.num_envs", self.num_envs, "at least 1")


@dataclass(frozen=True)
class PPOConfig(AlgorithmConfig):
    """PPO; the defaults are the paper's (Table 1), and the 2022 code's where the table is silent."""

    name: str = "ppo"
    kind: ClassVar[str] = "ppo"
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
    overlap: bool = added_later(
        False
    )  # collect the next rollout, with the weights as they are, while this one is learned on
    compile: bool = added_later(False)  # the loss, by torch.compile; on a GPU it is replayed as CUDA graphs

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


@dataclass(frozen=True)
class RecurrentPPOConfig(PPOConfig):
    """PPO's settings and those of the memory."""

    name: str = "ppo_recurrent"
    kind: ClassVar[str] = "ppo_recurrent"
    learner: ClassVar[str] = "experiments.algorithms.recurrent_ppo:RecurrentPPO"

    core: str = "gru"  # or lstm
    core_width: int = 128  # numbers that the heads read

    def __post_init__(self) -> None:
        super().__post_init__()
        require_known("algorithm.core", self.core, CORES)
        require(self.core_width >= 1, "algorithm.core_width", self.core_width, "at least 1")
        require(
            self.minibatches <= self.num_envs,
            "algorithm.minibatches",
            self.minibatches,
            f"at most num_envs, {self.num_envs}: a minibatch is made of whole environments",
        )
        require(self.shared is not False, "algorithm.shared", self.shared, "true: policy and value read one memory")
        require(
            not self.compile, "algorithm.compile", self.compile, "false: torch cannot trace TorchRL's recurrent layers"
        )


@dataclass(frozen=True)
class AuxiliaryConfig(PPOConfig):
    """What all auxiliary losses share, beside PPO's settings."""

    name: str = "auxiliary"
    auxiliary_minibatches: int = (
        4  # gradient steps after each of PPO's updates, which take epochs x minibatches of theirs
    )
    auxiliary_learning_rate: float | None = None  # of an Adam of its own; null: PPO's Adam, with its state
    tau: float = 0.01  # share of the encoder that enters the target encoder after each such step; 1: they are one
    crop: float = 1.0  # frames are cut to a random window of this share of their sides, and enlarged again
    shift: int = 0  # frames are moved by up to this many pixels
    intensity: float = 0.0  # brightness changes by a factor of this deviation

    def __post_init__(self) -> None:
        super().__post_init__()
        most = self.num_envs * self.num_steps // 2  # a contrast needs two frames
        steps = self.auxiliary_minibatches
        require(
            1 <= steps <= most, "algorithm.auxiliary_minibatches", steps, f"from 1 to half a rollout's frames, {most}"
        )
        rate = self.auxiliary_learning_rate
        require(rate is None or rate > 0, "algorithm.auxiliary_learning_rate", rate, "more than 0, or null")
        require(0 < self.tau <= 0.5 or self.tau == 1, "algorithm.tau", self.tau, "more than 0 and at most 0.5, or 1")
        require(0 < self.crop <= 1, "algorithm.crop", self.crop, "more than 0, and at most 1")
        for name in ("shift", "intensity"):
            require(getattr(self, name) >= 0, f"algorithm.{name}", getattr(self, name), "0 or more")


@dataclass(frozen=True)
class CURLConfig(AuxiliaryConfig):
    """CURL; the defaults are the paper's protocol, with a window for every frame instead of one for all of a batch."""

    name: str = "curl"
    kind: ClassVar[str] = "curl"
    learner: ClassVar[str] = "experiments.algorithms.curl:CURL"

    crop: float = 0.8
    projection: int = 0  # numbers that are compared, after a normalised dense layer; 0: the representation itself

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.projection >= 0, "algorithm.projection", self.projection, "0 or more")


@dataclass(frozen=True)
class SPRConfig(AuxiliaryConfig):
    """SPR; the defaults are the paper's protocol, on sequences of all environments that end with their episode."""

    name: str = "spr"
    kind: ClassVar[str] = "spr"
    learner: ClassVar[str] = "experiments.algorithms.spr:SPR"

    crop: float = 0.8
    horizon: int = 1  # steps that are foretold
    model: str = "action_projection"  # the 2022 code's, which foretells one step; or transition, Schwarzer et al.'s
    model_width: int = 256
    weight: float = 1.0  # of the loss

    def __post_init__(self) -> None:
        super().__post_init__()
        require_known("algorithm.model", self.model, PREDICTION_MODELS)
        most = 1 if self.model == "action_projection" else self.num_steps - 1
        require(1 <= self.horizon <= most, "algorithm.horizon", self.horizon, f"from 1 to {most}")
        require(self.model_width >= 1, "algorithm.model_width", self.model_width, "at least 1")
        require(self.weight > 0, "algorithm.weight", self.weight, "more than 0")
        starts = (self.num_steps - self.horizon) * self.num_envs
        require(
            self.auxiliary_minibatches <= starts,
            "algorithm.auxiliary_minibatches",
            self.auxiliary_minibatches,
            f"at most the number of sequences in a rollout, {starts}",
        )


@dataclass(frozen=True)
class OffPolicyConfig(AlgorithmConfig):
    """How steps and gradient steps alternate, and what is remembered."""

    name: str = "off_policy"
    num_envs: int = 4
    num_steps: int = 64  # per environment and iteration, which is what figures are averaged over
    warmup: int = 1000  # environment steps with uniformly random actions, before anything is learned
    steps_per_update: int = 1  # environment steps per gradient step
    batch_size: int = 256
    capacity: int = 100_000  # rows of the replay: steps, and last observations of episodes
    learning_rate: float = 3e-4
    gamma: float = 0.99
    tau: float = 0.005  # share of the weights that enters the target networks after each gradient step
    reward_transform: str = "none"  # what the learner sees of the reward r: r itself, or sqrt: sign(r) |r|^1/2
    reward_scale: float = 1.0  # times this
    device: str = "cpu"  # where networks and replay live: cpu, cuda, cuda:1

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("num_steps", "steps_per_update", "batch_size"):
            require(getattr(self, name) >= 1, f"algorithm.{name}", getattr(self, name), "at least 1")
        for name in ("learning_rate", "reward_scale"):
            require(getattr(self, name) > 0, f"algorithm.{name}", getattr(self, name), "more than 0")
        require(0 <= self.gamma <= 1, "algorithm.gamma", self.gamma, "between 0 and 1")
        require(0 < self.tau <= 0.5, "algorithm.tau", self.tau, "more than 0, and at most 0.5")
        # Two steps of all environments, each with the last observations of its episodes: then one can be drawn.
        least = 4 * self.num_envs
        require(self.capacity >= least, "algorithm.capacity", self.capacity, f"at least {least}, 4 x num_envs")
        require(
            self.warmup >= 2 * self.num_envs,
            "algorithm.warmup",
            self.warmup,
            f"at least 2 x num_envs, {2 * self.num_envs}",
        )
        require_known("algorithm.reward_transform", self.reward_transform, REWARD_TRANSFORMS)


@dataclass(frozen=True)
class SACConfig(OffPolicyConfig):
    """SAC; the defaults are those of Haarnoja et al. (2018b) but for the number of environments and the replay."""

    name: str = "sac"
    kind: ClassVar[str] = "sac"
    learner: ClassVar[str] = "experiments.algorithms.sac:SAC"

    widths: tuple[int, ...] = (256, 256)  # of the hidden layers of policy and critics
    temperature: float = 1.0  # of the entropy, at first; it is learned
    target_entropy: float = -2.0  # minus the number of actions
    min_log_std: float = -10.0
    max_log_std: float = 2.0

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.temperature > 0, "algorithm.temperature", self.temperature, "more than 0")
        positive = bool(self.widths) and min(self.widths) >= 1
        require(positive, "algorithm.widths", list(self.widths), "one or more numbers, each at least 1")
        room = self.max_log_std - self.min_log_std
        require(room > 0, "algorithm.min_log_std", self.min_log_std, f"less than max_log_std, {self.max_log_std}")


@dataclass(frozen=True)
class DrQConfig(SACConfig):
    """DrQ; the defaults are the 2022 code's, but for its encoder and its mask, which was 0 on every step."""

    name: str = "drq"
    kind: ClassVar[str] = "drq"
    learner: ClassVar[str] = "experiments.algorithms.drq:DrQ"

    num_envs: int = 1
    temperature: float = 0.1
    encoder: str = "keypoints"  # the CNN that reads frames
    precision: str = "auto"  # of the CNN: bf16, fp32; auto: bf16 where the processor is made for it
    projection: int = 50  # numbers of the representation that policy and critics, each by its own layer, keep
    shift: int = 4  # pixels by which frames are moved at most

    def __post_init__(self) -> None:
        super().__post_init__()
        require_encoder("algorithm.encoder", self.encoder)
        require_known("algorithm.precision", self.precision, PRECISIONS)
        require(self.projection >= 1, "algorithm.projection", self.projection, "at least 1")
        require(self.shift >= 0, "algorithm.shift", self.shift, "0 or more")


def require_encoder(place: str, name: str) -> None:
    """Raises :class:`ConfigError` unless ``name`` is that of a CNN, ``mlp``, or ``module:function``."""
    if ":" not in name:
        require_known(place, name, (*CNNS, "mlp"))


KINDS: Mapping[str, type[AlgorithmConfig]] = {
    cls.kind: cls for cls in (PPOConfig, RecurrentPPOConfig, CURLConfig, SPRConfig, SACConfig, DrQConfig)
}


def kind_of(cls: type[AlgorithmConfig]) -> str:
    """The short name of a built-in algorithm; the import path, such as ``my_lab.mine.MineConfig``, of any other."""
    return cls.kind if is_built_in(cls) else f"{cls.__module__}.{cls.__qualname__}"


def is_built_in(cls: type[AlgorithmConfig]) -> bool:
    """Whether the class stands in :data:`KINDS`; a sub-class of one that does has its ``kind`` but is another algorithm."""
    return KINDS.get(getattr(cls, "kind", "")) is cls


def named_class(cls: type[AlgorithmConfig]) -> dict[str, str]:
    """The setting that names the class in plain data: ``kind`` of a built-in algorithm, ``_target_`` of any other."""
    return {"kind" if is_built_in(cls) else TARGET: kind_of(cls)}


def algorithm_class(settings: Mapping[str, Any]) -> type[AlgorithmConfig]:
    """The class that ``_target_``, or else ``kind``, names in the settings of an algorithm; PPO's where neither does.

    Raises:
        ConfigError: there is no such class, or it is no sub-class of :class:`AlgorithmConfig`.
    """
    target = settings.get(TARGET)
    if target is None:
        require_known("algorithm.kind", settings.get("kind", PPOConfig.kind), tuple(KINDS))
        return KINDS[settings.get("kind", PPOConfig.kind)]
    module, _, name = str(target).rpartition(".")
    cls = import_object(f"{module}:{name}", f"algorithm.{TARGET}")
    if not (isinstance(cls, type) and issubclass(cls, AlgorithmConfig)):
        raise ConfigError(f"algorithm.{TARGET}: '{target}' is not a sub-class of experiments.settings.AlgorithmConfig")
    if ":" not in getattr(cls, "learner", ""):
        raise ConfigError(f"algorithm.{TARGET}: {target} names no learner; write learner = 'module:Class' in the class")
    return cls
