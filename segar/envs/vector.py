"""The core environment: a batch of episodes on the levels of a set, stepped by one compiled kernel."""

import weakref
from collections.abc import Mapping
from dataclasses import replace
from types import NoneType
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from segar.engine import Simulator, State, StepResult
from segar.envs.buffers import Buffers
from segar.envs.checks import (
    MOST_ENVIRONMENTS,
    MOST_THREADS,
    actions_of,
    instance,
    seed_of,
    shown,
    whole_number,
)
from segar.envs.episode_kernel import count_step, draw_levels, record_ends, start_episodes
from segar.envs.level_pool import LevelPool
from segar.envs.snapshots import Snapshot
from segar.envs.trials import MOST_TRIALS, trial_info
from segar.errors import LevelError, SegarError, did_you_mean, must_be
from segar.language import Factor, Factors, Results, Task
from segar.levels import Levels, check_levels
from segar.observations import (
    ObservationLike,
    copy_rows,
    draws_per_episode,
    for_task,
    hooks_of,
    leaves,
    make_observation,
    simulator_reads,
)
from segar.rendering import RENDER_MODES, Camera, View, offered_modes, steps_per_second
from segar.rules import World
from segar.support import Team, need
from segar.tasks import task_of

if TYPE_CHECKING:
    from segar.envs.device_episodes import DeviceEpisodes

KEPT_IN_PICKLES = (
    *("observation_space", "single_observation_space", "action_space", "single_action_space"),  # and their generators
    *("spec", "closed", "_np_random", "_np_random_seed"),  # Gymnasium's
)


class VectorEnv(gymnasium.vector.VectorEnv):
    """``num_envs`` environments on a level set, natively batched.

    >>> env = segar.envs.VectorEnv(segar.family("empty-hard").sample(10, seed=0), num_envs=64, seed=0)
    >>> observations, info = env.reset()
    >>> env.step(np.zeros((64, 2), np.float32))[1].shape
    (64,)

    Each episode starts on a level drawn uniformly from the set (the epistemic POMDP); :meth:`set_level_weights` and
    :meth:`replace_levels` change weights and levels for the episodes that follow, on the processor. With ``trials=k``, the
    next k - 1 episodes of the environment start on the same level, too, with randomness of their own. Environment ``e``
    behaves in the same way for all ``num_envs`` and ``num_threads``.

    ``info`` holds ``level`` (int64, index in ``levels``), ``return`` (float64, every reward counted) and ``length`` of
    the running episode, ``success`` and ``death`` (bool), ``factors`` (mapping of the true factors, gathered on
    access) and ``results`` (mapping of what the task says of them, computed on access). With several trials it also holds
    ``trial`` (int64, from 0, which episode on its level runs) and ``new_level`` (bool, whether the first one on a level has
    just started). Where an episode ended under
    ``SAME_STEP``, ``final_obs`` and ``final_info`` hold its end in the rows that the masks ``_final_obs`` and
    ``_final_info`` name, and the rest of ``info`` is about the next episode.

    Args:
        levels: the level set.
        num_envs: number of environments.
        observation: a name in :data:`segar.observations.registry.OBSERVATIONS` such as 'state', 'rgb' or 'textures', an
            :class:`segar.observations.protocol.Observation`, or a tuple or dict of these, which makes tuples or dicts
            of arrays.
        task: the task; the one that the levels name where it is None, and PuttPutt where they name none.
        seed: seeds the draw of levels and the randomness in rules; fresh entropy where it is None.
        num_threads: threads over the batch; results do not depend on it.
        autoreset_mode: ``SAME_STEP`` or ``DISABLED``.
        copy: whether arrays that ``step`` returns are the caller's to keep; otherwise later steps overwrite them.
        max_steps, sub_steps: override the task's.
        unit_actions: whether each component of an action lies in [-1, 1], which is mapped linearly to the task's range;
            otherwise actions have the task's range themselves.
        world: rules; those of the levels' distribution where it is None.
        trials: episodes in a row on each level, from 1 up.
        render_mode: None, 'rgb_array' (:meth:`render` gives a frame of each environment, drawn for people) or 'human'
            (a window shows them).
        view: a :class:`segar.rendering.View`: size of the frames, labels, hints.
        device: where episodes run: 'cpu', or an NVIDIA GPU, 'cuda' or 'cuda:1'. There, actions are torch tensors, and so is all
            that ``reset`` and ``step`` return; ``info`` has no ``factors`` and no ``results``, ``final_obs`` and ``final_info``
            come with every step under ``SAME_STEP``, and what is wrong with a step may be said some steps later.

    Raises:
        SegarError: an option is unknown or out of range. LevelError: the levels do not fit their layout, or hold a number
            that its factor cannot have. RuleError, ConflictError: the world cannot be built.
    """

    metadata = {  # noqa: RUF012 - gymnasium's attribute
        "render_modes": RENDER_MODES,
        "render_fps": 20,
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }

    def __init__(
        self,
        levels: Levels,
        num_envs: int,
        *,
        observation: ObservationLike = "state",
        task: Task | None = None,
        seed: int | None = None,
        num_threads: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
        copy: bool = True,
        max_steps: int | None = None,
        sub_steps: int | None = None,
        unit_actions: bool = False,
        world: World | None = None,
        render_mode: str | None = None,
        view: View | None = None,
        device: Any = "cpu",
        trials: int = 1,
    ) -> None:
        self._arguments = {name: value for name, value in locals().items() if name not in ("self", "__class__")}
        instance("levels", levels, Levels, "segar.Levels, as segar.family('empty-hard').sample(100) makes them")
        num_envs = whole_number("num_envs", num_envs, 1, MOST_ENVIRONMENTS)
        num_threads = whole_number("num_threads", num_threads, 1, MOST_THREADS)
        self.trials = whole_number("trials", trials, 1, MOST_TRIALS)
        instance("task", task, (Task, NoneType), "a segar.Task, such as segar.puttputt(), or None")
        instance("world", world, (World, NoneType), "a segar.World, such as segar.World(rules=...), or None")
        instance("view", view, (View, NoneType), "a segar.rendering.View, or None")
        for name, flag in (("copy", copy), ("unit_actions", unit_actions)):
            instance(name, flag, (bool, np.bool_), "True or False")
        if len(levels) == 0:
            raise LevelError("the level set is empty")
        check_levels(levels)
        task = task or task_of(levels)
        limits = {"max_steps": max_steps, "sub_steps": sub_steps}
        self.task = replace(task, **{name: value for name, value in limits.items() if value is not None})
        self.levels, self.pool, self.num_envs, self.copy = levels, LevelPool.of(levels), num_envs, copy
        if not isinstance(autoreset_mode, AutoresetMode) and autoreset_mode not in [
            mode.value for mode in AutoresetMode
        ]:
            raise SegarError(f"autoreset_mode {must_be(autoreset_mode, ('SameStep', 'Disabled'))}")
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        if self.autoreset_mode is AutoresetMode.NEXT_STEP:
            raise SegarError("autoreset_mode NEXT_STEP is not offered; use SAME_STEP or DISABLED")
        modes = {"autoreset_mode": self.autoreset_mode, "render_modes": offered_modes()}
        self.metadata = {**type(self).metadata, **modes}
        self.simulator = Simulator(world or world_of(levels), levels.layout, self.task, num_threads)
        self._described = for_task(make_observation(observation), self.task)
        self._bind_observation()
        self._team = Team(num_threads)
        self.single_observation_space = self.observation.space
        low, high = np.array(self.task.action_low, np.float32), np.array(self.task.action_high, np.float32)
        self._center, self._half_range = (low + high) / 2, (high - low) / 2
        self._maps_actions = unit_actions and not ((low == -1).all() and (high == 1).all())
        if unit_actions:
            low, high = -np.ones_like(low), np.ones_like(high)
        self.single_action_space = gymnasium.spaces.Box(low, high, dtype=np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._action_shape = (num_envs, len(self.task.action_low))
        self._rows = np.arange(num_envs)
        self._ended = np.empty(num_envs, np.int64)
        self._any_level = np.full(num_envs, -1)
        self._outcome = StepResult.empty(num_envs)
        self._last_factors: weakref.ref[Factors] | None = None
        self._started = False
        self._now = Snapshot(
            State.empty(num_envs, levels.layout),
            np.zeros(num_envs),
            np.zeros(num_envs, np.int64),
            np.zeros(num_envs, np.int64),
            seed_of(np.random.SeedSequence().generate_state(1, np.uint64)[0] if seed is None else seed),
        )
        self.render_mode = render_mode
        self._camera = None
        if render_mode is not None:
            self._camera = Camera(levels, self.simulator.world, self.task, num_envs, render_mode, view)
        self.metadata["render_fps"] = steps_per_second(levels, self.task)
        self._episodes = None if str(device) == "cpu" else self._episodes_on(device)
        self.device: Any = "cpu" if self._episodes is None else self._episodes.device

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict]:
        """Start the next episodes; return observations and info.

        The next one of several trials is on the same level, unless the last one ran, or a seed or levels are given.

        Args:
            seed: starts the sequence of episodes anew; where it is None the sequence goes on.
            options: ``levels`` (int, ``(num_envs,)``): the level that each environment starts on, with its first trial;
                ``reset_mask`` (bool, ``(num_envs,)``): which environments start anew, all where it is absent.

        Raises:
            LevelError: a level index is out of range, or an option is unknown or of the wrong shape.
        """
        instance("reset: options", options, (Mapping, NoneType), "a mapping such as {'levels': [...]}, or None")
        options = dict(options or {})
        where = None
        if self._episodes is not None and options.get("reset_mask") is not None:
            where = self._episodes.mask_of(options.pop("reset_mask"))
            if not self._started and not bool(where.all()):
                raise SegarError("the first reset must start all environments")
        mask = self._checked_option(options, "reset_mask", np.bool_)
        chosen = self._checked_option(options, "levels", np.int64)
        if options:
            name = next(iter(options))
            raise LevelError(f"reset: unknown option '{name}'.{did_you_mean(str(name), ('levels', 'reset_mask'))}")
        if chosen is not None:
            self._require_levels(chosen)
        if seed is not None:
            self._now.seed = seed_of(seed)
            self._now.episodes[:] = 0
        mask = np.ones(self.num_envs, np.bool_) if mask is None else mask
        if not self._started and not mask.all():
            raise SegarError("the first reset must start all environments")
        self._started = True
        if self._episodes is not None:
            return self._episodes.reset(seed, where, chosen)
        self._detach_factors()
        self._start_episodes(np.flatnonzero(mask), chosen)
        observations = self._observe_all()
        self._update_window()
        return observations, self._info(np.zeros(self.num_envs, np.bool_), np.zeros(self.num_envs, np.bool_))

    def step(self, actions: np.ndarray) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict]:
        """Advance all environments by one step; actions beyond the range are clipped.

        Args:
            actions: float ``(num_envs, action size)``.

        Returns:
            Observations, rewards float64, terminated bool, truncated bool, info; all lead with ``num_envs``.

        Raises:
            ActionError: wrong shape, or not finite. ConflictError: rules contradict each other in some state.
            RuleError: a number of a state, or a reward, is not finite after the step.
        """
        if self._episodes is not None:
            return self._step_on_device(self._episodes, actions)
        actions = self._checked_actions(actions)
        self._detach_factors()
        observations = self._step_states(actions)
        truncated, ended = self._count_step()
        reward, terminated, success, death = self._outcome_for_caller()
        self._update_window()
        if not len(ended) or self.autoreset_mode is AutoresetMode.DISABLED:
            return observations, reward, terminated, truncated, self._info(success, death)
        final = self._final(observations, ended, success, death)
        self._start_episodes(ended)
        self._write_observations(observations, ended)
        return observations, reward, terminated, truncated, {**self._info(success, death), **final}

    @property
    def runs_on_gpu(self) -> bool:
        """Whether episodes run on a GPU, whose number ``device`` says; then actions and results are torch tensors."""
        return self._episodes is not None

    def _require_levels(self, chosen: np.ndarray) -> None:
        """Raise :class:`LevelError` where an environment shall start on a level that there is not."""
        wrong = np.flatnonzero((chosen < 0) | (chosen >= len(self.levels)))
        if len(wrong):
            others = f"; {len(wrong)} environments have a wrong one" if len(wrong) > 1 else ""
            raise LevelError(
                f"reset: level indices must lie in 0..{len(self.levels) - 1}, and that of environment {wrong[0]} is"
                f" {chosen[wrong[0]]}{others}"
            )

    @property
    def is_random(self) -> bool:
        """Whether two episodes of one level and of equal actions may differ.

        They may where a rule or the task draws random numbers, or where the observation draws anew in each episode.
        """
        return self.simulator.source.draws or draws_per_episode(self.observation)

    @property
    def factors(self) -> Factors:
        """The true factors of all entities in the present states, which later steps leave alone."""
        return Factors(self.levels.layout, self.state().state.values)

    def in_action_space(self, actions: np.ndarray) -> np.ndarray:
        """Actions of the task's range ``[..., action size]`` as the action space has them (``unit_actions``), float32."""
        actions = np.asarray(actions, np.float32)
        return (actions - self._center) / self._half_range if self._maps_actions else actions

    def in_task_range(self, actions: np.ndarray) -> np.ndarray:
        """Actions of the action space ``[..., action size]`` as the task has them: what a step makes of them, float32."""
        actions = np.asarray(actions, np.float32)
        return self._center + self._half_range * np.clip(actions, -1, 1) if self._maps_actions else actions

    @property
    def takes_task_actions(self) -> bool:
        """Whether actions have the task's own range, as without ``unit_actions`` or where both ranges are equal."""
        return not self._maps_actions

    def render(self) -> tuple[np.ndarray, ...] | None:
        """A frame of each environment, uint8; None without a render mode, and for 'human', where a window shows them.

        Raises:
            SegarError: there was no reset before, or no window can be opened.
        """
        if self._camera is None:
            return None
        if not self._started:
            raise SegarError("call reset() before render()")
        return self._camera.render(self._now)

    def close_extras(self, **kwargs: Any) -> None:
        """Close the window, if there is one."""
        if self._camera is not None:
            self._camera.close()

    def state(self) -> Snapshot:
        """A copy of everything that decides how the episodes go on, and of the past that observations show."""
        if self._episodes is not None and self._started:
            self._episodes.pull()
        return replace(self._now.copy(), memory=self._hooks.memory())

    def restore(self, snapshot: Snapshot, pool: LevelPool | None = None) -> Any:
        """Go on from a snapshot of ``num_envs`` environments on these levels; return the observations.

        A snapshot says levels by their places. Where levels were replaced before or after it was taken, give the
        environment's ``pool`` of that moment, too.

        The snapshot holds what observations show of the past. Where it does not, because its environment observed
        something else, observations are as if the episode had started now. Which trial runs follows from the number of
        episodes that the snapshot counts, and from the ``trials`` of these environments.

        Raises:
            SegarError: the snapshot is of another number of environments, or of other levels, or holds the past of
                another observation.
        """
        instance("snapshot", snapshot, Snapshot, "a segar.envs.Snapshot, as env.state() makes it")
        snapshot.check_fits((pool or self.pool).levels, self.num_envs)
        self._detach_factors()
        if pool is not None:
            self._require_processor("restore with a pool")
            self._use_pool(pool)
        everywhere = np.ones(self.num_envs, np.bool_)
        self._hooks.forget(everywhere)
        self._hooks.start(snapshot.state.key, snapshot.state.level, everywhere)
        self._hooks.recall(snapshot.memory)
        self._now = replace(snapshot, memory={}).copy()
        self._started = True
        self.observation.begin(self._now.state.values, self._now.state.level, everywhere)
        if self._episodes is not None:
            self._episodes.push(self._now)
        return self._observe_all()

    def __reduce__(self) -> tuple[Any, ...]:
        """A pickle holds the arguments, the episodes that run, and the random generators of spaces; nothing compiled."""
        kept = {name: value for name, value in vars(self).items() if name in KEPT_IN_PICKLES}
        return _remade, (type(self), self._arguments), (self._started, self.state(), self.pool, kept)

    def __setstate__(self, state: tuple[bool, Snapshot, LevelPool, dict[str, Any]]) -> None:
        started, snapshot, pool, kept = state
        vars(self).update(kept)
        if started and self._episodes is None:
            self.restore(snapshot, pool)
        elif started:
            self.restore(snapshot)
        else:
            self._use_pool(pool)
            self._now = replace(snapshot, memory={})

    def intervene(self, entity: str, factor: type[Factor], value: Any, where: np.ndarray | None = None) -> Any:
        """Set a factor of one entity in the environments where ``where`` (bool, all if None); return observations.

        What observations show of the past stays as it is.

        Raises:
            LevelError: no entity of that name, or it has no such factor in a chosen environment.
        """
        if not self._started:
            raise SegarError("call reset() before intervene()")
        layout = self.levels.layout
        slot = layout.slot_index(entity)
        if not (isinstance(factor, type) and issubclass(factor, Factor)):
            raise SegarError(f"intervene: factor must be a class such as segar.Mass, not {shown(factor)}")
        if factor not in layout.columns:
            layout.factor(factor.__name__)
        chosen = self._checked_option({"where": where}, "where", np.bool_, "intervene: where")
        if self._episodes is not None:
            self._episodes.pull()
        mask = np.ones(self.num_envs, np.bool_) if chosen is None else chosen
        part = self._now.state.values[:, slot, layout.columns[factor] : layout.columns[factor] + factor.width]
        if np.isnan(part[mask]).any():
            raise LevelError(f"'{entity}' has no {factor.__name__} in some of these environments")
        self._detach_factors()
        part[mask] = factor.check(value)
        self.observation.begin(self._now.state.values, self._now.state.level, mask)
        if self._episodes is not None:
            self._episodes.push(self._now)
        return self._observe_all()

    def replace_levels(self, indices: Any, levels: Levels) -> None:
        """Take other levels in place of those at ``indices``, for all episodes that begin from now on.

        Running episodes go on as they would have, and further trials are on the same level, with random draws of their own;
        ``info`` says -1 as the ``level`` of those whose level was replaced. Weights stay with their places. Nothing is
        compiled.

        Args:
            indices: int ``(k,)``, each once.
            levels: ``k`` levels with the same layout, rules and task.

        Raises:
            LevelError: the indices or the levels do not fit. SegarError: episodes run on a GPU.
        """
        self._require_processor("replace_levels")
        pool, rows = self.pool.replaced(indices, levels, self._now.state.level if self._started else None)
        if rows is None:
            self._use_pool(pool)
            return
        snapshot = self.state()
        snapshot.state.level[:] = rows
        self.restore(snapshot, pool)

    def set_level_weights(self, weights: Any) -> None:
        """Draw the levels of all episodes that begin from now on with these weights.

        Args:
            weights: float ``(levels,)``, at least 0, relative to each other; None for a uniform draw.

        Raises:
            LevelError: the weights do not fit the levels. SegarError: episodes run on a GPU.
        """
        self._require_processor("set_level_weights")
        self.pool = self.pool.weighted(weights)

    def _require_processor(self, method: str) -> None:
        if self._episodes is not None:
            raise SegarError(
                f"{method}: episodes on a GPU keep their levels; use device='cpu', or make other environments"
            )

    def _use_pool(self, pool: LevelPool) -> None:
        """Play the levels of a pool; the rows of running episodes are the caller's to set."""
        self._detach_factors()
        if pool.levels is not self.pool.levels:
            self.pool, self.levels = pool, pool.drawn
            self._bind_observation()
            if self._camera is not None:
                self._camera.show_levels(pool.levels)
        self.pool = pool

    def _bind_observation(self) -> None:
        """Make what observes the levels of the pool."""
        levels = replace(self.pool.levels, world=self.simulator.world)
        self.observation = self._described.bind(levels, self.num_envs)
        self._hooks, self._reads = hooks_of(self.observation), simulator_reads(self.observation)
        self._buffers = Buffers(self.num_envs, self.copy, self.observation)

    def _episodes_on(self, device: Any) -> "DeviceEpisodes":
        """The episodes on a GPU."""
        if self.render_mode is not None:
            raise SegarError(
                f"render_mode='{self.render_mode}' draws on the processor: use device='cpu', or restore env.state() in an"
                " environment there"
            )
        need(f"device='{device}'", "torch")
        from segar.envs.device_episodes import DeviceEpisodes, open_gpu

        gpu = open_gpu(device)
        return DeviceEpisodes(gpu, self.simulator, self.levels, self.observation, self._now, self.copy, self.trials)

    def _step_on_device(self, episodes: "DeviceEpisodes", actions: Any) -> tuple[Any, ...]:
        """:meth:`step` on a GPU."""
        if not self._started:
            raise SegarError("call reset() before step()")
        actions = episodes.actions_of(actions)
        if self._maps_actions:
            actions = episodes.scaled(actions, self._center, self._half_range)
        same_step = self.autoreset_mode is AutoresetMode.SAME_STEP
        return episodes.step(actions, same_step, self.task.max_steps, self.task.sub_steps)

    def _step_states(self, actions: np.ndarray) -> Any:
        """Step all states by the actions; return the observations of the states that follow."""
        if self._reads is not None:  # the simulator writes the observations while it has the states at hand
            observations = self._buffers.output()
            self.simulator.act(self._now.state, self.pool.levels, actions, self._outcome, self._reads, observations)
            return observations
        self.simulator.act(self._now.state, self.pool.levels, actions, self._outcome)
        self._hooks.advance(actions)
        self._hooks.rewarded(self._outcome.reward)
        return self._observe_all()

    def _count_step(self) -> tuple[np.ndarray, np.ndarray]:
        """Count the step in returns and lengths; return ``truncated`` and the rows of the episodes that ended."""
        now, truncated = self._now, np.empty(self.num_envs, np.bool_)
        count = count_step(
            self._outcome.reward, self._outcome.terminated, self.task.max_steps, now.returns, now.lengths, truncated,
            self._ended,
        )  # fmt: skip
        return truncated, self._ended[:count]

    def _outcome_for_caller(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Reward, terminated, success and death of the step, as far as needed in arrays that the next step leaves alone."""
        out = self._outcome
        reward = out.reward.copy() if self.copy else out.reward
        return reward, out.terminated.copy(), out.success.copy(), out.death.copy()

    def _start_episodes(self, rows: np.ndarray, chosen: np.ndarray | None = None) -> None:
        """Start episodes in these rows, on the chosen levels or on ones that are drawn, or the next trials there."""
        now, state = self._now, self._now.state
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

    def _observe_all(self) -> Any:
        """The observations of all present states."""
        if self._episodes is not None:
            return self._episodes.observe()
        observations = self._buffers.output()
        self._write_observations(observations, self._rows)
        return observations

    def _write_observations(self, out: Any, rows: np.ndarray) -> None:
        """Write the observations of these rows of the present states into ``out``."""
        values, level, write = self._now.state.values, self._now.state.level, self.observation.write
        self._team.do_range(lambda a, b: write(values, level, out, rows[a:b]), len(rows))

    def _update_window(self) -> None:
        """Show the present states where the render mode is a window."""
        if self.render_mode == "human":
            self.render()

    def _info(self, success: np.ndarray, death: np.ndarray) -> dict[str, Any]:
        """The info about all running episodes."""
        now = self._now
        factors = Factors(self.levels.layout, now.state.values)
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
        now, state, ended = self._now, self._now.state, ended.copy()  # the caller's factors hold the rows
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
        factors = Factors(self.levels.layout, state.values[ended], ended, self.num_envs)
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

    def _checked_actions(self, actions: Any) -> np.ndarray:
        if not self._started:
            raise SegarError("call reset() before step()")
        return self.in_task_range(actions_of(actions, self._action_shape))

    def _checked_option(
        self, options: dict[str, Any], name: str, dtype: Any, called: str | None = None
    ) -> np.ndarray | None:
        if options.get(name) is None:
            options.pop(name, None)
            return None
        given, kinds = options.pop(name), "iu" if dtype is np.int64 else "b"
        if self._episodes is not None and hasattr(given, "cpu"):  # a tensor on the GPU
            given = given.cpu()
        what = called or f"reset: option '{name}'"
        right = f"{what} must be {np.dtype(dtype)} of shape ({self.num_envs},), not"
        try:
            array = np.asarray(given)
        except (ValueError, TypeError) as error:  # a ragged list
            raise LevelError(f"{right} {shown(given)}") from error
        if array.shape != (self.num_envs,) or array.dtype.kind not in kinds or isinstance(given, np.ma.MaskedArray):
            raise LevelError(f"{right} {array.dtype} of shape {array.shape}: {shown(given)}")
        return array.astype(dtype)


def _remade(kind: type[VectorEnv], arguments: dict[str, Any]) -> VectorEnv:
    return kind(**arguments)


def world_of(levels: Levels) -> World:
    """The rules of a level set: its distribution's, or the default ones.

    Raises:
        LevelError: the levels were saved with rules of their own, which a file does not hold.
    """
    if levels.world is None and levels.provenance.rules:
        raise LevelError(
            f"these levels were saved with rules of their own ({', '.join(levels.provenance.rules)}), which a level file"
            " does not hold; give them by world=segar.World(rules=...) where the file is read (--world)"
        )
    return levels.world or World()
