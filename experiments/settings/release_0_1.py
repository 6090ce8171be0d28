"""The names of release 0.1, in which runs were named by where the code lay, and what they are called now."""

from collections.abc import Iterator, Mapping
from typing import Any

from experiments.settings.algorithms import KINDS, TARGET
from experiments.settings.errors import ConfigError
from experiments.settings.run import RunConfig, digest

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
RENAMED = {"elsewhere": "imported"}  # settings of commands
TYPE_IS_GONE = "since release 0.2 kind (curl) or _target_ (my_lab.mine.MineConfig) names the class of an algorithm"
SETTINGS = (("algorithm", "encoder", ENCODERS), ("task", "name", TASKS))  # settings whose values have other names now


def with_new_names(data: Mapping[str, Any]) -> dict[str, Any]:
    """The plain data of a run folder of release 0.1 with the names of today; data of today are returned unchanged."""
    new = dict(data)
    algorithm = dict(group_of(data, "algorithm"))
    if "type" in algorithm:
        new["algorithm"] = {**new_type(algorithm.pop("type")), **algorithm}
    for group, setting, _, value in old_values(new):
        new[group] = {**new[group], setting: value}
    return new


def refuse_old_names(data: Mapping[str, Any]) -> None:
    """Raises :class:`ConfigError` that says the new name where ``data`` has a name of release 0.1."""
    algorithm = group_of(data, "algorithm")
    if "type" in algorithm:
        ((setting, value),) = new_type(algorithm["type"]).items()
        raise ConfigError(f"algorithm.type: {TYPE_IS_GONE}, here {setting}: {value}")
    for group, setting, old, new in old_values(data):
        raise ConfigError(f"{group}.{setting}: '{old}' is called '{new}' since release 0.2")


def group_of(data: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """The settings of a group; none where the data have no such group, or something else in its place."""
    return data[name] if isinstance(data.get(name), Mapping) else {}


def old_values(data: Mapping[str, Any]) -> Iterator[tuple[str, str, str, str]]:
    """Group, setting, old value and new value of the settings whose value is a name of release 0.1."""
    for group, setting, names in SETTINGS:
        old = group_of(data, group).get(setting)
        if isinstance(old, str) and old in names:
            yield group, setting, old, names[old]


def new_type(old: Any) -> dict[str, str]:
    """The setting that names the algorithm which ``type: old`` named."""
    name = str(old)
    return {"kind": KIND_OF_TYPE[name]} if name in KIND_OF_TYPE else {TARGET: name.replace(":", ".")}


def label_in_0_1(config: RunConfig) -> str:
    """The name that release 0.1 gave the run with these settings, by which its results are stored."""
    identity = config.identity()
    cls = type(config.algorithm)
    kind = identity["algorithm"].pop("kind")
    own = f"{cls.__module__}:{cls.__qualname__}"
    identity["algorithm"]["type"] = old_name(kind, KIND_OF_TYPE) if kind in KINDS else own
    for group, setting, names in SETTINGS:
        if setting in identity[group]:
            identity[group][setting] = old_name(identity[group][setting], names)
    return config.label().removesuffix(config.hash()) + digest(identity)


def old_name(new: str, names: Mapping[str, str]) -> str:
    """The name that was ``new``'s in release 0.1."""
    return next((old for old, now in names.items() if now == new), new)
