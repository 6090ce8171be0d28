"""The settings of ``segar evaluate``."""

from dataclasses import dataclass
from typing import Annotated

from segar.experiments.settings.checks import Count, Samples, Seed, Settings, one_of, that
from segar.experiments.settings.run import ACTION_MODES, ActionMode
from segar.support import EVERYTHING

Modes = Annotated[tuple[ActionMode, ...], that(bool, f"one or more of {', '.join(ACTION_MODES)}")]
Split = Annotated[str, one_of("train", "test")]
Videos = Annotated[str, one_of("mp4", "gif", "none")]


@dataclass(frozen=True)
class EvaluateConfig(Settings):
    """Which agent plays which levels, and what is made of it."""

    run: str  # a run folder, finished or not
    levels: str = "test"  # train, test, a family, module:attribute, or a level file
    n: Count | None = None  # how many levels; None: 100 of a distribution, all of a set
    seed: Seed = 0  # which levels of a distribution; also of the actions of the sampled policy
    split: Split = "test"  # of a distribution: test and train are different random streams
    world: str | None = None  # rules for a level file that was saved with rules of its own, as module:attribute
    episodes: Count = 1  # on each level; one with deterministic actions where neither world nor observation is random
    modes: Modes = ACTION_MODES
    scores: bool = True  # 0 is the better of idle and random play on each level, 1 the best known return, of a planner
    planner_samples: Samples = 64  # candidates per level and round of its search, which takes 0.1 s per level
    planner_iterations: Count = 5  # rounds of its search; more of both make scores above 1 less likely
    videos: Videos = "mp4"  # of the best, the median and the worst level; or gif, or none
    out: str | None = None  # folder of the results; None: evaluations/ of the run folder, named by the levels
    twins: bool = False  # also play the causal twins of the test levels, and tell what failures come from
    num_threads: Count = 1
    portable: bool = False  # play by compiled functions, with the same bits on every processor, instead of by torch
    trust: bool = False  # import the modules that a run folder of somebody else's names

    @property
    def trusted(self) -> tuple[str, ...]:
        """The packages whose code a run folder may bring in."""
        return (EVERYTHING,) if self.trust else ()
