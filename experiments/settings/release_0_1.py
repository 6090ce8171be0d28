"""The names of release 0.1, in which runs were named by where the code lay, and what they are called now."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from experiments.settings.algorithms import TARGET, kind_of
from experiments.settings.errors import ConfigError
from experiments.settings.run import RunConfig

KIND_OF_TYPE = {
    "experiments.config:PPOConfig": "ppo",
    "experiments.recurrent_ppo:RecurrentPPOConfig": "ppo_recurrent",
    "experiments.curl:CURLConfig": "curl",
    "experiments.spr:SPRConfig": "spr",
    "experiments.sac:SACConfig": "sac",
    "experiments.drq:DrQConfig": "drq",
}
ENCODERS = {"experiments.drq:cnn_2022": "cnn_2022"}
TASKS = {"experiments.conditions:conditional_puttputt": "conditional_puttputt"}
TYPE_IS_GONE = "since release 0.2 kind (curl) or _target_ (my_lab.mine.MineConfig) names the class of an algorithm"
SETTINGS = (("algorithm", "encoder", ENCODERS), ("task", "name", TASKS))  # settings whose values have other names now


def with_new_names(data: Mapping[str, Any]) -> dict[str, Any]:
    """The plain data of a run folder of release 0.1 with today's names; data of today as they are."""
    groups = {key: dict(value) if isinstance(value, Mapping) else value for key, value in data.items()}
    algorithm = groups.get("algorithm")
    if isinstance(algorithm, dict) and "type" in algorithm:
        groups["algorithm"] = {**new_type(algorithm.pop("type")), **algorithm}
    for group, setting, names in SETTINGS:
        if setting in groups.get(group, {}):
            groups[group][setting] = names.get(groups[group][setting], groups[group][setting])
    return groups


def refuse_old_names(data: Mapping[str, Any]) -> None:
    """Raises :class:`ConfigError` that says the new name where ``data`` has a name of release 0.1."""
    new = with_new_names(data)
    if "type" in data.get("algorithm", {}):
        ((setting, value),) = new_type(data["algorithm"]["type"]).items()
        raise ConfigError(f"algorithm.type: {TYPE_IS_GONE}, here {setting}: {value}")
    for group, setting, _ in SETTINGS:
        old = data.get(group, {}).get(setting)
        if old is not None and old != new[group][setting]:
            raise ConfigError(f"{group}.{setting}: '{old}' is called '{new[group][setting]}' since release 0.2")


def new_type(old: str) -> dict[str, str]:
    """The setting that names the algorithm which ``type: old`` named."""
    return {"kind": KIND_OF_TYPE[old]} if old in KIND_OF_TYPE else {TARGET: str(old).replace(":", ".")}


def label_in_0_1(config: RunConfig) -> str:
    """The name that release 0.1 gave the run with these settings, by which its results are stored."""
    identity = config.identity()
    cls = type(config.algorithm)
    identity["algorithm"]["type"] = old_name(identity["algorithm"].pop("kind"), KIND_OF_TYPE)
    if identity["algorithm"]["type"] == kind_of(cls):  # an algorithm of the user's own
        identity["algorithm"]["type"] = f"{cls.__module__}:{cls.__qualname__}"
    for group, setting, names in SETTINGS:
        if setting in identity[group]:
            identity[group][setting] = old_name(identity[group][setting], names)
    digest = hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()[:8]
    return config.label().removesuffix(config.hash()) + digest


def old_name(new: str, names: Mapping[str, str]) -> str:
    """The name that was ``new``'s in release 0.1."""
    return next((old for old, now in names.items() if now == new), new)
