"""The levels of one run while it is trained: environments, curriculum and log together."""

import copy
from collections.abc import Callable, Mapping
from itertools import islice
from typing import Any

import numpy as np
from torch import Tensor

from segar.envs import VectorEnv
from segar.experiments.collection.collector import Rollout
from segar.experiments.collection.saved_state import SavedState, arrays_in, tensors_in
from segar.experiments.curricula.curriculum import Curriculum
from segar.experiments.curricula.episodes import EpisodeSums
from segar.experiments.curricula.explorer import Explorer
from segar.experiments.curricula.level_rows import LevelRows
from segar.experiments.curricula.played_env import PlayedEnv
from segar.experiments.curricula.played_log import PlayedLog
from segar.experiments.levels.builders import Prepared
from segar.experiments.levels.endless import Stream, stream_of, target_of
from segar.experiments.settings import ConfigError, CurriculumConfig, RunConfig, UniformConfig, class_behind
from segar.levels import Levels

FIGURES = "curriculum/"  # begins the names of what curricula say of themselves


class TrainingLevels(SavedState):
    """What chooses the levels of a run, and what records them.

    Args:
        prepared: the run, which has a curriculum or endless levels.
        make_env: the learner's environments on levels.
        make_trial_env: so many environments on levels that are tried, of which nothing is reset by a step.

    Raises:
        ConfigError: curriculum, levels and algorithm do not fit each other.
    """

    saved, parts = ("steps", "lines"), ("log", "sums", "explorer")

    def __init__(
        self, prepared: Prepared, make_env: Callable[[Levels], Any], make_trial_env: Callable[[Levels, int], VectorEnv]
    ) -> None:
        config, (train, test) = prepared.config, prepared.level_sets
        settings = settings_of(config)
        assert settings is not None  # the caller has asked
        self.config: CurriculumConfig = settings
        kind: Any = class_behind(self.config, "chooser", Curriculum, "curriculum")
        stream = stream_of(prepared) if config.levels.is_endless else None
        check_fits(self.config, config, stream)
        levels = train if stream is None else stream.take(kind.rows_needed(self.config, config.algorithm.num_envs))
        env = make_env(levels)
        if not isinstance(env, VectorEnv):
            raise ConfigError(
                f"{place_of(config)}: {config.algorithm.name} makes its environments as {type(env).__name__}, and only the"
                " levels of segar.envs.VectorEnv can be chosen: its learner needs make_env"
            )
        options: Any = self.config
        batch = getattr(options, "batch", config.algorithm.num_envs)
        search = (getattr(options, "planner_samples", 16), getattr(options, "planner_iterations", 4))
        self.explorer = Explorer(make_trial_env, batch, search, config.seed)
        self.rows = LevelRows(env, stream)
        self.curriculum = kind(self.config, self.rows, self.explorer, config.seed)
        self.env = PlayedEnv(env, self.rows, self.curriculum)
        self.log = PlayedLog(train, target_of(prepared), test)
        self.sums: EpisodeSums | None = None
        self.steps = 0  # of all environments together, so many were taken note of
        self.lines = 0  # intervals that ended

    def connect(self, learner: Any) -> None:
        """Has the curriculum learn from the rollouts of a learner; raises :class:`ConfigError` where it has none."""
        if not self.config.needs_scores:
            return
        if not hasattr(learner, "listen"):
            raise ConfigError(
                f"curriculum: {self.config.name} scores levels by the advantages and values of on-policy rollouts, and"
                f" {type(learner).__name__} has none, because it learns from a replay. Choose PPO or recurrent PPO, or"
                " curriculum=uniform"
            )
        self.explorer.agent = learner
        self.sums = EpisodeSums(learner.config.num_envs, learner.config.gamma)
        learner.listen = self.listen

    def listen(self, rollout: Rollout, reward: Tensor, advantage: Tensor) -> None:
        """Tells the curriculum which episodes ended in a rollout."""
        assert self.sums is not None
        steps = list(islice(self.env.steps, len(rollout.done)))
        row, identity = (np.stack([getattr(step, name) for step in steps]) for name in ("row", "identity"))
        is_there = (row >= 0) & (self.rows.identity[row] == identity)
        self.curriculum.ended(self.sums.add(rollout, reward, advantage, np.where(is_there, row, -1)))

    def begin(self, learner: Any) -> Mapping[str, float]:
        """What a curriculum does before the first rollout; returns figures."""
        figures = self.advance(learner)
        if getattr(self.curriculum, "starts_anew", False):
            self.env.started = []
            self.explorer.agent.collector.restart()
        return figures

    def advance(self, learner: Any) -> Mapping[str, float]:
        """Lets the curriculum go on after an iteration of the learner, and logs what was played; returns figures."""
        steps = learner.frames // self.env.num_envs if self.explorer.agent is None else len(self.env.steps) + self.steps
        taken = min(steps - self.steps, len(self.env.steps))
        began = [part for _ in range(taken) for part in self.env.steps.popleft().began]
        self.steps = steps
        started, self.env.started = self.env.started, []
        self.log.add([*started, *began])
        tried, planned = self.explorer.steps, self.explorer.planned
        figures = dict(self.curriculum.advance(learner.frames))
        if tried < self.explorer.steps:
            figures["tried_frames"] = float(self.explorer.steps - tried)
            if self.explorer.agent is not None and getattr(self.config, "counts_tried", False):
                self.explorer.agent.frames += self.explorer.steps - tried
        if self.explorer.planned:
            figures["planned_episodes"] = float(self.explorer.planned - planned)
        figures = {f"{FIGURES}{name}": value for name, value in figures.items()}
        lines = learner.frames // self.config.log_interval
        if lines > self.lines:
            self.lines = lines
            figures |= self.log.line(learner.frames, self.scores())
        return figures

    def scores(self) -> dict[int, float]:
        """The scores of levels by identity, of curricula that say them."""
        found = self.curriculum.scores() if hasattr(self.curriculum, "scores") else np.zeros(0)
        return {int(self.rows.identity[row]): float(found[row]) for row in np.flatnonzero(~np.isnan(found))}

    def finish(self, frames: int) -> dict[str, float]:
        """Figures of the episodes since the last line, at the end of training."""
        return self.log.line(frames, self.scores())

    def state_dict(self) -> dict[str, Any]:
        """What lasts beside the environments, whose state holds the curriculum's: tensors and plain data."""
        return tensors_in(copy.deepcopy(super().state_dict()))

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Continues from ``state``; the lines of the log so far are not in it."""
        super().load_state_dict(arrays_in(dict(state)))


def settings_of(config: RunConfig) -> CurriculumConfig | None:
    """The curriculum of a run: uniform where levels are endless and none is chosen; None where levels need no choice."""
    return config.curriculum or (UniformConfig() if config.levels.is_endless else None)


def place_of(config: RunConfig) -> str:
    """The setting that asks for a choice of levels."""
    return "levels.count" if config.curriculum is None else "curriculum"


def check_fits(settings: CurriculumConfig, config: RunConfig, stream: Stream | None) -> None:
    """Raises :class:`ConfigError` where a curriculum does not fit levels or algorithm."""
    if settings.needs_stream and stream is None:
        raise ConfigError(
            f"curriculum: {settings.name} plays levels beyond any fixed set; give levels.count=endless, or choose"
            " curriculum=plr, which reweighs a fixed set"
        )
    if settings.needs_scores and getattr(config.algorithm, "overlap", False):
        raise ConfigError(
            f"algorithm.overlap: {settings.name} scores the levels of a rollout before it chooses those of the next, so no"
            " rollout can be collected ahead; give algorithm.overlap=false"
        )
    if getattr(config.algorithm, "env_device", "cpu") != "cpu":
        raise ConfigError(f"{place_of(config)}: environments on a GPU keep their levels; give algorithm.env_device=cpu")
