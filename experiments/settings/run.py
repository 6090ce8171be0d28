"""The settings of a run: frozen dataclasses in which every default lives once.

YAML under ``conf/`` says only what differs. :func:`run_config` turns plain data (Hydra's result, or a run folder's
``config.yaml``) into a :class:`RunConfig`; nothing after it sees a ``DictConfig``.
"""

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any, ClassVar

from segar.experiments.settings.algorithms import (
    ADDED_LATER,
    KINDS,
    NAMES_OF_CLASS,
    AlgorithmConfig,
    PPOConfig,
    added_later,
    named_class,
)
from segar.experiments.settings.checks import (
    ENDLESS,
    Count,
    CountFrom0,
    LevelCount,
    NotNegative,
    Seed,
    Settings,
    one_of,
    require,
    require_design,
    require_known,
    that,
)
from segar.experiments.settings.curricula import CURRICULA, CurriculumConfig
from segar.experiments.settings.own_code import is_level_file, without_folder
from segar.experiments.settings.processor import multiplies_bf16
from segar.levels import TASK_LEVELS, families, family
from segar.suites import suites
from segar.support import object_name

ACTION_MODES = ("deterministic", "sampled")  # of evaluation
TRACKERS = ("mlflow", "none")
DIFFICULTIES = ("easy", "medium", "hard")
OWN_TASK = "levels"  # the task.name that means the task of the training levels
FIRST_OF_STREAM = 100  # levels of an endless stream that agents are evaluated on
OWN_CLASSES: Mapping[str, tuple[type[Any], Mapping[str, Any]]] = {
    "algorithm": (AlgorithmConfig, KINDS),
    "curriculum": (CurriculumConfig, CURRICULA),
}
"""The groups whose settings are of a class, which may be one's own: what it is a sub-class of, and those that are built in."""
DEFAULT_TASK = "puttputt"  # of levels that name none


def require_family(place: str, name: str) -> None:
    """Raises :class:`ConfigError` unless ``name`` is a family that comes in several difficulties, or a single distribution."""
    if not is_distribution(name):
        require_known(place, name, (panel.rpartition("-")[0] for panel in families()))


def named_distributions() -> tuple[str, ...]:
    """The names that SEGAR gives to level distributions: families with their difficulties, levels of tasks, suites."""
    return (*families(), *TASK_LEVELS, *suites())


def is_distribution(name: str) -> bool:
    """Whether ``name`` is that of one level distribution (``empty-hard``, ``billiards``, ``module:attribute``, a level file)
    rather than of a family, which has several difficulties."""
    return name in named_distributions() or is_level_file(name) or object_name(name) is not None


Family = Annotated[str, require_family]
Difficulty = Annotated[str, one_of(*DIFFICULTIES)]
Design = Annotated[str, require_design]
ActionMode = Annotated[str, one_of(*ACTION_MODES)]
Distance = Annotated[str, one_of("exact", "reference", "paper")]  # the modes of segar.metrics.w2
Tracker = Annotated[str, one_of(*TRACKERS)]
Determinism = Annotated[str, one_of("machine", "portable")]
Stale = Annotated[str, one_of("refuse", "keep", "anew")]
# What determinism=portable allows, of the settings that algorithms may have.
PORTABLE_SETTINGS = {"precision": ("auto", "fp32"), "device": ("cpu",), "compile": (False,), "core": ("gru",)}
ADDRESS = "an address such as sqlite:////path/mlflow.db or http://host:5000"
Address = Annotated[str | None, that(lambda uri: uri is None or "://" in uri, ADDRESS)]


@dataclass(frozen=True)
class LevelsConfig(Settings):
    """Where the levels come from: a family's name, ``module:attribute`` or ``file.py:attribute`` for a distribution of your
    own, or a level file (``.npz`` or ``.json``), of which seed 0 takes the first levels and other seeds some that are drawn."""

    group: ClassVar[str] = "levels"

    train: str = "empty-hard"
    test: str | None = None  # None: the same as train; another one makes the test out of distribution
    count: LevelCount = 10  # training levels; endless: each episode is on another one
    seed: Seed = 0  # which training levels; a smaller count takes the first ones
    design: Design = "iid"  # how the training levels are picked from their distribution
    variation: str = ""  # of both distributions: a name in segar.experiments.levels.variations, or ``module:function``
    test_variation: str | None = None  # None: the same
    test_count: Count = 100
    test_seed: Seed = 0  # which test levels; of another random stream than training levels
    world: str | None = added_later(None)  # the rules of level files that were saved with rules of their own

    def __post_init__(self) -> None:
        super().__post_init__()
        iid = "iid where levels.count is endless: a design picks levels, and a stream has all of them"
        require(not self.is_endless or self.design == "iid", "levels.design", self.design, iid)

    @property
    def is_endless(self) -> bool:
        """Whether training levels come without end."""
        return self.count == ENDLESS

    @property
    def number(self) -> int:
        """How many training levels there are; of an endless stream, how many of the first ones agents are evaluated on."""
        return FIRST_OF_STREAM if self.count == ENDLESS else int(self.count)

    @property
    def test_distribution(self) -> str:
        """The distribution that test levels come from."""
        return self.test or self.train

    def named(self, which: str) -> tuple[str, str]:
        """The names of the distribution and of the variation of the ``"train"`` or the ``"test"`` levels."""
        if which == "train":
            return self.train, self.variation
        return self.test_distribution, self.variation if self.test_variation is None else self.test_variation


@dataclass(frozen=True)
class TaskConfig(Settings):
    """What the agent is asked to do: ``levels`` for the task of the training levels, a task's name, or ``module:attribute``."""

    group: ClassVar[str] = "task"

    name: str = OWN_TASK
    options: Mapping[str, Any] = field(default_factory=dict)  # keyword arguments, e.g. reward, max_steps, sub_steps


@dataclass(frozen=True)
class ObservationConfig(Settings):
    """What the agent sees: ``state``, ``rgb``, ``textures``, or ``module:attribute``."""

    group: ClassVar[str] = "observation"

    name: str = "state"
    options: Mapping[str, Any] = field(default_factory=dict)  # keyword arguments, where a class or function is named


@dataclass(frozen=True)
class ScaleConfig(Settings):
    """How much is run: the frames of a training run, and the cells of the reproduction."""

    group: ClassVar[str] = "scale"

    name: str = "single"
    frames: Count = 200_000
    families: tuple[Family, ...] = ("empty", "objectsx1", "tilesx1")
    difficulties: tuple[Difficulty, ...] = DIFFICULTIES
    counts: tuple[Count, ...] = (1, 10, 50, 100, 200)
    seeds: Count = 1  # how many, from ``seed`` upwards


@dataclass(frozen=True)
class EvaluationConfig(Settings):
    """How a trained agent is measured."""

    group: ClassVar[str] = "evaluation"

    episodes: Count = 100  # on training levels, at least; each level is played equally often
    seed: Seed = 0  # of sampled actions
    interval: CountFrom0 = 0  # frames between evaluations on the test levels while training; 0: only at the end
    distances: tuple[Distance, ...] = ("reference", "exact")  # Wasserstein-2 between training and test levels


@dataclass(frozen=True)
class TrackingConfig(Settings):
    """Where figures are shown: MLflow, or nowhere but in the run folder."""

    group: ClassVar[str] = "tracking"

    name: Tracker = "mlflow"
    uri: Address = None  # None: SQLite, <root>/mlflow.db
    experiment: str = "segar"
    sweep: str = ""  # a tag that the runs of one sweep share
    interval: NotNegative = 5.0  # [s] between batches


@dataclass(frozen=True)
class RunConfig(Settings):
    """One training run, whole."""

    levels: LevelsConfig = field(default_factory=LevelsConfig)
    task: TaskConfig = field(default_factory=TaskConfig)
    observation: ObservationConfig = field(default_factory=ObservationConfig)
    algorithm: AlgorithmConfig = field(default_factory=PPOConfig)
    scale: ScaleConfig = field(default_factory=ScaleConfig)
    evaluation: EvaluationConfig = field(default_factory=EvaluationConfig)
    tracking: TrackingConfig = field(default_factory=TrackingConfig)
    # Episodes in a row on each level, between which policies with a memory keep it, in training and in evaluation.
    trials: Count = added_later(1)
    seed: Seed = 0  # of training: weights, actions, order of levels
    root: str | None = None  # where run folders are made; None: runs/ of the checkout
    folder: str | None = None  # the run folder; None: named by its settings, under root
    module_path: tuple[str, ...] = ()  # where modules of the settings lie that are not installed; run folders record it
    resume: bool = True  # go on with an unfinished run that the run folder holds; false: refuse to
    restart: bool = False  # throw away what the run folder holds
    stale: Stale = "refuse"  # a finished run by other code than today's: "keep" its results, or train it "anew"
    num_threads: Count = 1  # of the engine and of torch; the last bits of weights depend on it, by the order of sums
    checkpoint_interval: NotNegative = 60.0  # [s] between checkpoints
    progress: bool = True
    # "machine": the fastest kernels for this processor. "portable": float32, one thread of torch, and kernels that all
    # x86-64 processors with AVX2 have, for the same weights on unlike processors.
    determinism: Determinism = added_later("machine")
    # What chooses the levels that episodes of training begin on; None: they are drawn alike.
    curriculum: CurriculumConfig | None = added_later(None)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, allowed in PORTABLE_SETTINGS.items() if self.determinism == "portable" else ():
            value = getattr(self.algorithm, name, allowed[0])
            wanted = " or ".join(map(str, allowed)) + ", because determinism=portable allows nothing else"
            require(value in allowed, f"algorithm.{name}", value, wanted)

    def resolved(self) -> "RunConfig":
        """The same settings with the task of named levels by its name.

        Of levels of the user's own, ``task.name`` stays ``levels``: their code or their file says which task it is.
        """
        if self.task.name != OWN_TASK or self.levels.train not in (*families(), *TASK_LEVELS):
            return self
        name = family(self.levels.train).task or DEFAULT_TASK
        return dataclasses.replace(self, task=dataclasses.replace(self.task, name=name))

    def computed_here(self) -> "RunConfig":
        """The same settings with the precision that ``auto`` means on this machine; no name is made from them."""
        if getattr(self.algorithm, "precision", None) != "auto":
            return self
        device = getattr(self.algorithm, "device", "cpu").partition(":")[0]
        half = self.determinism == "machine" and multiplies_bf16(device)
        return self.with_precision("bf16" if half else "fp32")

    def takes_no_step(self) -> bool:
        """Whether training changes no weight: the learning rate is lowered to 0, which it is in the only iteration."""
        ppo = self.algorithm
        return isinstance(ppo, PPOConfig) and ppo.anneal and self.scale.frames <= ppo.num_envs * ppo.num_steps

    def with_precision(self, precision: str) -> "RunConfig":
        """The same settings with another ``algorithm.precision``."""
        return dataclasses.replace(self, algorithm=dataclasses.replace(self.algorithm, precision=precision))  # type: ignore[call-arg]

    def identity(self) -> dict[str, Any]:
        """The settings that decide the results, as plain data; where files go or what is printed is not among them.

        They are :meth:`resolved`. They are the same on all machines: ``auto`` stays ``auto``, and bfloat16, which it meant
        when the shipped runs got their names, is called so, too. So is a GPU called ``cpu``, because where a run was
        computed is a fact of the run, as its processor is. The run folder says which precision and which device it was.
        """
        data = as_data(self.resolved(), without_later_defaults=True)
        algorithm = {key: value for key, value in data["algorithm"].items() if key not in NAMES_OF_CLASS}
        names = ("levels", "task", "observation", "curriculum", "evaluation", "trials", "seed", "determinism")
        parts = {key: data[key] for key in names if key in data}
        for name in ("train", "test"):
            parts["levels"][name] = without_folder(parts["levels"][name] or "") or None
        if algorithm.get("precision") == "bf16":
            algorithm["precision"] = "auto"
        if "device" in algorithm:
            algorithm["device"] = "cpu"
        algorithm.pop("env_device", None)
        (kind,) = named_class(type(self.algorithm), KINDS).values()
        return {**parts, "algorithm": {"kind": kind, **algorithm}, "frames": self.scale.frames}

    @cached_property
    def hash(self) -> str:
        """Eight hexadecimal digits that are equal for equal :meth:`identity`."""
        return digest(self.identity())

    def label(self) -> str:
        """The run's name, e.g. ``empty-hard-n10-state-ppo_fast-s1-3f9a12cd``."""
        levels = "-to-".join(without_folder(name) for name in (self.levels.train, self.levels.test) if name)
        special = (self.levels.variation, self.levels.design if self.levels.design != "iid" else "")
        levels = "-".join((levels, *(name for name in special if name)))
        count, curriculum = f"n{self.levels.count}", () if self.curriculum is None else (self.curriculum.name,)
        parts = (levels, count, self.observation.name, self.algorithm.name, *curriculum, f"s{self.seed}")
        return "-".join((*map(plain_name, parts), self.hash))


def plain_name(text: str) -> str:
    """The text with _ in place of all characters that a name of a folder should not have."""
    return "".join(c if c.isalnum() or c in "_-." else "_" for c in text)


def digest(data: Any) -> str:
    """Eight hexadecimal digits that are equal for equal plain data."""
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:8]


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
            known = next((kinds for base, kinds in OWN_CLASSES.values() if isinstance(value, base)), None)
            return content if known is None else {**named_class(type(value), known), **content}
        if isinstance(value, Mapping):
            return {key: plain(v) for key, v in value.items()}
        return [plain(v) for v in value] if isinstance(value, tuple | list) else value

    return plain(config)
