"""The core environment: a batch of episodes on the levels of a set, stepped by one compiled kernel."""

from dataclasses import replace
from functools import partial
from types import NoneType
from typing import TYPE_CHECKING, Any, TypeAlias

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from segar.engine import Simulator
from segar.envs.action_range import ActionRange
from segar.envs.checks import array_of, instance, options_of, seed_of, shown, whole_number
from segar.envs.host_episodes import HostEpisodes
from segar.envs.level_pool import LevelPool
from segar.envs.snapshots import MOST_TRIALS, Snapshot
from segar.errors import LevelError, SegarError, did_you_mean, must_be
from segar.language import Factor, Factors, Parameter, Task
from segar.levels import Levels, check_crossings, check_levels
from segar.observations import BoundObservation, ObservationLike, adapted, draws_per_episode, make_observation
from segar.rendering import RENDER_MODES, Camera, View, steps_per_second
from segar.rules import World
from segar.support import has_pygame, need
from segar.tasks import task_of

if TYPE_CHECKING:
    from segar.envs.device_episodes import DeviceEpisodes

Episodes: TypeAlias = "HostEpisodes | DeviceEpisodes"
"""Where episodes run, chosen once; both have the same face."""
MOST_ENVIRONMENTS, MOST_THREADS = 10_000_000, 1024
PARAMETERS = "parameters"  # what an intervention names in place of an entity to set a world parameter
KEPT_IN_PICKLES = (
    *("observation_space", "single_observation_space", "action_space", "single_action_space"),  # and their generators
    *("_spec", "closed", "_np_random", "_np_random_seed"),  # Gymnasium's
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
    the running episode, ``success`` and ``death`` (bool), ``contacts`` and ``unresolved_contacts`` (int64, in the
    episode), and ``factors``: the true factors by name, float64 ``(num_envs, entities)`` or ``(num_envs, entities, 2)``, 0
    where an entity lacks one; :attr:`factors` has nan there, and says which entity is what. With several trials it also holds
    ``trial`` (int64, from 0, which episode on its level runs) and ``new_level`` (bool, whether the first one on a level has
    just started). Beside each entry stands a mask, ``_level`` and so on (bool): which environments the entry is about.

    ``autoreset_mode`` says when an episode that ended is followed by the next one, as in Gymnasium. Under ``SAME_STEP`` it is
    in the same step: ``final_obs`` and ``final_info`` hold the end of the last one in the rows that the masks ``_final_obs``
    and ``_final_info`` name, and the rest is about the next episode. Under ``NEXT_STEP`` it is in the next step, which ignores
    the action and has the reward 0. Under ``DISABLED``, ``reset(options={"reset_mask": ended})`` starts it.

    Args:
        levels: the level set.
        num_envs: number of environments.
        observation: a name in :data:`segar.observations.OBSERVATIONS` such as 'state', 'rgb' or 'textures', an
            :class:`segar.observations.protocol.Observation`, or a tuple or dict of these, which makes tuples or dicts
            of arrays.
        task: the task; the one that the levels name where it is None, and PuttPutt where they name none.
        seed: seeds the draw of levels and the randomness in rules; fresh entropy where it is None.
        num_threads: threads over the batch; results do not depend on it.
        autoreset_mode: ``SAME_STEP``, ``NEXT_STEP`` or ``DISABLED``.
        copy: whether arrays that ``step`` returns are the caller's to keep; otherwise later steps overwrite them.
        max_steps, sub_steps: override the task's.
        unit_actions: whether each component of an action lies in [-1, 1], which is mapped linearly to the task's range;
            otherwise actions have the task's range themselves.
        world: rules; those of the levels' distribution where it is None.
        trials: episodes in a row on each level, from 1 up.
        render_mode: None, 'rgb_array' (:meth:`render` gives a frame of each environment, drawn for people) or 'human'
            (a window shows them).
        view: a :class:`segar.rendering.View`: size of the frames, labels, hints.
        true_factors: whether ``info`` holds ``factors``.
        device: where episodes run: 'cpu', or an NVIDIA GPU, 'cuda' or 'cuda:1'. There, actions are torch tensors, and so is all
            that ``reset`` and ``step`` return; ``info`` has no ``factors``, ``final_obs`` and ``final_info``
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
        true_factors: bool = True,
    ) -> None:
        self._arguments = {name: value for name, value in locals().items() if name not in ("self", "__class__")}
        self.closed = True  # until it is whole: Gymnasium 1.1 closes also what was refused
        instance("levels", levels, Levels, "segar.Levels, as segar.family('empty-hard').sample(100) makes them")
        num_envs = whole_number("num_envs", num_envs, 1, MOST_ENVIRONMENTS)
        num_threads = whole_number("num_threads", num_threads, 1, MOST_THREADS)
        self.trials = whole_number("trials", trials, 1, MOST_TRIALS)
        instance("task", task, (Task, NoneType), "a segar.Task, such as segar.puttputt(), or None")
        instance("world", world, (World, NoneType), "a segar.World, such as segar.World(rules=...), or None")
        instance("view", view, (View, NoneType), "a segar.rendering.View, or None")
        for name, flag in (("copy", copy), ("unit_actions", unit_actions), ("true_factors", true_factors)):
            instance(name, flag, (bool, np.bool_), "True or False")
        check_levels(levels)
        task = task or task_of(levels)
        limits = {"max_steps": max_steps, "sub_steps": sub_steps}
        self.task = replace(task, **{name: value for name, value in limits.items() if value is not None})
        known = [mode.value for mode in AutoresetMode]
        if not isinstance(autoreset_mode, AutoresetMode) and autoreset_mode not in known:
            raise SegarError(f"autoreset_mode {must_be(autoreset_mode, known)}")
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        modes = {"autoreset_mode": self.autoreset_mode, "render_modes": RENDER_MODES if has_pygame() else ["rgb_array"]}
        self.metadata = {**type(self).metadata, **modes}
        world = world or world_of(levels)
        check_crossings(levels, world, self.task.sub_steps)
        self.simulator = Simulator(world, levels.layout, self.task, num_threads)
        self.num_envs, self.copy = num_envs, copy
        self.action_range = ActionRange(self.task, bool(unit_actions))
        self._started, self._spec = False, None
        self.render_mode, camera = render_mode, None
        if render_mode is not None:
            camera = Camera(levels, self.simulator.world, self.task, num_envs, render_mode, view)
        host = HostEpisodes(
            self.simulator,
            levels,
            adapted(make_observation(observation), "for_task", self.task),
            self.action_range,
            num_envs=num_envs,
            num_threads=num_threads,
            copy=copy,
            trials=self.trials,
            true_factors=bool(true_factors),
            autoreset=self.autoreset_mode,
            seed=_fresh_seed() if seed is None else seed_of(seed),
            camera=camera,
        )
        self._episodes: Episodes = host if str(device) == "cpu" else _on_gpu(device, host)
        self.single_observation_space = self.observation.space
        self.single_action_space = gymnasium.spaces.Box(self.action_range.low, self.action_range.high, dtype=np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.metadata["render_fps"] = steps_per_second(levels, self.task)
        self.closed = False

    @property
    def spec(self) -> Any:
        """Gymnasium's description of an environment that ``gymnasium.make_vec`` made, with the limit of its episodes."""
        return self._spec

    @spec.setter
    def spec(self, spec: Any) -> None:
        self._spec = spec if spec is None else replace(spec, max_episode_steps=self.task.max_steps)

    @property
    def device(self) -> Any:
        """Where episodes run: 'cpu', or the torch device of a GPU, whose actions and results are torch tensors."""
        return self._episodes.device

    @property
    def runs_on_gpu(self) -> bool:
        """Whether episodes run on a GPU."""
        return self.device != "cpu"

    @property
    def pool(self) -> LevelPool:
        """The levels that episodes start on, with their weights, and those that running episodes go on with."""
        return self._episodes.pool

    @property
    def levels(self) -> Levels:
        """The levels that episodes start on."""
        return self._episodes.pool.drawn

    @property
    def observation(self) -> BoundObservation:
        """What observes the levels."""
        return self._episodes.observation

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict]:
        """Start the next episodes; return observations and info.

        The next one of several trials is on the same level, unless the last one ran, or a seed or levels are given.

        Args:
            seed: starts the sequence of episodes anew; where it is None the sequence goes on. Of several seeds, one for each
                environment (None: fresh entropy), each environment plays the episodes of a single environment of its seed,
                or those of the place ``environment`` of a batch.
            options: ``levels`` (int, ``(num_envs,)``): the level that each environment starts on, with its first trial;
                ``reset_mask`` (bool, ``(num_envs,)``): which environments start anew, all where it is absent;
                ``environment`` (int).

        Raises:
            LevelError: a level index is out of range, or an option is unknown or of the wrong shape.
        """
        given = options_of(options, ("levels", "reset_mask", "environment"))
        mask = self._episodes.mask_of(given.get("reset_mask"))
        chosen = array_of("reset: option 'levels'", given.get("levels"), np.int64, self.num_envs)
        place = whole_number("reset: option 'environment'", given.get("environment", 0), 0, MOST_ENVIRONMENTS)
        if chosen is not None:
            self._require_levels(chosen)
        self.require_open("reset", started=False)
        if not self._started and not mask.all():
            raise SegarError("the first reset must start all environments")
        if isinstance(seed, list | tuple | range) or getattr(seed, "ndim", 0) == 1:
            if len(seed) != self.num_envs:
                raise SegarError(f"reset: give one seed, or {self.num_envs}, not {len(seed)}")
            seed = np.array([(_fresh_seed() if s is None else seed_of(s), place) for s in seed], np.uint64)
        elif seed is not None:
            seed = seed_of(seed)
        self._started = True
        return self._episodes.reset(seed, mask, chosen)

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
        self.require_open("step")
        return self._episodes.step(actions)

    def require_open(self, method: str, started: bool = True) -> None:
        """Raise :class:`SegarError` after :meth:`close`, and before the first reset unless ``started`` is False."""
        if self.closed:
            raise SegarError(f"{method}() after close(): make other environments")
        if started and not self._started:
            raise SegarError(f"call reset() before {method}()")

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

    def info(self) -> dict[str, Any]:
        """What a reset that starts no episode would say of the running ones, without masks."""
        return self._episodes.info()

    @property
    def factors(self) -> Factors:
        """The true factors of all entities in the present states, which later steps leave alone."""
        return Factors(self.levels.layout, self.levels.layout.named(self.state().state.values))

    def factors_of(self, info: dict[str, Any], rows: Any = slice(None)) -> Factors:
        """The true factors that ``info`` of a step, or its ``final_info``, holds, with nan where an entity lacks one.

        Args:
            rows: of which environments: a slice, int ``(k,)`` or bool ``(num_envs,)``.

        Raises:
            LevelError: an environment goes on with a level that was replaced.
        """
        layout, level = self.levels.layout, info["level"][rows]
        if (level < 0).any():
            raise LevelError("the level of an environment was replaced; env.factors has the present factors")
        lacks = layout.named(np.isnan(self.levels.values[level]))
        return Factors(layout, {name: np.where(lacks[name], np.nan, info["factors"][name][rows]) for name in lacks})

    def render(self) -> tuple[np.ndarray, ...] | None:
        """A frame of each environment, uint8; None without a render mode, and for 'human', where a window shows them.

        Raises:
            SegarError: there was no reset before, or no window can be opened.
        """
        camera = self._episodes.camera
        if camera is None:
            return None
        self.require_open("render")
        return camera.render(self._episodes.now)

    def close_extras(self, **kwargs: Any) -> None:
        """Close the window, if there is one."""
        if self._episodes.camera is not None:
            self._episodes.camera.close()

    def state(self) -> Snapshot:
        """A copy of everything that decides how the episodes go on, and of the past that observations show."""
        return self._episodes.state()

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
        seen = self._episodes.restore(snapshot, pool)
        self._started = True
        return seen

    def __reduce__(self) -> tuple[Any, ...]:
        """A pickle holds the arguments, the episodes that run, and the random generators of spaces; nothing compiled."""
        kept = {name: value for name, value in vars(self).items() if name in KEPT_IN_PICKLES}
        running = self._started, self.state(), self._episodes.changed_pool(), kept
        return partial(type(self), **self._arguments), (), running

    def __setstate__(self, state: tuple[bool, Snapshot, LevelPool | None, dict[str, Any]]) -> None:
        started, snapshot, pool, kept = state
        vars(self).update(kept)
        if started:
            self.restore(snapshot, pool)
        else:
            self._episodes.resume(snapshot, pool)

    def intervene(self, entity: str, factor: type[Factor], value: Any, where: np.ndarray | None = None) -> Any:
        """Set a factor of one entity in the environments where ``where`` (bool, all if None); return observations.

        Of the entity ``"parameters"`` the factor is a world parameter. It holds in these environments until their episodes
        end, with all trials on their level, and snapshots hold it. What observations show of the past stays as it is.

        Raises:
            LevelError: no entity of that name, or it has no such factor in a chosen environment; no level can have this value;
                or things could pass each other unseen then. SegarError: a world parameter of episodes on a GPU.
        """
        self.require_open("intervene")
        layout = self.levels.layout
        if not (isinstance(factor, type) and issubclass(factor, Factor)):
            raise SegarError(f"intervene: factor must be a class such as segar.Mass, not {shown(factor)}")
        if entity == PARAMETERS and issubclass(factor, Parameter):
            if factor not in layout.parameters:
                names = [parameter.__name__ for parameter in layout.parameters]
                raise LevelError(f"no world parameter '{factor.__name__}'.{did_you_mean(factor.__name__, names)}")
        else:
            layout.slot_index(entity)
            if factor not in layout.columns:
                layout.factor(factor.__name__)
        mask = array_of("intervene: where", where, np.bool_, self.num_envs)
        return self._episodes.intervene(
            entity, factor, value, np.ones(self.num_envs, np.bool_) if mask is None else mask
        )

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
        self._episodes.replace_levels(indices, levels, self._started)

    def set_level_weights(self, weights: Any) -> None:
        """Draw the levels of all episodes that begin from now on with these weights.

        Args:
            weights: float ``(levels,)``, at least 0, relative to each other; None for a uniform draw.

        Raises:
            LevelError: the weights do not fit the levels. SegarError: episodes run on a GPU.
        """
        self._episodes.set_level_weights(weights)


def _fresh_seed() -> int:
    return int(np.random.SeedSequence().generate_state(1, np.uint64)[0])


def _on_gpu(device: Any, host: HostEpisodes) -> "Episodes":
    """The episodes on a GPU; raises :class:`SegarError` where they cannot run there."""
    need(f"device='{device}'", "torch")
    from segar.envs.device_episodes import DeviceEpisodes, open_gpu

    return DeviceEpisodes(open_gpu(device), host)


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
