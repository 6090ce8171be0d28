"""Datasets for offline reinforcement learning in Minari's form."""

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec

from segar.datasets.dataset import Dataset, Episode
from segar.datasets.rollouts import from_leaves
from segar.envs import REWARDS, VectorEnv
from segar.errors import SegarError
from segar.levels import family
from segar.support import need
from segar.tasks import TASKS

ROOT = "MINARI_DATASETS_PATH"  # the variable in which Minari looks for its folder
UNFINISHED = ".segar-writing-"


def to_minari(
    dataset: Dataset,
    dataset_id: str,
    *,
    observation: Any = None,
    author: str = "SEGAR",
    author_email: str = "",
    description: str | None = None,
) -> Any:
    """Write a recorded dataset as a Minari dataset, shard by shard, and return it (a ``minari.MinariDataset``).

    Episodes keep their order. Observations are stored as they are, not as JPEG. ``infos`` holds the true factors,
    ``infos["Mass"]`` float64 ``(T + 1, entities)``, and ``level``, ``success`` and ``death``, also ``(T + 1,)``. The
    environment can be recovered where the levels are those of a Gymnasium id.

    Args:
        dataset_id: ``name-v0``, or ``group/name-v0``; where Minari keeps its datasets (``MINARI_DATASETS_PATH``).
        observation: the one that was recorded, unless it was 'rgb' or 'state', to tell the observation space.
        author, author_email, description: for Minari's metadata.

    Raises:
        SegarError: see :func:`minari_place`.
    """
    target = minari_place(dataset_id)
    import minari
    from minari.storage import get_dataset_path

    settings = dataset.manifest.settings
    env = VectorEnv(dataset.levels, 1, observation=observation or settings.observation, **_task_options(dataset))
    summary = f"{settings.episodes} episodes of {settings.task} on {dataset.levels!r}, played by {settings.policy}"
    shards = iter(dataset)
    with _unfinished(Path(get_dataset_path())) as root, warnings.catch_warnings():
        # Minari warns where metadata such as an environment for evaluation is not given.
        warnings.filterwarnings("ignore", category=UserWarning, module="minari")
        made = minari.create_dataset_from_buffers(
            dataset_id,
            _buffers(next(shards).episodes(), env, settings.trials),
            env=_spec_of(dataset),
            observation_space=env.single_observation_space,
            action_space=env.single_action_space,
            algorithm_name=settings.policy,
            author=author,
            author_email=author_email,
            description=description or summary,
            jpeg_encoding=False,
        )
        for shard in shards:
            made.update_dataset_from_buffer(_buffers(shard.episodes(), env, settings.trials))
        target.parent.mkdir(parents=True, exist_ok=True)
        os.replace(root / dataset_id, target)
    _list_group(dataset_id.rpartition("/")[0])
    return minari.load_dataset(dataset_id)


def minari_place(dataset_id: str) -> Path:
    """The folder that a new Minari dataset will have.

    Raises:
        SegarError: Minari is not installed, the name is none of a Minari dataset, or there is a dataset of that name.
    """
    need("writing Minari datasets", "minari", "h5py", "pyarrow")
    from minari.dataset.minari_dataset import parse_dataset_id
    from minari.storage import get_dataset_path

    try:
        parse_dataset_id(dataset_id)
    except (ValueError, TypeError):  # the second where there is no version
        raise SegarError(f"'{dataset_id}' names no Minari dataset; write name-v0, or group/name-v0") from None
    target = Path(get_dataset_path(dataset_id))
    if target.exists():
        raise SegarError(
            f"there is a Minari dataset '{dataset_id}' already, in {target}; choose another name or version"
        )
    return target


def _list_group(group: str) -> None:
    """Have Minari list the group of a dataset."""
    from minari.namespace import create_namespace, list_local_namespaces

    if group and group not in list_local_namespaces():
        create_namespace(group)


def _task_options(dataset: Dataset) -> dict[str, Any]:
    settings = dataset.manifest.settings
    return {"max_steps": settings.max_steps, "sub_steps": settings.sub_steps}


def _buffers(episodes: Iterator[Episode], env: VectorEnv, trials: int) -> list[Any]:
    """Episodes as Minari takes them."""
    from minari.data_collector import EpisodeBuffer

    return [
        EpisodeBuffer(
            seed=None,
            options={
                **{"level": episode.level, "seed": np.uint64(episode.seed), "environment": episode.environment},
                **({"trial": episode.trial} if trials > 1 else {}),
            },
            observations=from_leaves(episode.observations, env.single_observation_space),
            actions=episode.actions,  # type: ignore[arg-type]
            rewards=episode.rewards,  # type: ignore[arg-type]
            terminations=episode.terminated,  # type: ignore[arg-type]
            truncations=episode.truncated,  # type: ignore[arg-type]
            infos=_infos(episode),
        )
        for episode in episodes
    ]


def _infos(episode: Episode) -> dict[str, np.ndarray]:
    """What Minari keeps beside the observations: one value for the reset, one after each step."""
    before = np.zeros(1, np.bool_)
    return {
        **episode.factors,
        "level": np.full(len(episode) + 1, episode.level),
        "success": np.concatenate([before, episode.success]),
        "death": np.concatenate([before, episode.death]),
    }


def _spec_of(dataset: Dataset) -> EnvSpec | None:
    """The Gymnasium environment of these levels, if an id names their family, task and observation."""
    origin, settings = dataset.levels.provenance, dataset.manifest.settings
    suffixes = {f"puttputt-{reward}": suffix for suffix, reward in REWARDS.items()}
    suffix = "" if origin.name in TASKS else suffixes.get(settings.task)
    id_ = f"Segar-{origin.name}-{settings.observation}{suffix}-v0"
    n = len(dataset.levels)
    if suffix is None or id_ not in gymnasium.registry or not np.array_equal(origin.indices, np.arange(n)):
        return None
    if origin.distribution != family(str(origin.name)).hash:
        return None
    spec = gymnasium.spec(id_)
    options = {"num_levels": n, "seed": origin.seed, "split": origin.split, **_task_options(dataset)}
    if settings.trials > 1:
        options["trials"] = settings.trials
    return EnvSpec(
        id_, entry_point=spec.entry_point, vector_entry_point=spec.vector_entry_point, kwargs={**spec.kwargs, **options}
    )


@contextmanager
def _unfinished(root: Path) -> Iterator[Path]:
    """A folder within Minari's folder that stands for it inside the block, and is removed at its end."""
    before = os.environ.get(ROOT)
    root.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix=UNFINISHED, dir=root, ignore_cleanup_errors=True) as inside:
        os.environ[ROOT] = inside
        try:
            yield Path(inside)
        finally:
            if before is None:
                del os.environ[ROOT]
            else:
                os.environ[ROOT] = before
