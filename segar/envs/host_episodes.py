"""Episodes on the processor: all that changes lies in arrays, and compiled functions and the simulator change it."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from segar.engine import Simulator, State, StepResult
from segar.envs.action_range import ActionRange
from segar.envs.buffers import Buffers
from segar.envs.checks import actions_of, array_of, shown
from segar.envs.episode_kernel import copy_numbers, count_step, draw_levels, moved_seed, start_episodes
from segar.envs.level_pool import LevelPool
from segar.envs.snapshots import Snapshot, trial_info
from segar.errors import LevelError
from segar.language import Factor, FloorFriction, Mobile, Parameter, Size
from segar.levels import Levels, check_crossings
from segar.observations import Observation, copy_rows, hooks_of, map_leaves, recall_array, simulator_reads
from segar.rendering import Camera
from segar.support import Team

OVER = "over"  # in the memory of a snapshot under NEXT_STEP: whether the next step starts another episode
SEEDS = "seeds"  # in the memory of a snapshot whose environments have seeds of their own


class HostEpisodes:
    """The episodes of a batch of environments on the processor.

    Args:
        simulator: steps the states.
        levels: what is played at first.
        described: what is observed.
        actions: the range of the actions.
        num_envs, num_threads, copy, trials, true_factors: as of :class:`segar.envs.VectorEnv`.
        autoreset: when an episode that ended is followed by a new one.
        seed: decides on which levels episodes start, and the randomness in rules.
        camera: draws the states for people, or None.

    Attributes:
        pool: the levels that episodes start on.
        observation: what observes them.
        now: the states and the counts of episodes.
    """

    device: Any = "cpu"

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
        true_factors: bool,
        autoreset: AutoresetMode,
        seed: int,
        camera: Camera | None,
    ) -> None:
        self.simulator, self.task, self.described, self.actions = simulator, simulator.task, described, actions
        self.num_envs, self.copy, self.trials, self.autoreset, self.camera = num_envs, copy, trials, autoreset, camera
        self.pool = self._first_pool = LevelPool(levels, len(levels))
        self._bind_observation()
        self._team = Team(num_threads)
        self._rows = np.arange(num_envs)
        self._ended = np.empty(num_envs, np.int64)
        self._any_level = np.full(num_envs, -1)
        self._outcome = StepResult.empty(num_envs)
        self._has_factors = true_factors
        # uint64 (num_envs, 2): own seeds, and the places in a batch that draw by them.
        self._seeds: np.ndarray | None = None
        self.over = np.zeros(num_envs, np.bool_)  # under NEXT_STEP, whether the next step starts another episode
        counts = (np.zeros(num_envs), np.zeros(num_envs, np.int64), np.zeros(num_envs, np.int64))
        self.now = Snapshot(State.empty(num_envs, levels.layout), *counts, seed)

    def mask_of(self, mask: Any) -> np.ndarray:
        """Which environments a mask names, bool ``(num_envs,)``; all where it is None; raises :class:`LevelError`."""
        found = array_of("reset: option 'reset_mask'", mask, np.bool_, self.num_envs)
        return np.ones(self.num_envs, np.bool_) if found is None else found

    def reset(self, seed: Any, mask: Any, chosen: np.ndarray | None) -> tuple[Any, dict[str, Any]]:
        """Start episodes where ``mask`` is true; return observations and info.

        Args:
            seed: starts the sequence of episodes anew; where it is None the sequence goes on. An int, or uint64
                ``(num_envs, 2)``: for each environment a seed, and the place in a batch whose episodes it plays.
            chosen: int64 ``(num_envs,)``, levels; drawn, or those of further trials, where it is None.
        """
        if seed is not None:
            own = isinstance(seed, np.ndarray)
            self._seeds, self.now.seed = (seed, self.now.seed) if own else (None, seed)
            self.now.episodes[:] = 0
        self._start_episodes(np.flatnonzero(mask), chosen)
        observations = self.observe()
        self._update_window()
        return observations, with_masks(self.info(), mask.copy())

    def step(self, actions: Any) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """See :meth:`segar.envs.VectorEnv.step`."""
        actions = self.actions.of_task(actions_of(actions, (self.num_envs, len(self.actions.low))))
        begins, now, out = np.flatnonzero(self.over), self.now, self._outcome
        remembered = self._hooks.memory() if len(begins) and self.trials > 1 else {}
        observations = self._step_states(actions)
        truncated = np.empty(self.num_envs, np.bool_)
        count = count_step(
            out.reward, out.terminated, self.task.max_steps, now.returns, now.lengths, truncated, self._ended
        )
        ended = self._ended[:count]
        reward = out.reward.copy() if self.copy else out.reward
        terminated, success, death = out.terminated.copy(), out.success.copy(), out.death.copy()
        if len(begins):  # this was no step of their episodes, and nothing of it remains
            for array in (reward, terminated, truncated, success, death):
                array[begins] = 0
            if remembered:
                after = self._hooks.memory()
                for name, array in remembered.items():
                    after[name][begins] = array[begins]
                self._hooks.recall(after)
            self._start_episodes(begins)
            self._write_observations(observations, begins)
        self._update_window()
        if self.autoreset is AutoresetMode.NEXT_STEP:
            self.over = terminated | truncated
        info, final = self.info(success, death), {}
        if len(ended) and self.autoreset is AutoresetMode.SAME_STEP:
            final = self._final(observations, ended.copy(), info)  # the buffers keep the rows
            self._start_episodes(ended)
            self._write_observations(observations, ended)
            success[ended] = death[ended] = False
            info = self.info(success, death)
        return observations, reward, terminated, truncated, with_masks(info, np.ones(self.num_envs, np.bool_)) | final

    def observe(self) -> Any:
        """The observations of all present states."""
        observations = self._buffers.output()
        self._write_observations(observations, self._rows)
        return observations

    def state(self) -> Snapshot:
        """See :meth:`segar.envs.VectorEnv.state`."""
        own = {OVER: self.over.copy()} if self.autoreset is AutoresetMode.NEXT_STEP else {}
        own |= {} if self._seeds is None else {SEEDS: self._seeds.copy()}
        now = self.now.copy()
        level, parameters = self.pool.parameters_of(now.state.level)
        memory = self._hooks.memory() | own
        return replace(now, state=replace(now.state, level=level), memory=memory, parameters=parameters)

    def restore(self, snapshot: Snapshot, pool: LevelPool | None = None) -> Any:
        """See :meth:`segar.envs.VectorEnv.restore`."""
        snapshot.check_fits((pool or self.pool).levels, self.num_envs)
        everywhere = np.ones(self.num_envs, np.bool_)
        if snapshot.parameters is not None:
            pool, level = (pool or self.pool).with_parameters(snapshot.state.level, snapshot.parameters)
            changed = ~np.isnan(snapshot.parameters).all(axis=1)
            self._check_crossings(replace(pool.levels[level], values=snapshot.state.values)[changed], "environment")
            snapshot = replace(snapshot, state=replace(snapshot.state, level=level), parameters=None)
        if pool is not None:
            self._use_pool(pool)
        self._hooks.forget(everywhere)
        self._hooks.start(snapshot.state.key, snapshot.state.level, everywhere)
        self._hooks.recall(snapshot.memory)
        self.now = replace(snapshot, memory={}).copy()
        seeds = np.zeros((self.num_envs, 2), np.uint64)
        self._seeds = seeds if recall_array(snapshot.memory, SEEDS, seeds) else None
        if self.autoreset is AutoresetMode.NEXT_STEP:
            self.over = np.zeros(self.num_envs, np.bool_)
            recall_array(snapshot.memory, OVER, self.over)
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
        if issubclass(factor, Parameter):
            return self._intervene_on_parameter(factor, value, mask)
        layout, now = self.pool.levels.layout, self.now.state
        values = now.values.copy()
        part = values[:, layout.slot_index(entity), layout.columns_of(factor)]
        if np.isnan(part[mask]).any():
            raise LevelError(f"'{entity}' has no {factor.__name__} in some of these environments")
        part[mask] = factor.check(value)
        if not factor.is_possible(part[mask]).all():
            raise LevelError(f"intervene: {factor.__name__} must be {factor.possible_values()}, not {shown(value)}")
        if factor in (Size, Mobile):
            self._check_crossings(replace(self.pool.levels[now.level], values=values), "environment")
        now.values[...] = values
        self.observation.begin(now.values, now.level, mask)
        return self.observe()

    def _intervene_on_parameter(self, parameter: type[Parameter], value: Any, mask: np.ndarray) -> Any:
        """Let these environments go on in worlds in which the parameter has another value."""
        levels, snapshot = self.pool.levels, self.state()
        own = np.full((self.num_envs, len(levels.layout.parameters)), np.nan)
        own = own if snapshot.parameters is None else snapshot.parameters
        own[mask] = levels.parameters[self.now.state.level[mask]]
        own[mask, levels.layout.parameters.index(parameter)] = parameter.check(value)
        if parameter is FloorFriction:
            values = snapshot.state.values[mask]
            levels.layout.set_floor(values, own[mask])
            snapshot.state.values[mask] = values
        return self.restore(replace(snapshot, parameters=own))

    def _check_crossings(self, levels: Levels, unit: str) -> None:
        check_crossings(levels, self.simulator.world, self.task.sub_steps, unit)

    def replace_levels(self, indices: Any, levels: Levels, playing: bool) -> None:
        """See :meth:`segar.envs.VectorEnv.replace_levels`; ``playing``: whether episodes run."""
        pool, rows = self.pool.replaced(indices, levels, self.now.state.level if playing else None)
        self._check_crossings(levels, "level")
        if rows is None:
            self._use_pool(pool)
            return
        snapshot = replace(self.state(), parameters=None)
        snapshot.state.level[:] = rows
        self.restore(snapshot, pool)

    def set_level_weights(self, weights: Any) -> None:
        """See :meth:`segar.envs.VectorEnv.set_level_weights`."""
        self.pool = self.pool.weighted(weights)

    def _use_pool(self, pool: LevelPool) -> None:
        """Play the levels of a pool; the rows of running episodes are the caller's to set."""
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
            chosen = chosen.copy()
        for some, seed in self._seeds_of(rows, chosen):
            if not self.pool.is_plain:
                sums = self.pool.cumulative
                draw_levels(some, seed, self.trials, self.pool.count, sums, now.episodes, chosen)
            start_episodes(
                some, seed, self.trials, chosen, self.pool.levels.values, state.values, state.level, state.key, state.tick,
                state.contacts, now.state.unresolved_contacts, now.returns, now.lengths, now.episodes,
            )  # fmt: skip
        mask = np.zeros(self.num_envs, np.bool_)
        mask[rows] = True
        self._hooks.forget(mask if self.trials == 1 else mask & ((now.episodes - 1) % self.trials == 0))
        self._hooks.start(state.key, state.level, mask)
        self.observation.begin(state.values, state.level, mask)
        self.over = self.over & ~mask

    def _seeds_of(self, rows: np.ndarray, chosen: np.ndarray) -> Iterator[tuple[np.ndarray, np.uint64]]:
        """The rows in parts that start episodes by one seed."""
        if self._seeds is None:
            yield rows, np.uint64(self.now.seed)
            return
        for row in rows:
            number = int(self.now.episodes[row])
            number += -number % self.trials if chosen[row] >= 0 else 0
            seed, place = self._seeds[row].tolist()
            yield np.array([row]), moved_seed(seed, place, int(row), number)

    def _write_observations(self, out: Any, rows: np.ndarray) -> None:
        """Write the observations of these rows of the present states into ``out``."""
        values, level, write = self.now.state.values, self.now.state.level, self.observation.write
        self._team.do_range(lambda a, b: write(values, level, out, rows[a:b]), len(rows))

    def _update_window(self) -> None:
        """Show the present states where the camera has a window."""
        if self.camera is not None and self.camera.mode == "human":
            self.camera.render(self.now)

    def info(self, success: np.ndarray | None = None, death: np.ndarray | None = None) -> dict[str, Any]:
        """The info about all running episodes, bool ``(num_envs,)``: which of them a step has just ended in which way."""
        now, state = self.now, self.now.state
        info: dict[str, Any] = {
            "level": self.pool.named(state.level),
            "return": now.returns.copy(),
            "length": now.lengths.copy(),
            "success": np.zeros(self.num_envs, np.bool_) if success is None else success,
            "death": np.zeros(self.num_envs, np.bool_) if death is None else death,
            "contacts": state.contacts.copy(),
            "unresolved_contacts": state.unresolved_contacts.copy(),
        }
        if self._has_factors:
            values = np.empty(state.values.shape)
            copy_numbers(state.values, values)
            info["factors"] = self.pool.levels.layout.named(values)
        return info | trial_info(self.trials, now.episodes, now.lengths)

    def _final(self, observations: Any, ended: np.ndarray, last: dict[str, Any]) -> dict[str, Any]:
        """The last observations and info of episodes that ended, in full-sized arrays with masks."""
        final_obs, present = self._buffers.final_output(ended), np.zeros(self.num_envs, np.bool_)
        map_leaves(lambda array, final: copy_rows(array, final, ended), observations, final_obs)
        present[ended] = True
        final_info = with_masks(map_leaves(lambda array: _at_rows(array, ended), last), present)
        return {"final_obs": final_obs, "_final_obs": present, "final_info": final_info, "_final_info": present.copy()}


def _at_rows(array: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """A copy of these rows, 0 in all others."""
    found = np.zeros(array.shape, array.dtype)
    found[rows] = array[rows]
    return found


def with_masks(info: dict[str, Any], present: Any) -> dict[str, Any]:
    """Info with Gymnasium's masks: ``_name`` says which environments have the entry ``name``, here those of ``present``."""
    found = {name: with_masks(part, present) if isinstance(part, dict) else part for name, part in info.items()}
    return found | {f"_{name}": present for name in info}
