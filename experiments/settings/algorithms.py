"""The settings of the algorithms, without torch: a dataclass for each kind, and the kinds by name."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, TypeVar

from segar.experiments.settings.checks import (
    Count,
    CountFrom0,
    NotNegative,
    Positive,
    PositiveOrNull,
    Settings,
    Share,
    Widths,
    Window,
    one_of,
    one_or_own,
    require,
    require_known,
    that,
)
from segar.experiments.settings.own_code import class_named

T = TypeVar("T")

# The CNNs that have a name: functions in segar.experiments.networks.encoders.
CNNS = ("small", "keypoints", "nature", "impala", "impala_15", "cnn_2022")
# Changes of frames that DrAC knows: entries of segar.experiments.algorithms.drac.AUGMENTATIONS.
AUGMENTATIONS = ("crop", "greyscale", "cutout", "cutout_colour", "random_conv", "colour_jitter", "flip", "rotate")
TARGET = "_target_"  # as in Hydra: the setting that holds an import path
NAMES_OF_CLASS = ("kind", TARGET)  # settings that name the class of an algorithm


Precision = Annotated[str, one_of("auto", "bf16", "fp32")]
RewardTransform = Annotated[str, one_of("none", "sqrt")]
Encoder = Annotated[str, one_or_own((*CNNS, "mlp"))]
EnvDevice = Annotated[str, one_of("cpu", "cuda")]
Core = Annotated[str, one_of("gru", "lstm")]
PredictionModel = Annotated[str, one_of("action_projection", "transition")]
Augmentation = Annotated[str, one_of(*AUGMENTATIONS)]
Tau = Annotated[float, that(lambda x: 0 < x <= 0.5, "more than 0, and at most 0.5")]
TauOr1 = Annotated[float, that(lambda x: 0 < x <= 0.5 or x == 1, "more than 0 and at most 0.5, or 1")]

ADDED_LATER = "added later"


def added_later(default: Any) -> Any:
    """A field for a setting that was added after runs had been made without it.

    At its default it is not part of a run's identity, so that those runs keep their names.
    """
    return field(default=default, metadata={ADDED_LATER: True})


@dataclass(frozen=True)
class AlgorithmConfig(Settings):
    """The settings that all algorithms share; each algorithm adds its hyper-parameters in a sub-class.

    An algorithm of your own is such a sub-class in your package. A YAML file names it by ``_target_``, its import path.
    """

    group: ClassVar[str] = "algorithm"
    learner: ClassVar[str]  # "module:Class" of the class that learns; see segar.experiments.algorithms.learner

    name: str
    num_envs: Count = 64


@dataclass(frozen=True)
class PPOConfig(AlgorithmConfig):
    """PPO; the defaults are the paper's (Table 1), and the 2022 code's where the table is silent."""

    name: str = "ppo"
    learner: ClassVar[str] = "segar.experiments.algorithms.ppo:PPO"

    num_steps: Count = 30  # per environment and update
    epochs: Count = 1
    minibatches: Count = 4
    steps_together: int = 1  # successive steps of an environment that are in one minibatch: their stacks share frames
    learning_rate: Positive = 1e-4
    anneal: bool = False  # lower the learning rate linearly to zero, which it is in the last iteration
    adam_eps: Positive = 1e-5
    gamma: Share = 0.999
    gae_lambda: Share = 0.95
    clip: Positive = 0.2
    clip_value: PositiveOrNull = 0.2  # in units of scaled return; None: the value loss is not clipped
    entropy_coef: NotNegative = 3e-4
    critic_coef: NotNegative = 0.1  # of half the squared error
    max_grad_norm: Positive = 10.0
    # What the learner sees of rewards: see experiments/collection/rewards.py.
    reward_transform: RewardTransform = "none"
    reward_scale: Positive = 1.0  # times this
    reward_normalise: bool = False  # and divided by the standard deviation of discounted returns so far
    encoder: Encoder = "impala"  # the CNN that reads frames; mlp: frames are refused. Vectors are read by an MLP
    widths: Widths = (256, 256)  # of that MLP; the last one is the representation's
    precision: Precision = "auto"  # of the CNN: bf16, fp32; auto: bf16 where the processor is made for it
    head_width: CountFrom0 = 256  # of the hidden layer of each head; 0: heads are linear
    shared: bool | None = True  # one encoder for policy and value, or one each; null: they share a CNN, but no MLP
    initial_std: Positive = 1.0  # of the policy, before tanh
    min_log_std: float = -3.0
    max_log_std: float = 2.0
    device: str = "cpu"  # where networks compute: cpu, cuda, cuda:1
    # Collect the next rollout, with the present weights, while learning from this one.
    overlap: bool = added_later(False)
    compile: bool = added_later(False)  # the loss, by torch.compile; on a GPU it is replayed as CUDA graphs
    # Where environments run: cpu, or cuda, which is the GPU of ``device``.
    env_device: EnvDevice = added_later("cpu")

    def __post_init__(self) -> None:
        super().__post_init__()
        check_env_device(self)
        ahead = "false where env_device is cuda: environments on a GPU do not collect ahead"
        require(not (self.overlap and self.env_device == "cuda"), "algorithm.overlap", self.overlap, ahead)
        check_log_std(self.min_log_std, self.max_log_std)
        steps = self.num_envs * self.num_steps
        together = self.steps_together
        divides = together >= 1 and self.num_steps % together == 0
        # Advantages are normalised within a minibatch, and a single one has no variance.
        check_minibatches(self, steps // 2, f"at most half the batch, {steps // 2}")
        require(divides, "algorithm.steps_together", together, f"a divisor of num_steps, {self.num_steps}")
        pieces = steps // together
        check_minibatches(self, pieces, f"at most the {pieces} pieces of steps_together={together}")


@dataclass(frozen=True)
class RecurrentPPOConfig(PPOConfig):
    """PPO's settings and those of the memory."""

    name: str = "ppo_recurrent"
    learner: ClassVar[str] = "segar.experiments.algorithms.recurrent_ppo:RecurrentPPO"

    core: Core = "gru"  # or lstm
    core_width: Count = 128  # numbers that the heads read
    # Of several trials on a level: whether returns go on over them, as in RL², or end with each one.
    joins_trials: bool = added_later(True)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_minibatches(
            self, self.num_envs, f"at most num_envs, {self.num_envs}: a minibatch is made of whole environments"
        )
        require(self.shared is not False, "algorithm.shared", self.shared, "true: policy and value read one memory")
        untraced = "false: torch cannot trace TorchRL's recurrent layers"
        require(not self.compile, "algorithm.compile", self.compile, untraced)


@dataclass(frozen=True)
class AuxiliaryConfig(PPOConfig):
    """What all auxiliary losses share, beside PPO's settings."""

    name: str = "auxiliary"
    auxiliary_minibatches: int = 4  # gradient steps after each of PPO's updates, which has epochs x minibatches steps
    auxiliary_learning_rate: PositiveOrNull = None  # of an Adam of its own; null: PPO's Adam, with its state
    tau: TauOr1 = 0.01  # share of the encoder that enters the target encoder after each such step; 1: they are one
    crop: Window = 1.0  # frames are cut to a random window of this share of their sides, and enlarged again
    shift: CountFrom0 = 0  # frames are moved by up to this many pixels
    intensity: NotNegative = 0.0  # brightness changes by a factor of this deviation

    def __post_init__(self) -> None:
        super().__post_init__()
        most = self.num_envs * self.num_steps // 2  # a contrast needs two frames
        steps, wanted = self.auxiliary_minibatches, f"from 1 to half a rollout's frames, {most}"
        require(1 <= steps <= most, "algorithm.auxiliary_minibatches", steps, wanted)


@dataclass(frozen=True)
class CURLConfig(AuxiliaryConfig):
    """CURL; the defaults are the paper's protocol, with a window for every frame instead of one for all of a batch."""

    name: str = "curl"
    learner: ClassVar[str] = "segar.experiments.algorithms.curl:CURL"

    crop: Window = 0.8
    projection: CountFrom0 = 0  # numbers that a normalised dense layer makes for comparing; 0: the representation's own


@dataclass(frozen=True)
class SPRConfig(AuxiliaryConfig):
    """SPR; the defaults are the paper's protocol, on sequences of all environments that end with their episode."""

    name: str = "spr"
    learner: ClassVar[str] = "segar.experiments.algorithms.spr:SPR"

    crop: Window = 0.8
    horizon: int = 1  # steps that are predicted
    model: PredictionModel = "action_projection"  # of 2022, for one step; or transition, of Schwarzer et al.
    model_width: Count = 256
    weight: Positive = 1.0  # of the loss

    def __post_init__(self) -> None:
        super().__post_init__()
        most = 1 if self.model == "action_projection" else self.num_steps - 1
        require(1 <= self.horizon <= most, "algorithm.horizon", self.horizon, f"from 1 to {most}")
        starts = (self.num_steps - self.horizon) * self.num_envs
        steps, wanted = self.auxiliary_minibatches, f"at most the number of sequences in a rollout, {starts}"
        require(steps <= starts, "algorithm.auxiliary_minibatches", steps, wanted)


@dataclass(frozen=True)
class DrACConfig(PPOConfig):
    """DrAC; with several augmentations it is UCB-DrAC. The defaults of what it adds to PPO are its authors'."""

    name: str = "drac"
    learner: ClassVar[str] = "segar.experiments.algorithms.drac:DrAC"

    # The changes among which the upper confidence bound chooses. Those that flip or rotate frames are left out, because
    # they change which action is right.
    augmentations: tuple[Augmentation, ...] = AUGMENTATIONS[:6]
    invariance_coef: NotNegative = 0.1  # alpha_r, of the change of the policy and of the value under an augmentation
    augmented_share: Window = 1.0  # of each minibatch, on which both changes are measured
    shift: Count = 12  # pixels by which "crop" moves frames at most
    ucb_exploration: NotNegative = 0.1  # c, in units of the learner's returns
    ucb_window: Count = 10  # K, the rollouts after an augmentation whose returns say what it is worth

    def __post_init__(self) -> None:
        super().__post_init__()
        untraced = "false: torch cannot trace how keypoints are found in augmented frames"
        require(not self.compile, "algorithm.compile", self.compile, untraced)
        named = self.augmentations
        holds = 0 < len(set(named)) == len(named)
        require(holds, "algorithm.augmentations", list(named), f"one or more of {', '.join(AUGMENTATIONS)}, each once")


@dataclass(frozen=True)
class PPGConfig(PPOConfig):
    """PPG; the defaults of what it adds to PPO are its authors'."""

    name: str = "ppg"
    learner: ClassVar[str] = "segar.experiments.algorithms.ppg:PPG"

    shared: bool | None = False  # always: that policy and value have networks of their own is what PPG is about
    phase: Count = 32  # N_pi, rollouts from one auxiliary phase to the next
    auxiliary_epochs: Count = 6  # E_aux
    auxiliary_minibatches: Count = 16  # of each epoch, for each rollout of the phase
    auxiliary_learning_rate: Positive = 5e-4  # of an Adam of its own; annealed where learning_rate is
    clone_coef: NotNegative = 1.0  # beta_clone, of the KL from the policy before the auxiliary phase

    def __post_init__(self) -> None:
        super().__post_init__()
        own = "false: policy and value have networks of their own"
        require(self.shared is False, "algorithm.shared", self.shared, own)
        pieces = self.num_envs * self.num_steps // self.steps_together
        most = f"at most the {pieces} pieces of steps_together={self.steps_together} in a rollout"
        parts = self.auxiliary_minibatches
        require(parts <= pieces, "algorithm.auxiliary_minibatches", parts, most)


@dataclass(frozen=True)
class OffPolicyConfig(AlgorithmConfig):
    """How steps and gradient steps alternate, and what is remembered."""

    name: str = "off_policy"
    num_envs: Count = 4
    num_steps: Count = 64  # per environment and iteration, which is what figures are averaged over
    warmup: int = 1000  # environment steps with uniformly random actions, before anything is learned
    steps_per_update: Count = 1  # environment steps per gradient step
    batch_size: Count = 256
    capacity: int = 100_000  # rows of the replay: steps, and last observations of episodes
    learning_rate: Positive = 3e-4
    gamma: Share = 0.99
    tau: Tau = 0.005  # share of the weights that enters the target networks after each gradient step
    reward_transform: RewardTransform = "none"  # of the reward r that the learner sees; or sqrt: sign(r) |r|^1/2
    reward_scale: Positive = 1.0  # times this
    device: str = "cpu"  # where networks and replay live: cpu, cuda, cuda:1
    # Where environments run: cpu, or cuda, which is the GPU of ``device``.
    env_device: EnvDevice = added_later("cpu")

    def __post_init__(self) -> None:
        super().__post_init__()
        check_env_device(self)
        # Two steps of all environments, each with the last observations of its episodes: then one can be drawn.
        rows, steps = 4 * self.num_envs, 2 * self.num_envs
        require(self.capacity >= rows, "algorithm.capacity", self.capacity, f"at least {rows}, 4 x num_envs")
        require(self.warmup >= steps, "algorithm.warmup", self.warmup, f"at least 2 x num_envs, {steps}")


@dataclass(frozen=True)
class SACConfig(OffPolicyConfig):
    """SAC; the defaults are those of Haarnoja et al. (2018b) but for the number of environments and the replay."""

    name: str = "sac"
    learner: ClassVar[str] = "segar.experiments.algorithms.sac:SAC"

    widths: Widths = (256, 256)  # of the hidden layers of policy and critics
    temperature: Positive = 1.0  # of the entropy, at first; it is learned
    target_entropy: float = -2.0  # minus the number of actions
    min_log_std: float = -10.0
    max_log_std: float = 2.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_log_std(self.min_log_std, self.max_log_std)


@dataclass(frozen=True)
class DrQConfig(SACConfig):
    """DrQ; the defaults are the 2022 code's, but for its encoder and its mask, which was 0 on every step."""

    name: str = "drq"
    learner: ClassVar[str] = "segar.experiments.algorithms.drq:DrQ"

    num_envs: Count = 1
    temperature: Positive = 0.1
    encoder: Encoder = "keypoints"  # the CNN that reads frames
    precision: Precision = "auto"  # of the CNN: bf16, fp32; auto: bf16 where the processor is made for it
    projection: Count = 50  # numbers of the representation that policy and critics, each by its own layer, keep
    shift: CountFrom0 = 4  # pixels by which frames are moved at most


def check_log_std(lowest: float, highest: float) -> None:
    """Raises :class:`ConfigError` unless the range of the policy's log standard deviation is not empty."""
    require(lowest < highest, "algorithm.min_log_std", lowest, f"less than max_log_std, {highest}")


def check_env_device(config: PPOConfig | OffPolicyConfig) -> None:
    """Raises :class:`ConfigError` where environments are to run on a GPU and networks are not."""
    holds = config.env_device == "cpu" or config.device.partition(":")[0] == "cuda"
    wanted = f"cpu where algorithm.device is {config.device}: environments run on the GPU that networks compute on"
    require(holds, "algorithm.env_device", config.env_device, wanted)


def check_minibatches(config: PPOConfig, most: int, wanted: str) -> None:
    """Raises :class:`ConfigError` where there are more than ``most`` minibatches; ``wanted`` completes "it must be"."""
    require(config.minibatches <= most, "algorithm.minibatches", config.minibatches, wanted)


# By their default names, which never change, because names of runs hold them.
KINDS: Mapping[str, type[PPOConfig] | type[SACConfig]] = {
    cls.name: cls
    for cls in (PPOConfig, RecurrentPPOConfig, CURLConfig, SPRConfig, DrACConfig, PPGConfig, SACConfig, DrQConfig)
}


def named_class(cls: type[Any], known: Mapping[str, type[Any]]) -> dict[str, str]:
    """The setting that names a class in plain data: ``kind`` of a ``known`` one, ``_target_``, its import path, of any other.

    A sub-class of a known one has its ``kind`` but is another.
    """
    kind = getattr(cls, "name", "")
    return {"kind": kind} if known.get(kind) is cls else {TARGET: f"{cls.__module__}.{cls.__qualname__}"}


def class_of(settings: Mapping[str, Any], base: type[T], known: Mapping[str, type[T]], default: Any) -> type[T]:
    """The sub-class of ``base`` that ``_target_``, or else ``kind``, names in the settings of a group.

    Raises:
        ConfigError: there is no such class, or it is no sub-class of ``base``.
    """
    group, target = base.group, settings.get(TARGET)  # type: ignore[attr-defined]
    if target is not None:
        return class_named(str(target), base, f"{group}.{TARGET}")
    kind = settings.get("kind", default)
    require_known(f"{group}.kind", kind, known)
    return known[kind]


def algorithm_class(settings: Mapping[str, Any]) -> type[AlgorithmConfig]:
    """The class that the settings of an algorithm name, PPO's where they name none; see :func:`class_of`."""
    return class_of(settings, AlgorithmConfig, KINDS, PPOConfig.name)
