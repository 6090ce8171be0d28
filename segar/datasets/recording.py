"""Record what policies do: shard by shard, so that a recording that was killed goes on where it stopped."""

import dataclasses
import functools
import hashlib
from collections.abc import Callable, Mapping
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from segar.datasets.dataset import Dataset, factor_columns, write_shard
from segar.datasets.manifest import LEVELS, MANIFEST, Manifest, Settings, ShardEntry, check_files, check_same_settings
from segar.datasets.rollouts import Policy, leaves, roll_out
from segar.envs import VectorEnv
from segar.errors import SegarError
from segar.language import Task
from segar.levels import Levels, hash_of_levels
from segar.rules import World
from segar.support import LOCK, UNFINISHED, locked, need, remove_unfinished

HASH_DIGITS = 16  # of the kernel
SHORT_HASH_DIGITS = 8  # of arrays in texts
UNIFORM = "uniform"


def record(
    folder: str | PathLike[str],
    levels: Levels,
    policy: Policy | None = None,
    *,
    episodes: int = 100,
    observation: Any = "rgb",
    task: Task | None = None,
    seed: int = 0,
    episodes_per_shard: int = 64,
    policy_name: str | None = None,
    max_steps: int | None = None,
    sub_steps: int | None = None,
    world: World | None = None,
    trials: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Dataset:
    """Record episodes with all that was seen and all true factors into a folder, and return the dataset.

    Episode i plays level ``i % len(levels)``; with ``trials=k``, episodes i k to i k + k - 1 play it, one after the other. A
    shard depends on the settings and its number alone, so a recording that
    was killed goes on with the shards that are missing, to the same bits; shards that are damaged are recorded again.

    Args:
        folder: where to; made if it is not there. What is recorded there already is kept.
        levels: what is played; they are saved in the folder, too.
        policy: function of the batch of observations, ``info`` (with ``info["factors"]``) and a random generator, that
            gives actions, float32 ``(episodes of the shard, n)``; uniform where it is None.
        episodes: how many, ``episodes_per_shard`` of them in one file, played side by side; a multiple of ``trials``, to which
            those of a file are rounded down.
        observation, task, max_steps, sub_steps, world, trials: as :class:`segar.envs.VectorEnv` takes them.
        seed: of the randomness in rules, observations and policy.
        policy_name: for the manifest; else what the policy is called.
        progress: called with the number of shards that are there and of all.

    Raises:
        SegarError: pyarrow is not installed, another process records into the folder, the folder holds something else, or a
            recording with other settings (the message names them), or a file cannot be written.
    """
    need("recording", "pyarrow")
    if episodes < 1 or episodes_per_shard < 1:
        raise SegarError(f"episodes and episodes_per_shard must be at least 1, not {episodes} and {episodes_per_shard}")
    options = {"observation": observation, "task": task, "max_steps": max_steps, "sub_steps": sub_steps, "world": world}
    options["trials"] = trials
    make_env = partial(VectorEnv, levels, seed=seed, autoreset_mode="Disabled", **options)
    one = make_env(1)
    if episodes % one.trials:
        raise SegarError(f"episodes must be a multiple of trials, {one.trials}, not {episodes}")
    settings = Settings(
        levels=hash_of_levels(levels),
        number_of_levels=len(levels),
        kernel=hash_of_kernel(one),
        task=one.task.name,
        max_steps=one.task.max_steps,
        sub_steps=one.task.sub_steps,
        observation=observation if isinstance(observation, str) else fingerprint_text(observation),
        policy=policy_name or (UNIFORM if policy is None else fingerprint_text(policy)),
        seed=seed,
        episodes=episodes,
        episodes_per_shard=max(episodes_per_shard // one.trials, 1) * one.trials,
        trials=one.trials,
    )
    folder = Path(folder)
    _require_dataset_or_empty(folder)
    with locked(folder, SegarError, "wait until it has recorded, or name another folder"):
        manifest = _begun(folder, settings, levels, one)
        for number in range(settings.shards):
            if not _is_whole(folder, number, manifest):
                entry = _record_shard(folder, number, settings, make_env, policy)
                manifest = manifest.with_shard(number, entry)
                manifest.write(folder)
            if progress is not None:
                progress(number + 1, settings.shards)
        return Dataset.load(folder, world or levels.world)


def _require_dataset_or_empty(folder: Path) -> None:
    """Make the folder if it is not there; raise :class:`SegarError` where it holds something else than a dataset."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        there = {path.name for path in folder.iterdir()}
    except OSError as cause:
        raise SegarError(f"episodes cannot be recorded into {folder}: {cause.strerror}; name another folder") from cause
    foreign = [name for name in there - {LEVELS, LOCK} if not name.startswith(UNFINISHED)]
    if foreign and MANIFEST not in there:
        raise SegarError(
            f"{folder} is not empty and holds no dataset: there is {sorted(foreign)[0]}; name another folder"
        )


def hash_of_kernel(env: VectorEnv) -> str:
    """Sixteen hexadecimal digits that change with rules, task and layout."""
    return hashlib.sha256(env.simulator.source.text.encode()).hexdigest()[:HASH_DIGITS]


def _begun(folder: Path, settings: Settings, levels: Levels, env: VectorEnv) -> Manifest:
    """The manifest of a recording that was begun before, or is begun now."""
    if (folder / MANIFEST).exists():
        manifest = Manifest.read(folder)
        check_same_settings(manifest, settings, folder)
        remove_unfinished(folder)
        return manifest
    remove_unfinished(folder)
    levels.save(folder / LEVELS)
    observations, _ = env.reset(seed=0)
    arrays = {name: {"shape": list(a.shape[1:]), "dtype": str(a.dtype)} for name, a in leaves(observations).items()}
    manifest = Manifest(settings, factor_columns(levels.layout), arrays)
    manifest.write(folder)
    return manifest


def _record_shard(
    folder: Path, number: int, settings: Settings, make_env: Callable[[int], VectorEnv], policy: Policy | None
) -> ShardEntry:
    """Play the episodes of a shard and write them."""
    numbers = np.array(settings.episodes_of(number))
    rows = numbers[:: settings.trials] // settings.trials
    env = make_env(len(rows))
    seed = int(np.random.SeedSequence([settings.seed, number]).generate_state(1, np.uint64)[0])
    rng = np.random.default_rng([settings.seed, number])
    rollouts = roll_out(env, rows % len(env.levels), int(numbers[0]), seed, policy or _uniform(env), rng)
    return write_shard(folder, number, rollouts, seed, env.levels.layout)


def _uniform(env: VectorEnv) -> Policy:
    """The policy that draws from all actions uniformly."""
    space: Any = env.action_space
    return lambda observations, info, rng: rng.uniform(space.low, space.high)


def _is_whole(folder: Path, number: int, manifest: Manifest) -> bool:
    """Whether a shard is there, as the manifest says."""
    if number not in manifest.shards:
        return False
    try:
        check_files(folder, number, manifest.shards[number].files)
    except SegarError:
        return False  # it is recorded again, to the same bits
    return True


def fingerprint_text(thing: Any) -> str:
    """A text that differs for different observations or policies: classes and functions by name, arrays by hash.

    An object whose ``repr`` is an address is described by its class alone.
    """
    if isinstance(thing, np.ndarray):
        digest = hashlib.sha256(np.ascontiguousarray(thing).tobytes()).hexdigest()[:SHORT_HASH_DIGITS]
        return f"{thing.dtype}{list(thing.shape)}:{digest}"
    if isinstance(thing, functools.partial):
        given = [*map(fingerprint_text, thing.args), *_named(thing.keywords, "=")]
        return f"{fingerprint_text(thing.func)}({', '.join(given)})"
    if hasattr(thing, "__qualname__"):
        return f"{thing.__module__}.{thing.__qualname__}"
    if dataclasses.is_dataclass(thing):
        parts = {field.name: getattr(thing, field.name) for field in dataclasses.fields(thing)}
        return f"{type(thing).__name__}({', '.join(_named(parts, '='))})"
    if isinstance(thing, Mapping):
        return f"{{{', '.join(_named({fingerprint_text(key): value for key, value in thing.items()}, ': '))}}}"
    if isinstance(thing, (tuple, list)):
        return f"({', '.join(map(fingerprint_text, thing))})"
    shown = repr(thing)
    return shown if " at 0x" not in shown else f"{type(thing).__module__}.{type(thing).__qualname__}"


def _named(parts: Mapping[str, Any], separator: str) -> list[str]:
    return [f"{name}{separator}{fingerprint_text(part)}" for name, part in parts.items()]
