"""What Hydra knows beside the files of ``conf/``: the defaults of all settings, and the choices that are only a name.

Nodes are plain data, made from the dataclasses, and not the dataclasses themselves. Hydra then knows every name; types and
values are checked once, by :func:`segar.experiments.settings.construct`. OmegaConf's typed nodes would refuse 5e5 as a whole
number, and a file could not put the settings of ``ppo_fast`` under those of CURL.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hydra.core.config_store import ConfigStore
from omegaconf import OmegaConf

import segar
from segar.experiments.settings import (
    NO_CURRICULUM,
    OWN_CLASSES,
    OWN_TASK,
    TRACKERS,
    ConfigError,
    RunConfig,
    as_data,
    class_named,
)
from segar.levels import TASK_LEVELS, families
from segar.observations import OBSERVATIONS
from segar.suites import outline, suites
from segar.support import WORKSPACE
from segar.tasks import TASKS

WITH_OPTIONS = ("task", "observation")
"""The groups with ``options``: keyword arguments of the named task or observation, which knows them. Any may be set without
a ``+``."""


# For conf/config.yaml; when the module is imported, because the workers of launchers read that file's settings, too.
OmegaConf.register_new_resolver(
    "runs_root", lambda root: str(Path(root or WORKSPACE / "runs").expanduser()), replace=True
)


CONF = (Path(segar.__file__).parent / "conf").resolve()  # in the package and in the checkout


def register_settings(config_name: str = "config", settings: Mapping[str, Any] | None = None) -> None:
    """Registers all that Hydra is to know; may be called again.

    The defaults of a kind of algorithm are the choice ``base_<kind>`` of the group ``algorithm``, and so for curricula. Where
    ``conf/`` has a file for a choice, the file says it all.

    Args:
        settings: the defaults of a command's own settings, which are registered as ``base_<config_name>``.
    """
    store = ConfigStore.instance()
    if settings is not None:
        store.store(name=f"base_{config_name}", node=dict(settings))
    base = {key: value for key, value in as_data(RunConfig()).items() if key not in OWN_CLASSES}
    for group in WITH_OPTIONS:
        base[group] |= {"options": OmegaConf.create({}, flags={"struct": False})}
    store.store(name="base_config", node=base)
    for group, (_, known) in OWN_CLASSES.items():
        for kind, config in known.items():
            store.store(group=group, name=f"base_{kind}", node=as_data(config()))
    store.store(group="curriculum", name=NO_CURRICULUM, node={"name": NO_CURRICULUM})
    for name in suites():
        about = outline(name)
        levels = {"train": name, "count": about["training_levels"], "test_count": about["test_levels"]}
        store.store(group="suite", name=name, node=levels, package="levels")
    choices = {
        "levels": ("train", (*families(), *TASK_LEVELS)),
        "task": ("name", (OWN_TASK, *TASKS)),
        "observation": ("name", OBSERVATIONS),
        "tracking": ("name", TRACKERS),
    }
    for group, (setting, names) in choices.items():
        for name in names:
            if not (CONF / group / f"{name}.yaml").exists():
                store.store(group=group, name=name, node={setting: name})


def register_own(group: str, name: str) -> str:
    """Makes the algorithm or the curriculum of the settings class ``module:Class`` known with its defaults; returns the choice
    that names it.

    Raises:
        ConfigError: it is no settings class of that group, or has settings without a default.
    """
    (base, known), choice = OWN_CLASSES[group], name.replace(":", ".")
    cls = class_named(choice, base, group)
    try:
        settings = as_data(cls())
    except TypeError as error:
        raise ConfigError(f"{group}: {name} has settings without a default: {error}") from error
    if settings["name"] in known:  # inherited: the run would be called by another one's name
        settings["name"] = cls.__name__
    ConfigStore.instance().store(group=group, name=choice, node=settings)
    return choice
