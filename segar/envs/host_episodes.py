"""Episodes on the processor: all that changes lies in arrays, and compiled functions and the simulator change it."""

import weakref
from dataclasses import replace
from typing import Any

import numpy as np

from segar.engine import Simulator, State, StepResult
from segar.envs.action_range import ActionRange
from segar.envs.buffers import Buffers
from segar.envs.checks import actions_of, array_of
from segar.envs.episode_kernel import count_step, draw_levels, record_ends, start_episodes
from segar.envs.level_pool import LevelPool
from segar.envs.snapshots import Snapshot
from segar.envs.trials import trial_info
from segar.errors import LevelError
from segar.language import Factor, Factors, Results
from segar.levels import Levels
from segar.observations import Observation, copy_rows, hooks_of, leaves, simulator_reads
from segar.rendering import Camera
from segar.support import Team


class HostEpisodes:
    """The episodes of a batch of environments on the processor.

    Args:
        simulator: steps the states.
        levels: what is played at first.
        described: what is observed.
        actions: the range of the actions.
        num_envs, num_threads, copy, trials: as of :class:`segar.envs.VectorEnv`.
        same_step: whether episodes that end are followed by new ones in the same step.
        seed: decides on which levels episodes start, and the randomness in rules.
        camera: draws the states for people, or None.

    Attributes:
        pool: the levels that episodes start on.
        observation: what observes them.
        now: the states and the counts of episodes.
    """

    device: Any = "cpu"
    runs_on_gpu = False

    def __init__(
        self,
        simulator: Simulator,
        levels: Levels,
        described: Observation,
        actions: ActionRange,
        *,
        num_envs: int,
        num_threads: int,
        copy: bool,
        trials: int,
        same_step: bool,
        seed: int,
        camera: Camera | None,
    ) -> None:
        self.simulator, self.task, self.described, self.actions = simulator, simulator.task, described, actions
        self.num_envs, self.copy, self.trials, self.same_step, self.camera = num_envs, copy, trials, same_step, camera
        self.pool = self._first_pool = LevelPool.of(levels)
        self._bind_observation()
        self._team = Team(num_threads)
        self._rows = np.arange(num_envs)
        self._ended = np.empty(num_envs, np.int64)
        self._any_level = np.full(num_envs, -1)
        self._outcome = StepResult.empty(num_envs)
        self._last_factors: weakref.ref[Factors] | None = None
        counts = (np.zeros(num_envs), np.zeros(num_envs, np.int64), np.zeros(num_envs, np.int64))
        self.now = Snapshot(State.empty(num_envs, levels.layout), *counts, seed)

    def mask_of(self, mask: Any) -> np.ndarray:
        """Which environments a mask names, bool ``(num_envs,)``; all where it is None; raises :class:`LevelError`."""
        found = array_of("reset: option 'reset_mask'", mask, np.bool_, self.num_envs)
        return np.ones(self.num_envs, np.bool_) if found is None else found

    def reset(self, seed: int | None, mask: Any, chosen: np.ndarray | None) -> tuple[Any, dict[str, Any]]:
        """Start episodes where ``mask`` is true; return observations and info.

        Args:
            seed: starts the sequence of episodes anew; where it is None the sequence goes on.
            chosen: int64 ``(num_envs,)``, levels; drawn, or those of further trials, where it is None.
        """
        if seed is not None:
            self.now.seed = seed
            self.now.episodes[:] = 0
        self._detach_factors()
        self._start_episodes(np.flatnonzero(mask), chosen)
        observations = self.observe()
        self._update_window()
        return observations, self._info(np.zeros(self.num_envs, np.bool_), np.zeros(self.num_envs, np.bool_))

    def step(self, actions: Any) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """See :meth:`segar.envs.VectorEnv.step`."""
        actions = self.actions.of_task(actions_of(actions, (self.num_envs, len(self.actions.low))))
        self._detach_factors()
        observations, now, out = self._step_states(actions), self.now, self._outcome
        truncated = np.empty(self.num_envs, np.bool_)
        count = count_step(
            out.reward, out.terminated, self.task.max_steps, now.returns, now.lengths, truncated, self._ended
        )
        ended = self._ended[:count]
        reward = out.reward.copy() if self.copy else out.reward
        terminated, success, death = out.terminated.copy(), out.success.copy(), out.death.copy()
        self._update_window()
        if not len(ended) or not self.same_step:
            return observations, reward, terminated, truncated, self._info(success, death)
        final = self._final(observations, ended, success, death)
        self._start_episodes(ended)
        self._write_observations(observations, ended)
        return observations, reward, terminated, truncated, {**self._info(success, death), **final}

    def observe(self) -> Any:
        """The observations of all present states."""
        observations = self._buffers.output()
        self._write_observations(observations, self._rows)
        return observations

    def state(self) -> Snapshot:
        """See :meth:`segar.envs.VectorEnv.state`."""
        return replace(self.now.copy(), memory=self._hooks.memory())

    def restore(self, snapshot: Snapshot, pool: LevelPool | None = None) -> Any:
        """See :meth:`segar.envs.VectorEnv.restore`."""
        snapshot.check_fits((pool or self.pool).levels, self.num_envs)
        everywhere = np.ones(self.num_envs, np.bool_)
        if pool is not None:
            self._use_pool(pool)
        self._detach_factors()
        self._hooks.forget(everywhere)
        self._hooks.start(snapshot.state.key, snapshot.state.level, everywhere)
        self._hooks.recall(snapshot.memory)
        self.now = replace(snapshot, memory={}).copy()
        self.observation.begin(self.now.state.values, self.now.state.level, everywhere)
        return self.observe()

    def resume(self, snapshot: Snapshot, pool: LevelPool | None) -> None:
        """Be as environments that were never reset and whose snapshot and changed pool these are."""
        if pool is not None:
            self._use_pool(pool)
        self.now = replace(snapshot, memory={}).copy()

    def changed_pool(self) -> LevelPool | None:
        """The pool, where levels were replaced or weighted."""
        return None if self.pool is self._first_pool else self.pool

    def intervene(self, entity: str, factor: type[Factor], value: Any, mask: np.ndarray) -> Any:
        """See :meth:`segar.envs.VectorEnv.intervene`."""
        layout, now = self.pool.levels.layout, self.now.state
        first = layout.columns[factor]
        part = now.values[:, layout.slot_index(entity), first : first + factor.width]
        if np.isnan(part[mask]).any():
            raise LevelError(f"'{entity}' has no {factor.__name__} in some of these environments")
        self._detach_factors()
        part[mask] = factor.check(value)
        self.observation.begin(now.values, now.level, mask)
        return self.observe()

    def replace_levels(self, indices: Any, levels: Levels, playing: bool) -> None:
        """See :meth:`segar.envs.VectorEnv.replace_levels`; ``playing``: whether episodes run."""
        pool, rows = self.pool.replaced(indices, levels, self.now.state.level if playing else None)
        if rows is None:
            self._use_pool(pool)
            return
        snapshot = self.state()
        snapshot.state.level[:] = rows
        self.restore(snapshot, pool)

    def set_level_weights(self, weights: Any) -> None:
        """See :meth:`segar.envs.VectorEnv.set_level_weights`."""
        self.pool = self.pool.weighted(weights)

    def _use_pool(self, pool: LevelPool) -> None:
        """Play the levels of a pool; the rows of running episodes are the caller's to set."""
        self._detach_factors()
        levels, self.pool = self.pool.levels, pool
        if pool.levels is not levels:
            self._bind_observation()
            if self.camera is not None:
                self.camera.show_levels(pool.levels)

    def _bind_observation(self) -> None:
        """Make what observes the levels of the pool."""
        levels = replace(self.pool.levels, world=self.simulator.world)
        self.observation = self.described.bind(levels, self.num_envs)
        self._hooks, self._reads = hooks_of(self.observation), simulator_reads(self.observation)
        self._buffers = Buffers(self.num_envs, self.copy, self.observation)

    def _step_states(self, actions: np.ndarray) -> Any:
        """Step all states by the actions; return the observations of the states that follow."""
        if self._reads is not None:  # the simulator writes the observations while it has the states at hand
            observations = self._buffers.output()
            self.simulator.act(self.now.state, self.pool.levels, actions, self._outcome, self._reads, observations)
            return observations
        self.simulator.act(self.now.state, self.pool.levels, actions, self._outcome)
        self._hooks.advance(actions)
        self._hooks.rewarded(self._outcome.reward)
        return self.observe()

    def _start_episodes(self, rows: np.ndarray, chosen: np.ndarray | None = None) -> None:
        """Start episodes in these rows, on the chosen levels or on ones that are drawn, or the next trials there."""
        now, state = self.now, self.now.state
        chosen = self._any_level if chosen is None else chosen
        if not self.pool.is_plain:
            chosen, sums = chosen.copy(), self.pool.cumulative
            draw_levels(rows, np.uint64(now.seed), self.trials, self.pool.count, sums, now.episodes, chosen)
        start_episodes(
            rows, np.uint64(now.seed), self.trials, chosen, self.pool.levels.values, state.values, state.level, state.key,
            state.tick, state.contacts, now.state.unresolved_contacts, now.returns, now.lengths, now.episodes,
        )  # fmt: skip
        mask = np.zeros(self.num_envs, np.bool_)
        mask[rows] = True
        self._hooks.forget(mask if self.trials == 1 else mask & ((now.episodes - 1) % self.trials == 0))
        self._hooks.start(state.key, state.level, mask)
        self.observation.begin(state.values, state.level, mask)

    def _write_observations(self, out: Any, rows: np.ndarray) -> None:
        """Write the observations of these rows of the present states into ``out``."""
        values, level, write = self.now.state.values, self.now.state.level, self.observation.write
        self._team.do_range(lambda a, b: write(values, level, out, rows[a:b]), len(rows))

    def _update_window(self) -> None:
        """Show the present states where the camera has a window."""
        if self.camera is not None and self.camera.mode == "human":
            self.camera.render(self.now)

    def _info(self, success: np.ndarray, death: np.ndarray) -> dict[str, Any]:
        """The info about all running episodes."""
        now = self.now
        factors = Factors(self.pool.levels.layout, now.state.values)
        self._last_factors = weakref.ref(factors)
        counts = (
            self.pool.named(now.state.level),
            now.lengths.copy(),
            now.state.contacts.copy(),
            now.state.unresolved_contacts.copy(),
        )
        trials = trial_info(self.trials, now.episodes, now.lengths)
        return self._named_info(counts, now.returns.copy(), success, death, factors) | trials

    def _final(self, observations: Any, ended: np.ndarray, success: np.ndarray, death: np.ndarray) -> dict[str, Any]:
        """The last observations and info of episodes that ended, in full-sized arrays with masks.

        ``success`` and ``death`` are set to false for these episodes, because the next ones begin.
        """
        now, state, ended = self.now, self.now.state, ended.copy()  # the caller's factors hold the rows
        final_obs = self._buffers.final_output(ended)
        for last, array in zip(leaves(final_obs), leaves(observations), strict=True):
            copy_rows(array, last, ended)
        counts, flags = np.zeros((4, self.num_envs), np.int64), np.zeros((4, self.num_envs), np.bool_)
        returns = np.zeros(self.num_envs)
        record_ends(
            ended, state.level, now.lengths, state.contacts, state.unresolved_contacts, now.returns, success, death, counts,
            returns, flags,
        )  # fmt: skip
        counts[0] = self.pool.named(counts[0])
        factors = Factors(self.pool.levels.layout, state.values[ended], ended, self.num_envs)
        trials = {
            name: np.where(flags[2], array, np.zeros_like(array))
            for name, array in trial_info(self.trials, now.episodes, now.lengths).items()
        }
        final_info = self._named_info(counts, returns, flags[0], flags[1], factors) | trials
        return {"final_obs": final_obs, "_final_obs": flags[2], "final_info": final_info, "_final_info": flags[3]}

    def _named_info(
        self, counts: Any, returns: np.ndarray, success: np.ndarray, death: np.ndarray, factors: Factors
    ) -> dict[str, Any]:
        """Info by its names; ``counts`` are level, length, contacts and unresolved contacts."""
        return {
            "level": counts[0],
            "return": returns,
            "length": counts[1],
            "success": success,
            "death": death,
            "contacts": counts[2],
            "unresolved_contacts": counts[3],
            "factors": factors,
            "results": Results(self.task.results, factors),
        }

    def _detach_factors(self) -> None:
        """Let the factors of the last step take a copy of the state, which is about to change, if a caller holds them.

        A weak reference says whether a caller does: the object lives as long as any reference to it, counted or borrowed.
        """
        factors = self._last_factors() if self._last_factors is not None else None
        if factors is not None and self.copy:
            factors.keep()
        self._last_factors = None
