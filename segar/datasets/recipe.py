"""The recipe of a dataset: levels, seeds, policy and code, from which its episodes follow to the bit."""

import dataclasses
import functools
import hashlib
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from segar.envs import VectorEnv
from segar.errors import SegarError
from segar.levels import Levels, hash_of_levels
from segar.rules import World
from segar.support import __version__, damage_told, misfit

LEVELS = "levels.npz"
KEY = "segar"  # of the recipe in Minari's metadata
HASH_DIGITS = 16  # of the kernel
SHORT_HASH_DIGITS = 8  # of arrays in texts


@dataclass(frozen=True)
class Recipe:
    """All that decides what a dataset holds.

    Attributes:
        levels: hash of the level set; ``number_of_levels`` in it.
        kernel: hash of the compiled rules, the task and the layout of entities.
        task: its name; ``max_steps`` and ``sub_steps`` are the limits in force.
        observation, policy: in words.
        unit_actions, trials: as of :class:`segar.envs.VectorEnv`.
        seed: of the episodes.
        episodes: how many, ``batch`` of them side by side.
        version: of SEGAR, which the kernel's hash sums up.
    """

    levels: str
    number_of_levels: int
    kernel: str
    task: str
    max_steps: int
    sub_steps: int
    observation: str
    policy: str
    unit_actions: bool
    trials: int
    seed: int
    episodes: int
    batch: int
    version: str = __version__

    def numbers(self) -> list[range]:
        """The numbers of the episodes of each batch."""
        return [range(at, min(at + self.batch, self.episodes)) for at in range(0, self.episodes, self.batch)]

    def seed_of(self, batch: int) -> int:
        """The seed of the environments of a batch."""
        return int(np.random.SeedSequence([self.seed, batch]).generate_state(1, np.uint64)[0])

    def require_same(self, wanted: "Recipe", where: str) -> None:
        """Raise :class:`SegarError` that names each setting in which ``wanted`` differs."""
        old, new = asdict(self), asdict(wanted)
        differing = [name for name in old if old[name] != new[name] and name != "version"]
        if differing:
            shown = "; ".join(f"{name} ({old[name]!r} there, {new[name]!r} asked for)" for name in differing)
            by = f". The kernel changes with rules, task and code; SEGAR {self.version} recorded it"
            raise SegarError(
                f"{where} with other settings: {shown}. Ask for the same ones, or choose another name or version"
                f"{by if 'kernel' in differing else ''}"
            )


FORM = {one.name: one.type for one in fields(Recipe)}
"""The form of a recipe as data; see :func:`segar.support.misfit`."""


def recipe_from(data: Any, where: str) -> Recipe:
    """The recipe that plain data hold; raises :class:`SegarError` where they hold none."""
    if wrong := misfit(data, FORM, only=True):
        raise SegarError(f"{where} holds no recipe that this SEGAR reads: {wrong}; record the dataset again")
    return Recipe(**data)


def recipe_of(dataset: Any) -> Recipe:
    """The recipe of a Minari dataset that :func:`segar.datasets.record` made; raises :class:`SegarError` for another one."""
    metadata = dataset.storage.metadata
    if KEY not in metadata:
        raise SegarError(f"the dataset '{dataset.id}' was not recorded by segar.datasets.record: it has no recipe")
    where, there = f"the Minari dataset '{dataset.id}'", dataset.storage.total_episodes
    recipe = recipe_from(metadata[KEY], where)
    if recipe.episodes != there or min(recipe.batch, recipe.trials, recipe.seed + 1) < 1:
        raise SegarError(f"{where} has {there} episodes, which its recipe cannot be of: {recipe}; record it again")
    return recipe


def reading(place: object) -> AbstractContextManager[None]:
    """Have what Minari and HDF5 raise of damaged files be a :class:`SegarError` that says where they are."""
    return damage_told(lambda why: SegarError(f"{place} cannot be read ({why}); restore it, or remove it"))


def levels_of(dataset: Any, world: World | None = None) -> Levels:
    """The levels that a recorded Minari dataset was played on.

    Args:
        world: the rules, where the levels have rules of their own, which files do not hold.

    Raises:
        SegarError: the dataset has no recipe, or holds other levels than its recipe says.
    """
    recipe, path = recipe_of(dataset), dataset.storage.data_path / LEVELS
    levels = Levels.load(path, world)
    if (hash_of_levels(levels), len(levels)) != (recipe.levels, recipe.number_of_levels):
        raise SegarError(f"{path} holds other levels than those that were recorded; restore it, or record again")
    return levels


def hash_of_kernel(env: VectorEnv) -> str:
    """Sixteen hexadecimal digits that change with rules, task and layout."""
    return hashlib.sha256(env.simulator.source.text.encode()).hexdigest()[:HASH_DIGITS]


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
