"""The code that a run executes, as one fingerprint for each part: what a checkpoint may be resumed under.

A part is the kernel, the learner, the curriculum, the environment or the sampler of levels. The fingerprint of a kernel is that
of its text, so it changes with the rules and with nothing else. The fingerprint of Python code does not change with comments,
docstrings, layout, or the texts of error messages; of an imported module it is that of its source then. The command line, the
pictures for people, the tracking and the report are no part of it: a run does not execute them.

Beside the parts stand the user's own files, whose names have a slash (``my_lab/levels.py``, ``my_lab/scale.json``); see
:mod:`segar.experiments.runs.own_files`. What a run has recorded of files is compared with what is in them now.
"""

import hashlib
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import segar
from segar.engine import generate
from segar.envs import world_of
from segar.experiments.levels.builders import LevelFile, Prepared, observation_seen
from segar.experiments.runs.own_files import digest_executed, file_digest, own_files
from segar.experiments.runs.own_modules import OURS, find_file, modules_named, modules_reached
from segar.experiments.runs.run_folder import read_versions
from segar.experiments.runs.source_text import executed, normalised
from segar.experiments.settings import RunConfig, UniformConfig, as_data, flat
from segar.levels import Levels, hash_of_levels

CHOICE = "segar.experiments.curricula.training_levels"  # what lets a curriculum choose
# Rooms of the library that are executed beside the kernel. The rules, the task and the engine are in the kernel's text.
ENVIRONMENT = ("envs", "observations", "support")
SAMPLER = ("levels", "noise", "language")
CHANGED = "changed"  # in place of the fingerprint of a file of which nobody knows what of it was executed
PROBED = 8  # levels of each distribution that are looked at


def executed_code(prepared: Prepared) -> dict[str, str]:
    """Name of each part, and of each file of the user's own, to sixteen hexadecimal digits, for the run with these settings.

    The parts are ``kernel``, ``levels`` (some that the distributions give), ``learner``, ``curriculum`` where levels are
    endless or chosen, ``environment``, ``sampler``, and ``textures`` where the observation has them.

    Raises:
        ConfigError: a file of the user's own was edited after this process had imported it.
    """
    config = prepared.config
    parts = {**played_code(prepared), "learner": fingerprint(config.algorithm.learner.partition(":")[0])}
    if choosers := _choosers(config):
        parts["curriculum"] = _digest(fingerprint(module).encode() for module in sorted({CHOICE, *choosers}))
    return {**parts, **executed_files(prepared)}


def executed_files(prepared: Prepared) -> dict[str, str]:
    """The user's files in :func:`executed_code`; raises as that."""
    config = prepared.config
    learner, named = config.algorithm.learner.partition(":")[0], modules_named([as_data(config), prepared.task_name])
    return _files_of([learner, *_choosers(config), *named], config)


def _choosers(config: RunConfig) -> list[str]:
    """The modules that choose levels; none where environments draw from a fixed set."""
    if config.curriculum is not None:
        return [config.curriculum.chooser.partition(":")[0]]
    return [UniformConfig.chooser.partition(":")[0]] if config.levels.is_endless else []


def played_code(prepared: Prepared) -> dict[str, str]:
    """The part of :func:`executed_code` that an agent meets: its levels, its task and its observation, without the learner."""
    config = prepared.config
    named = [as_data(part) for part in (config.levels, config.task, config.observation)]
    return {**_played(prepared), **_files_of(modules_named([*named, prepared.task_name]), config)}


def code_of(settings: Any) -> dict[str, str]:
    """The part of :func:`executed_code` that the modules named in settings (plain data) are."""
    return _files_of(modules_named(settings))


def files_of_code(code: Mapping[str, str]) -> dict[str, str]:
    """The user's files in ``code``."""
    return {name: content for name, content in code.items() if "/" in name}


def code_after(code: Mapping[str, str], say: Callable[[str], None]) -> dict[str, str]:
    """``code`` as what was made by it has to record it: without a fingerprint of files that changed while it was made.

    ``say`` gets which these are. What is made so counts as made by other code than any.
    """
    changed = [name for name, digest in files_of_code(code).items() if digest_executed(name) != digest]
    if changed:
        say(
            f"warning: {', '.join(changed)} changed while this was computed, so nobody knows by which content. The results"
            " count as those of other code"
        )
    return {**code, **dict.fromkeys(changed, CHANGED)}


def probed_levels(prepared: Prepared, split: str) -> Levels:
    """The first levels of the training or the test distribution."""
    found = prepared.train_distribution if split == "train" else prepared.test_distribution
    count = min(PROBED, len(found)) if isinstance(found, LevelFile) else PROBED
    return found.sample(count, seed=0, split=split)


def combined(parts: Mapping[str, str]) -> str:
    """Sixteen hexadecimal digits for all parts together."""
    return _digest(f"{name}={value}".encode() for name, value in sorted(parts.items()))


def changed_parts(folder: Path, code: Mapping[str, str] | None) -> list[str]:
    """Names of the parts of ``code``, today's, that were others when the run in ``folder`` began; none where none began."""
    recorded = read_versions(folder)
    return [] if code is None or not recorded else differing_parts(recorded.get("code", {}), code)


def differing_parts(before: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """Names of the parts that differ, of the files recorded ``before`` in which something else is now, and of those that are
    read only now: new ones, and those that a link leads to."""
    known = {path and path.resolve() for path in map(find_file, files_of_code(before))}
    files = [name for name in files_of_code(now) if (path := find_file(name)) and path.resolve() not in known]
    files += [name for name, was in files_of_code(before).items() if was != _content_now(name)]
    parts = sorted(name for name in {*before, *now} if "/" not in name and before.get(name) != now.get(name))
    return [*parts, *sorted(files)]


def fingerprint(module: str) -> str:
    """Sixteen hexadecimal digits over ``module`` and all modules that it reaches; of one of ours, those of the first call."""
    return _of_ours(module) if module.startswith(f"{OURS}.") else _of_modules(module)


def _of_modules(module: str) -> str:
    return _digest(normalised(executed(path)) for _, path in sorted(modules_reached(module).items()))


def _played(prepared: Prepared) -> dict[str, str]:
    """The parts for levels, task and observation."""
    task = prepared.task
    train, test = (probed_levels(prepared, split) for split in ("train", "test"))
    parts = {
        "kernel": _digest([generate(train.layout, world_of(train), task.functions()).text.encode()]),
        "levels": _digest([hash_of_levels(train).encode(), hash_of_levels(test).encode()]),
    }
    parts["environment"], parts["sampler"] = _library(ENVIRONMENT), _library(SAMPLER)
    if "textures" in observation_seen(prepared.config).name:
        parts["textures"] = _library(("textures",))
    return parts


def _files_of(modules: Iterable[str], config: RunConfig | None = None) -> dict[str, str]:
    """The user's files that make these modules, some of which the options of the task or of the observation may name."""
    options = {} if config is None else flat({"task": config.task.options, "observation": config.observation.options})
    texts = [text for text in options.values() if isinstance(text, str)]
    return {name: content for module in dict.fromkeys(modules) for name, content in own_files(module, texts).items()}


def _content_now(name: str) -> str:
    """The fingerprint of what is in a file now; empty where there is none."""
    path = find_file(name)
    return "" if path is None else file_digest(path)


_of_ours = cache(_of_modules)  # what is executed of the library stays while a process runs


@cache
def _library(rooms: tuple[str, ...]) -> str:
    """The fingerprint of rooms of ``segar``, with the data that they ship."""
    folder = Path(segar.__file__).resolve().parent
    files = [path for room in rooms for path in sorted((folder / room).rglob("*")) if path.suffix in (".py", ".npz")]
    return _digest(normalised(executed(path)) if path.suffix == ".py" else path.read_bytes() for path in files)


def _digest(contents: Iterable[bytes]) -> str:
    digest = hashlib.sha256()
    for content in contents:
        digest.update(hashlib.sha256(content).digest())
    return digest.hexdigest()[:16]
