"""The settings of ``python -m experiments.evaluate``."""

from __future__ import annotations

from dataclasses import dataclass

from experiments.settings.checks import require, require_known, require_seed
from experiments.settings.run import ACTION_MODES

VIDEOS = ("mp4", "gif", "none")


@dataclass(frozen=True)
class EvaluateConfig:
    """Which agent plays which levels, and what is made of it."""

    run: str  # a run folder, finished or not
    levels: str = "test"  # train, test, a family, module:attribute, or a level file
    n: int | None = None  # how many levels; None: 100 of a distribution, all of a set
    seed: int = 0  # which levels of a distribution; also of the actions of the sampled policy
    split: str = "test"  # of a distribution: test never meets train, whatever the seeds
    world: str | None = None  # rules for a level file that was saved with rules of its own, as module:attribute
    episodes: int = 1  # on each level, by the sampled policy
    modes: tuple[str, ...] = ACTION_MODES
    scores: bool = True  # normalised between the random agent (0) and the oracle (1); takes 0.1 s per level
    videos: str = "mp4"  # of the best, the median and the worst level; or gif, or none
    out: str | None = None  # folder of the results; None: evaluations/ of the run folder, named by the levels
    num_threads: int = 1

    def __post_init__(self) -> None:
        require(self.n is None or self.n >= 1, "n", self.n, "at least 1")
        require(self.episodes >= 1, "episodes", self.episodes, "at least 1")
        require(bool(self.modes), "modes", list(self.modes), f"one or more of {', '.join(ACTION_MODES)}")
        require(self.num_threads >= 1, "num_threads", self.num_threads, "at least 1")
        require_seed("seed", self.seed)
        require_known("split", self.split, ("train", "test"))
        require_known("videos", self.videos, VIDEOS)
        for mode in self.modes:
            require_known("modes", mode, ACTION_MODES)
