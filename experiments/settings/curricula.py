"""The settings of curricula, without torch: a dataclass for each kind, and the kinds by name."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from segar.experiments.settings.algorithms import NAMES_OF_CLASS, class_of
from segar.experiments.settings.checks import Count, Positive, Samples, Settings, Share, Window, one_of, require
from segar.experiments.settings.errors import ConfigError

NO_CURRICULUM = "none"
SCORES = ("value_l1", "positive_value_loss", "max_mc", "regret")  # see segar.experiments.curricula.scores

Score = Annotated[str, one_of(*SCORES)]


@dataclass(frozen=True)
class CurriculumConfig(Settings):
    """The settings that all curricula share; each curriculum adds its own in a sub-class.

    A curriculum of your own is such a sub-class in your package. A YAML file names it by ``_target_``, its import path.
    """

    group: ClassVar[str] = "curriculum"
    chooser: ClassVar[str]  # "module:Class" of what chooses levels; see segar.experiments.curricula.curriculum
    needs_scores: ClassVar[bool] = True  # whether it learns from the rollouts of an on-policy algorithm
    needs_stream: ClassVar[bool] = False  # whether it plays levels beyond any fixed set, so that they must be endless

    name: str
    log_interval: Count = 50_000  # frames between two lines about the levels that were played


@dataclass(frozen=True)
class UniformConfig(CurriculumConfig):
    """Every level of a fixed set equally often, or every level of an endless stream once."""

    name: str = "uniform"
    chooser: ClassVar[str] = "segar.experiments.curricula.uniform:Uniform"
    needs_scores: ClassVar[bool] = False


@dataclass(frozen=True)
class ReplayConfig(CurriculumConfig):
    """How levels are scored and replayed, as prioritised level replay has it (Jiang et al. 2021)."""

    name: str = "replay"
    score: Score = "positive_value_loss"
    temperature: Positive = 0.1  # beta: the k-th best level is replayed in proportion to (1 / k)^(1 / beta)
    staleness: Share = 0.1  # rho: share of replays that go to levels in proportion to the time since they were played
    replay: Window = 0.5  # share of episodes on levels that were scored before; the others are on new ones
    capacity: Count = 256  # levels of an endless stream that are kept
    min_scored: Share = 0.5  # share of these, or of the fixed set, that is scored before any level is replayed
    # Of score=regret: candidates of the planner's search per level and iteration, and its iterations.
    planner_samples: Samples = 16
    planner_iterations: Count = 4


@dataclass(frozen=True)
class PLRConfig(ReplayConfig):
    """PLR; the defaults are those of Jiang et al. (2021) for Procgen, but for the score."""

    name: str = "plr"
    chooser: ClassVar[str] = "segar.experiments.curricula.plr:PLR"


@dataclass(frozen=True)
class RobustPLRConfig(ReplayConfig):
    """Robust PLR (Jiang et al. 2021b): new levels are only scored, and the agent learns on replayed levels alone."""

    name: str = "plr_robust"
    chooser: ClassVar[str] = "segar.experiments.curricula.robust_plr:RobustPLR"
    needs_stream: ClassVar[bool] = True

    temperature: Positive = 0.3
    staleness: Share = 0.3
    batch: Count = 128  # levels that are tried side by side, at a time
    counts_tried: bool = True  # whether steps in which levels are tried are counted among the frames of the run


@dataclass(frozen=True)
class ACCELConfig(RobustPLRConfig):
    """ACCEL (Parker-Holder et al. 2022): robust PLR, in which replayed levels are mutated, too."""

    name: str = "accel"
    chooser: ClassVar[str] = "segar.experiments.curricula.accel:ACCEL"

    replay: Window = 0.8
    children: Positive = 1.0  # mutated levels that are tried per replayed episode
    changes: Count = 1  # of a mutated level


@dataclass(frozen=True)
class SFLConfig(CurriculumConfig):
    """SFL (Rutherford et al. 2024): levels of high learnability, p (1 - p) of the share p of episodes that succeed."""

    name: str = "sfl"
    chooser: ClassVar[str] = "segar.experiments.curricula.sfl:SFL"

    interval: Count = 50_000  # frames between two choices
    candidates: Count = 128  # levels that are tried at each; of a fixed set, all
    episodes: Count = 4  # on each of them, with sampled actions
    kept: Count = 32  # levels of the highest learnability that are trained on until the next choice
    share: Share = 0.5  # of episodes on these levels; the others are on levels as they come
    batch: Count = 64  # episodes that are tried side by side
    counts_tried: bool = True  # whether their steps are counted among the frames of the run

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.kept <= self.candidates, "curriculum.kept", self.kept, f"at most candidates, {self.candidates}")


# By their default names, which never change, because names of runs hold them.
CURRICULA: Mapping[str, type[CurriculumConfig]] = {
    cls.name: cls for cls in (UniformConfig, PLRConfig, RobustPLRConfig, ACCELConfig, SFLConfig)
}


def curriculum_class(settings: Mapping[str, Any]) -> type[CurriculumConfig] | None:
    """The class that ``_target_``, or else ``kind``, names in the settings of a curriculum; None where there is none.

    Raises:
        ConfigError: there is no such class, or it is no sub-class of :class:`CurriculumConfig`.
    """
    if not any(settings.get(name) for name in NAMES_OF_CLASS) and settings.get("name", NO_CURRICULUM) == NO_CURRICULUM:
        if extra := [key for key in settings if key not in ("name", *NAMES_OF_CLASS)]:
            raise ConfigError(f"curriculum.{extra[0]}: there is no curriculum; choose one, such as curriculum=plr")
        return None
    return class_of(settings, CurriculumConfig, CURRICULA, settings.get("name"))
