"""Record what policies do as a Minari dataset, batch by batch, so that a recording that was killed goes on where it stopped."""

import json
import os
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from itertools import islice
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec

from segar.datasets.episodes import Episode, roll_out
from segar.datasets.recipe import KEY, LEVELS, Recipe, fingerprint_text, hash_of_kernel, reading, recipe_from, recipe_of
from segar.envs import REWARDS, Policy, VectorEnv, play
from segar.errors import SegarError
from segar.evaluation import require_options
from segar.levels import Levels, family, hash_of_levels
from segar.observations import leaves
from segar.support import counted, damage_told, data_in, is_whole, locked, need, replacing
from segar.tasks import TASKS

RECIPE = "recipe.json"
DATA = "data"  # the folder within that of a dataset in which Minari keeps everything
UNFINISHED = ".segar-recording"  # in Minari's folder; Minari does not list hidden ones
UNIFORM = "uniform"
SAME_ACTION = 1e-3  # a network gives the same actions up to far less on every machine
EPISODE_BYTES = 2**17  # that an episode takes in HDF5 beside its arrays, at most
ADVICE = "make room and record again, which goes on after the last complete batch"


def record(
    dataset_id: str,
    levels: Levels,
    policy: Policy | None = None,
    *,
    episodes: int = 100,
    observation: Any = "rgb",
    seed: int = 0,
    batch: int = 64,
    policy_name: str | None = None,
    author: str = "SEGAR",
    author_email: str = "",
    description: str | None = None,
    progress: Callable[[int, int], None] | None = None,
    **options: Any,
) -> Any:
    """Record episodes with all that was seen and all true factors, and return them as a ``minari.MinariDataset``.

    Episode i plays level ``i % len(levels)``; with ``trials=k``, episodes i k to i k + k - 1 play it, one after the other. A
    batch depends on the recipe and its number alone, so a recording that was killed goes on with the batches that are
    missing, to the same bits. One that is complete is returned.

    Observations are stored as they are, not as JPEG. ``infos`` holds the true factors, ``infos["Mass"]`` float64
    ``(T + 1, entities)``, and ``level``, ``success`` and ``death``, also ``(T + 1,)``. The environment can be recovered where
    the levels are those of a Gymnasium id.

    Args:
        dataset_id: ``name-v0``, or ``group/name-v0``; where Minari keeps its datasets (``MINARI_DATASETS_PATH``).
        levels: what is played; they are saved in the dataset, too.
        policy: acts in all episodes of a batch; uniform where it is None. Its random numbers must follow from the
            environments with which it begins, such as from ``env.state().seed``.
        episodes: how many, ``batch`` of them side by side; a multiple of ``trials``, to which a batch is rounded down.
        seed: of the randomness in rules, observations and the uniform policy.
        policy_name: for the recipe; else what the policy is called.
        author, author_email, description: for Minari's metadata.
        progress: called with the number of episodes that are there and of all.
        options: of :class:`segar.envs.VectorEnv`: ``task``, ``world``, ``unit_actions``, ``trials`` and so on.

    Raises:
        SegarError: Minari is not installed, the name is none of a Minari dataset, an option is unknown, another process
            records this dataset, one of that name has other settings (the message names them), or was begun by a policy that
            takes other first actions, or a file cannot be written.
    """
    for name, value in (("episodes", episodes), ("batch", batch)):
        if not is_whole(value) or value < 1:
            raise SegarError(f"record: {name} must be a whole number from 1, not {value!r}")
    require_options("record", options, ("episodes", "batch", "policy"), ("device",))
    target = _place(dataset_id)
    import minari
    from minari.dataset.minari_storage import MinariStorage

    options = {"observation": observation, **options}
    one = VectorEnv(levels, 1, seed=seed, **options)
    if episodes % one.trials:
        raise SegarError(f"episodes must be a multiple of trials, {one.trials}, not {episodes}")
    recipe = Recipe(
        levels=hash_of_levels(levels),
        number_of_levels=len(levels),
        kernel=hash_of_kernel(one),
        task=one.task.name,
        max_steps=one.task.max_steps,
        sub_steps=one.task.sub_steps,
        observation=observation if isinstance(observation, str) else fingerprint_text(observation),
        policy=policy_name or (UNIFORM if policy is None else fingerprint_text(policy)),
        unit_actions=bool(options.get("unit_actions", False)),
        trials=one.trials,
        seed=seed,
        episodes=episodes,
        batch=max(batch // one.trials, 1) * one.trials,
    )

    def batch_of(number: int) -> tuple[VectorEnv, np.ndarray, int, Policy]:
        players = recipe.numbers()[number][:: recipe.trials]
        env = VectorEnv(levels, len(players), seed=seed, **options)
        acts = _uniform(env, [seed, number]) if policy is None else policy
        return env, np.array(players) // recipe.trials % len(levels), recipe.seed_of(number), acts

    if target.exists():
        where = f"there is a Minari dataset '{dataset_id}' already, in {target},"
        with reading(target):
            found = minari.load_dataset(dataset_id)
        recipe_of(found).require_same(recipe, where)
        _require_policy(found.iterate_episodes(recipe.numbers()[0]), where, *batch_of(0))
        return found
    summary = f"{counted(episodes, 'episode')} of {recipe.task} on {levels!r}, played by {recipe.policy}"
    with _unfinished(dataset_id, recipe) as folder:
        parts = []
        for number, numbers in enumerate(recipe.numbers()):
            parts.append(folder / f"batch-{number:05d}")
            if not parts[-1].exists():
                found = [*roll_out(*batch_of(number))]
                _write(parts[-1], found, _most_bytes(found), one, None)
            elif number == 0:
                _require_policy(_read(parts[0]), f"{folder} holds a recording", *batch_of(0))
            if progress is not None:
                progress(numbers.stop, episodes)
        whole = folder / DATA
        size = EPISODE_BYTES + sum(file.stat().st_size for part in parts for file in part.iterdir())
        _write(whole, (episode for part in parts for episode in _read(part)), size, one, _spec_of(levels, recipe))
        levels.save(whole / LEVELS)
        facts = {"dataset_id": dataset_id, "minari_version": minari.__version__, "algorithm_name": recipe.policy}
        facts |= {"author": {author}, "author_email": {author_email}, "description": description or summary}
        MinariStorage.read(whole).update_metadata({**facts, KEY: asdict(recipe)})
        target.mkdir(parents=True)
        os.replace(whole, target / DATA)
        _list_group(dataset_id.rpartition("/")[0])
    return minari.load_dataset(dataset_id)


def _uniform(env: VectorEnv, seeds: list[int]) -> Policy:
    """The policy that draws from all actions uniformly."""
    space, rng = env.action_space, np.random.default_rng(seeds)
    return lambda observations: rng.uniform(space.low, space.high)  # type: ignore[attr-defined]


def _require_policy(recorded: Iterable[Any], where: str, env: VectorEnv, played: Any, seed: int, policy: Any) -> None:
    """Raise :class:`SegarError` unless a batch begins with the recorded actions: two policies may have one name."""
    _, first = islice(play(env, policy, env.reset(seed=seed, options={"levels": played})), 2)
    there = np.stack([one.actions[0] for one in islice(recorded, 0, None, env.trials)])
    if not np.allclose(np.clip(first.action, env.action_range.low, env.action_range.high), there, atol=SAME_ACTION):
        raise SegarError(f"{where} by another policy of that name; choose another name or version")


def _place(dataset_id: str) -> Path:
    """The folder of a Minari dataset; raises :class:`SegarError` where the name is none, or Minari is not installed."""
    need("recording", "minari", "h5py")
    from minari.dataset.minari_dataset import parse_dataset_id
    from minari.storage import get_dataset_path

    with damage_told(lambda _: SegarError(f"'{dataset_id}' names no Minari dataset; write name-v0, or group/name-v0")):
        parse_dataset_id(dataset_id)
    return Path(get_dataset_path(dataset_id))


@contextmanager
def _unfinished(dataset_id: str, recipe: Recipe) -> Iterator[Path]:
    """The folder of a recording that was begun before, or is begun now; it is removed when the block ends without an error."""
    from minari.storage import get_dataset_path

    folder = Path(get_dataset_path()) / UNFINISHED / dataset_id
    with locked(folder, SegarError, "wait until it has recorded, or choose another name"):
        begun = folder / RECIPE
        if begun.exists():
            there = recipe_from(data_in(begun, "a recipe", SegarError), str(begun))
            there.require_same(recipe, f"{folder} holds a recording")
        else:
            with replacing(begun, "the recipe") as beside:
                beside.write_text(json.dumps(asdict(recipe), indent=1) + "\n", encoding="utf-8")
        try:
            yield folder
        except BaseException:
            if not any(folder.glob("batch-*")):  # there is nothing to go on from
                shutil.rmtree(folder)
            raise
    shutil.rmtree(folder)


def _most_bytes(episodes: list[Episode]) -> int:
    """As many bytes as the file of these episodes may have; chunks of HDF5 are up to half empty."""
    arrays = [leaves((one.observations, one.actions, one.rewards, one.infos)) for one in episodes]
    return sum(EPISODE_BYTES + 2 * sum(array.nbytes for array in of_one) for of_one in arrays)


def _write(place: Path, episodes: Iterable[Episode], size: int, env: VectorEnv, spec: EnvSpec | None) -> None:
    """Write episodes as Minari stores them, into a folder that is there when it is complete.

    Raises:
        SegarError: there is no room for ``size`` bytes. It is asked for before, because HDF5 crashes on a full disk.
    """
    from minari.data_collector import EpisodeBuffer
    from minari.dataset.minari_storage import MinariStorage

    beside = place.with_suffix(".writing")
    shutil.rmtree(beside, ignore_errors=True)  # of a recording that was killed
    shutil.rmtree(place, ignore_errors=True)
    with replacing(place, f"{size:,} bytes", advice=ADVICE) as room, room.open("r+b") as stream:
        getattr(os, "posix_fallocate", lambda *_: None)(stream.fileno(), 0, size)  # macOS has none
    place.unlink()
    storage = MinariStorage.new(
        beside, env.single_observation_space, env.single_action_space, spec, jpeg_encoding=False
    )
    # Seeds are beyond the default integers of HDF5.
    buffers: Any = (vars(one) | {"options": one.options | {"seed": np.uint64(one.options["seed"])}} for one in episodes)
    storage.update_episodes(EpisodeBuffer(**one) for one in buffers)
    os.replace(beside, place)


def _read(place: Path) -> Iterator[Episode]:
    """The episodes that a folder holds."""
    from minari.dataset.minari_storage import MinariStorage

    with reading(place):
        storage = MinariStorage.read(place)
        numbers = range(storage.total_episodes)
        for found, metadata in zip(storage.get_episodes(numbers), storage.get_episode_metadata(numbers), strict=True):
            yield Episode(**{name: value for name, value in found.items() if name != "id"}, options=metadata["options"])


def _list_group(group: str) -> None:
    """Have Minari list the group of a dataset."""
    from minari.namespace import create_namespace, list_local_namespaces

    if group and group not in list_local_namespaces():
        create_namespace(group)


def _spec_of(levels: Levels, recipe: Recipe) -> EnvSpec | None:
    """The Gymnasium environment of these levels, if an id names their family, task and observation."""
    origin, n = levels.provenance, len(levels)
    suffixes = {f"puttputt-{reward}": suffix for suffix, reward in REWARDS.items()}
    suffix = "" if origin.name in TASKS else suffixes.get(recipe.task)
    id_ = f"Segar-{origin.name}-{recipe.observation}{suffix}-v0"
    is_of_id = suffix is not None and id_ in gymnasium.registry and np.array_equal(origin.indices, np.arange(n))
    if not is_of_id or origin.distribution != family(str(origin.name)).hash:
        return None
    spec = gymnasium.spec(id_)
    options = {"num_levels": n, "seed": origin.seed, "split": origin.split}
    options |= {name: getattr(recipe, name) for name in ("sub_steps", "trials", "unit_actions")}
    return replace(spec, max_episode_steps=recipe.max_steps, kwargs={**spec.kwargs, **options})
