"""Episodes on an NVIDIA GPU: all that changes lies in torch tensors there, and kernels that the driver compiled change it.

A step starts kernels on torch's current stream and copies nothing to the processor, nor does it wait. The kernels are those
of the processor, compiled for the GPU, so that episodes are the same to the bit.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from functools import reduce
from operator import getitem
from typing import Any, NoReturn

import numpy as np
import torch
from gymnasium.vector import AutoresetMode

from segar.engine import BY_NUMBER, Call, State, StepResult, build_kernel, for_threads, step_entry
from segar.engine.cuda.driver import Device, Driver, Kernel
from segar.envs.episode_calls import check_call, count_call, observation_calls, start_call
from segar.envs.episode_kernel import ACTION_NOT_FINITE
from segar.envs.host_episodes import SEEDS, HostEpisodes, with_masks
from segar.envs.level_pool import LevelPool
from segar.envs.snapshots import STATE_ARRAYS, Snapshot, trial_info
from segar.errors import ActionError, ConflictError, LevelError, RuleError, SegarError
from segar.language import Factor, Parameter
from segar.levels import Levels
from segar.observations import empty_batch, map_leaves

ONE_SEED = "on a GPU, environments cannot have seeds of their own; give reset() one seed for all of them"
STEPS_BETWEEN_CHECKS = 64  # a check waits for the GPU
COUNTS = {"level": "level", "length": "lengths", "contacts": "contacts", "unresolved_contacts": "unresolved_contacts"}
"""Entries of info that are int64, and the arrays of a snapshot that hold them."""


@dataclass(frozen=True)
class GPU:
    """Where kernels run, and where torch keeps the tensors for them: both are the same GPU."""

    device: Device
    tensors: torch.device

    def stream(self) -> int:
        """CUDA's handle of torch's current stream."""
        return torch.cuda.current_stream(self.tensors).cuda_stream if self.tensors.type == "cuda" else 0


def open_gpu(device: Any) -> GPU:
    """The GPU of a name such as 'cuda' or 'cuda:1', or of torch's device.

    Raises:
        SegarError: it is no such name; torch is built without CUDA; there is no driver, no such GPU, or the driver is too old.
    """
    try:
        named = torch.device(device)
    except (RuntimeError, TypeError):
        named = None
    if named is None or named.type != "cuda":
        raise SegarError(f"device must be 'cpu', 'cuda', or 'cuda:1' and so on for one of several GPUs, not {device!r}")
    if not torch.backends.cuda.is_built():
        raise SegarError(
            f"device='{named}' needs a torch that is built with CUDA, and this one ({torch.__version__}) is not; install"
            " another build of torch (pytorch.org says how), or use device='cpu'"
        )
    driver = Driver()
    opened = driver.device(named.index or 0)
    if not torch.cuda.is_available():
        raise SegarError(
            f"device='{named}': the driver is there, but torch {torch.__version__} cannot use it; torch.cuda.init() says why"
        )
    return GPU(opened, torch.device("cuda", opened.ordinal))


class DeviceEpisodes:
    """The episodes of a batch of environments on a GPU; the face is that of :class:`HostEpisodes`.

    Args:
        host: the same episodes on the processor, whose arrays :meth:`pull` brings up to date and :meth:`push` takes over. Its
            observation is made by compiled functions alone.

    Raises:
        SegarError: the observation, or drawing for people, needs the processor; or the GPU has too little memory.
    """

    camera = None

    def __init__(self, gpu: GPU, host: HostEpisodes) -> None:
        if host.camera is not None:
            raise SegarError(
                f"render_mode='{host.camera.mode}' draws on the processor: use device='cpu', or restore env.state() in an"
                " environment there"
            )
        self.device, self.host, self.pool, self.observation = gpu.tensors, host, host.pool, host.observation
        simulator, levels = host.simulator, host.pool.levels
        advice = "choose one of these, or device='cpu'"
        start, advance, write = observation_calls(host.observation, "a GPU", advice, in_rows=True)
        self._gpu, self._simulator, self._levels = gpu, simulator, levels
        self._num_envs = host.num_envs
        self._step = step_entry(simulator.world, levels.layout, simulator.task, BY_NUMBER)
        self._start = tuple(map(self._threads, (start_call(levels, host.trials), *start)))
        self._advance = tuple(map(self._threads, advance))
        self._write = tuple(map(self._threads, write))
        self._count = self._threads(count_call())
        self._check = self._threads(check_call(len(simulator.task.action_low)))
        calls = (*self._start, *self._advance, *self._write, self._count, self._check)
        entries = (self._step, *dict.fromkeys(call.entry for call in calls))
        self._kernels: dict[str, Kernel] = gpu.device.kernels(build_kernel(entries, "ptx").code.decode())
        self._steps = 0  # since the last check
        self._center, self._half_range = self._tensor(host.actions.center), self._tensor(host.actions.half_range)
        try:
            self._allocate(calls)
        except torch.OutOfMemoryError as cause:
            raise SegarError(
                f"{gpu.tensors} has too little memory for {self._num_envs} environments; take fewer"
            ) from cause

    def _threads(self, call: Call) -> Call:
        """The call with a thread per thing, which is an environment or a row of its frame."""
        space: Any = self.observation.space
        rows = reduce(getitem, call.part, space).shape[1] if call.entry.things == "frame_rows" else 1
        return for_threads(call, rows)

    def _allocate(self, calls: Iterable[Call]) -> None:
        """Copy everything to the GPU."""
        count = self._num_envs
        levels = self._simulator.arrays_of(self._levels)
        self._sizes = {"envs": count, "rows": count, "levels": len(levels.bits), "corners": levels.vertex.shape[2]}
        self._level_arrays = {f"level_{name}": self._tensor(array) for name, array in vars(levels).items()}
        self._fixed: dict[int, tuple[np.ndarray, torch.Tensor, bool]] = {}
        for call in calls:
            for argument in call.entry.arguments:
                if argument.name in call.arrays:
                    array = call.arrays[argument.name]
                    changes = bool(argument.shape) and argument.shape[0] == "envs"
                    if id(array) not in self._fixed:
                        self._fixed[id(array)] = array, self._tensor(array), changes
        self._tensors: dict[str, torch.Tensor] = {}
        for name, array in self.host.now.episode_arrays.items():
            if name == "values":  # number after number: neighbours in the batch are neighbours in memory
                self._tensors[name] = self._tensor(array.transpose(2, 1, 0)).permute(2, 1, 0)
            else:
                self._tensors[name] = self._tensor(array)
        self._tensors["errors"] = self._new((5,), torch.int64, zero=True)
        self._tensors["rows"] = torch.arange(count, device=self.device)
        self._everywhere = torch.ones(count, dtype=torch.bool, device=self.device)
        self._over = ~self._everywhere  # under NEXT_STEP, where the next step starts another episode
        self._anywhere = torch.full((count,), -1, dtype=torch.int64, device=self.device)
        most = max(call.entry.per_environment for call in calls)
        self._tensors["frame_rows"] = torch.arange(count * most, device=self.device)
        self._kept: tuple[Any, dict[str, torch.Tensor]] | None = None

    def _tensor(self, array: np.ndarray) -> torch.Tensor:
        """A copy on the GPU."""
        return torch.from_numpy(np.array(array, order="C")).to(self.device)

    def _new(self, shape: tuple[int, ...], dtype: torch.dtype, zero: bool = False) -> torch.Tensor:
        make = torch.zeros if zero else torch.empty
        return make((self._num_envs, *shape), dtype=dtype, device=self.device)

    @property
    def now(self) -> Snapshot:
        """The states and the counts of episodes, on the processor."""
        self.pull()
        return self.host.now

    def reset(self, seed: Any, mask: Any, chosen: np.ndarray | None) -> tuple[Any, dict[str, Any]]:
        """Start episodes where ``mask`` is true; arguments as of :meth:`HostEpisodes.reset`."""
        if isinstance(seed, np.ndarray):
            raise SegarError(ONE_SEED)
        if seed is not None:
            self.host.now.seed = seed
            self._tensors["episodes"].zero_()
        levels, self._over = None if chosen is None else self._tensor(chosen), self._over & ~mask
        self._start_episodes(mask, levels)
        return self.observe(), with_masks(self.info(), mask.clone())

    def step(self, actions: Any) -> tuple[Any, ...]:
        """Observations, reward, terminated, truncated and info after a step; see :meth:`segar.envs.VectorEnv.step`."""
        (seen, outcome), over = self._outputs(), self._over
        task, autoreset = self._simulator.task, self.host.autoreset
        given: dict[str, Any] = {"actions": self._actions_of(actions), "with_task": True}
        given |= {"sub_steps": task.sub_steps, "max_steps": task.max_steps, "meant": ~over, **outcome}
        given |= {f"result_{field.name}": outcome[field.name] for field in fields(StepResult)}
        self._launch(self._check, given)
        self._launch(Call(self._step, {}), given)
        self._launch_all(self._advance, given)
        self._launch(self._count, given)
        if autoreset is AutoresetMode.NEXT_STEP:
            for array in outcome.values():
                array.masked_fill_(over, 0)
            self._start_episodes(over, None)
            self._over = outcome["ended"].clone()
        self._launch_all(self._write, {"meant": self._everywhere}, seen)
        reward, terminated, truncated = outcome["reward"], outcome["terminated"], outcome["truncated"]
        success, death, ended = outcome["success"], outcome["death"], outcome["ended"]
        final: dict[str, Any] = {}
        if autoreset is AutoresetMode.SAME_STEP:
            final = {"final_obs": map_leaves(lambda part: _where(ended, part), seen), "_final_obs": ended}
            last = {name: _where(ended, part) for name, part in self.info(success & ended, death & ended).items()}
            present = ended.clone()
            final |= {"final_info": with_masks(last, present), "_final_info": present}
            success, death = success & ~ended, death & ~ended
            self._start_episodes(ended, None)
            self._launch_all(self._write, {"meant": ended}, seen)
        info = with_masks(self.info(success, death), self._everywhere.clone()) | final
        self._steps += 1
        if self._steps == STEPS_BETWEEN_CHECKS:
            self.check()
        return seen, reward, terminated, truncated, info

    def observe(self) -> Any:
        """The observations of the present states."""
        seen, _ = self._outputs()
        self._launch_all(self._write, {"meant": self._everywhere}, seen)
        return seen

    def _actions_of(self, actions: Any) -> torch.Tensor:
        """The actions as a tensor on the GPU, in the task's range; whether they are finite is seen there."""
        shape = (self._num_envs, len(self._simulator.task.action_low))
        try:
            tensor = torch.as_tensor(actions, device=self.device)
        except (TypeError, ValueError, RuntimeError) as cause:
            raise ActionError(f"actions must be numbers of shape {shape}: {cause}") from cause
        if tuple(tensor.shape) != shape or tensor.dtype == torch.bool or tensor.is_complex():
            raise ActionError(
                f"actions must be real numbers of shape {shape}, not {tensor.dtype} of shape {tuple(tensor.shape)}"
            )
        tensor = tensor.detach().to(torch.float32).contiguous()
        if not self.host.actions.is_mapped:
            return tensor
        return self._center + self._half_range * tensor.clip(-1, 1)  # rounded as on the processor

    def mask_of(self, mask: Any) -> torch.Tensor:
        """Which environments a mask names, as a tensor on the GPU; all where it is None."""
        if mask is None:
            return self._everywhere
        tensor = torch.as_tensor(mask, device=self.device)
        if tensor.dtype != torch.bool or tuple(tensor.shape) != (self._num_envs,):
            raise LevelError(
                f"reset: option 'reset_mask' must be bool of shape ({self._num_envs},), not {tensor.dtype} of shape"
                f" {tuple(tensor.shape)}"
            )
        return tensor.contiguous()

    def check(self) -> None:
        """Wait for the GPU, and say what was wrong in one of the steps since the last check.

        Raises:
            ActionError: an action was not finite. ConflictError, RuleError: see :meth:`segar.engine.Simulator.act`.
        """
        steps, self._steps = self._steps, 0
        errors = self._tensors["errors"]
        if not bool(errors.any()):
            return
        found = errors.cpu().numpy().copy()
        errors.zero_()
        note = f" (on {self.device} this is seen up to {steps} steps later)"
        wrong = np.flatnonzero(found[:, 0] == ACTION_NOT_FINITE)
        if len(wrong):
            raise ActionError(f"the action of environment {wrong[0]} was not finite; give finite float32 numbers{note}")
        state = State(**{name: self._tensors[name].cpu().numpy() for name in STATE_ARRAYS})
        try:
            self._simulator.raise_errors(found, state, self._levels, StepResult.empty(self._num_envs))
        except (ConflictError, RuleError) as error:
            raise type(error)(f"{error}{note}") from None

    def pull(self) -> None:
        """Copy the episodes, and what observations remember, to the arrays on the processor."""
        self.check()
        for name, array in self.host.now.episode_arrays.items():
            array[...] = self._tensors[name].cpu().numpy()
        self.host.over = self._over.cpu().numpy()
        for array, tensor, changes in self._fixed.values():
            if changes:
                array[...] = tensor.cpu().numpy()

    def push(self) -> None:
        """Take over episodes, and what observations remember, from the arrays on the processor."""
        for name, array in self.host.now.episode_arrays.items():
            self._tensors[name].copy_(torch.from_numpy(np.array(array)))
        self._over = self._tensor(self.host.over)
        for array, tensor, changes in self._fixed.values():
            if changes:
                tensor.copy_(torch.from_numpy(np.array(array)))

    def state(self) -> Snapshot:
        """See :meth:`segar.envs.VectorEnv.state`."""
        self.pull()
        return self.host.state()

    def restore(self, snapshot: Snapshot, pool: LevelPool | None = None) -> Any:
        """See :meth:`segar.envs.VectorEnv.restore`; episodes on a GPU keep their levels."""
        if pool is not None:
            self._keeps_levels("restore with a pool")
        if SEEDS in snapshot.memory:
            raise SegarError(ONE_SEED)
        if snapshot.parameters is not None:
            self._keeps_levels("restore with other world parameters")
        self.host.restore(snapshot)
        self.push()
        return self.observe()

    def resume(self, snapshot: Snapshot, pool: LevelPool | None) -> None:
        """See :meth:`HostEpisodes.resume`."""
        self.host.resume(snapshot, pool)
        self.push()

    def changed_pool(self) -> None:
        """None, because episodes on a GPU keep their levels."""

    def intervene(self, entity: str, factor: type[Factor], value: Any, mask: np.ndarray) -> Any:
        """See :meth:`segar.envs.VectorEnv.intervene`; episodes on a GPU keep their world parameters."""
        if issubclass(factor, Parameter):
            self._keeps_levels("intervene on a world parameter")
        self.pull()
        self.host.intervene(entity, factor, value, mask)
        self.push()
        return self.observe()

    def replace_levels(self, indices: Any, levels: Levels, playing: bool) -> None:
        """Raise :class:`SegarError`."""
        self._keeps_levels("replace_levels")

    def set_level_weights(self, weights: Any) -> None:
        """Raise :class:`SegarError`."""
        self._keeps_levels("set_level_weights")

    def _keeps_levels(self, method: str) -> NoReturn:
        raise SegarError(f"{method}: episodes on a GPU keep their levels; use device='cpu', or make other environments")

    def _start_episodes(self, where: torch.Tensor, chosen: torch.Tensor | None) -> None:
        given = {"meant": where, "seed": self.host.now.seed, "chosen": self._anywhere if chosen is None else chosen}
        self._launch_all(self._start, given)

    def info(self, success: torch.Tensor | None = None, death: torch.Tensor | None = None) -> dict[str, torch.Tensor]:
        """See :meth:`HostEpisodes.info`."""
        found = {name: self._tensors[array].clone() for name, array in COUNTS.items()}
        found["return"] = self._tensors["returns"].clone()
        for name, ends in (("success", success), ("death", death)):
            found[name] = self._new((), torch.bool, zero=True) if ends is None else ends
        return found | trial_info(self.host.trials, self._tensors["episodes"], self._tensors["lengths"])

    def _outputs(self) -> tuple[Any, dict[str, torch.Tensor]]:
        """Tensors for observations, and for what comes of a step."""
        if self._kept is not None:
            return self._kept
        empty = empty_batch(self.observation.space, 0)
        seen = map_leaves(lambda array: self._new(array.shape[1:], torch.from_numpy(array).dtype), empty)
        flags = ("terminated", "success", "death", "truncated", "ended")
        outcome = {"reward": self._new((), torch.float64), **{name: self._new((), torch.bool) for name in flags}}
        if not self.host.copy:
            self._kept = seen, outcome
        return seen, outcome

    def _launch_all(self, calls: Iterable[Call], given: Mapping[str, Any], seen: Any = None) -> None:
        """Start the kernels of calls; those that write observations write into ``seen``."""
        for call in calls:
            self._launch(call, given if seen is None else {**given, **_named(reduce(getitem, call.part, seen))})

    def _launch(self, call: Call, given: Mapping[str, Any]) -> None:
        """Start the kernel of a call."""
        entry, words = call.entry, []
        sizes = self._sizes | ({"frame_rows": self._num_envs * entry.per_environment} if entry.per_environment else {})
        for argument in entry.arguments:
            value = self._value(call, argument.name, given)
            if isinstance(value, torch.Tensor):
                words.append(value.data_ptr())
                if argument.name in call.arrays or argument.name == "frames":
                    shape = (value.numel(),) if len(argument.shape or ()) == 1 else value.shape
                    sizes |= {
                        name: size
                        for name, size in zip(argument.shape or (), shape, strict=True)
                        if isinstance(name, str)
                    }
            else:
                words.append(int(value))
        things = sizes[entry.things]
        self._kernels[entry.name].launch(
            things, [0, things, *(sizes[name] for name in entry.sizes), *words], self._gpu.stream()
        )

    def _value(self, call: Call, name: str, given: Mapping[str, Any]) -> Any:
        """What an argument is."""
        if name in call.arrays:
            return self._fixed[id(call.arrays[name])][1]
        if name in given:
            return given[name]
        if name in self._level_arrays:
            return self._level_arrays[name]
        return self._tensors[{"unresolved": "unresolved_contacts"}.get(name, name.removeprefix("state_"))]


def _where(mask: torch.Tensor, part: torch.Tensor) -> torch.Tensor:
    """The tensor where the mask is true, and 0 elsewhere."""
    return torch.where(
        mask.reshape(-1, *[1] * (part.dim() - 1)), part, torch.zeros((), dtype=part.dtype, device=part.device)
    )


def _named(part: Any) -> dict[str, torch.Tensor]:
    """The tensors of an observation by the arguments of the calls that write it."""
    if isinstance(part, dict):
        return {"out": part["state"], "mask": part["mask"]}
    return {"out": part, "mask": part, "frames": part}
