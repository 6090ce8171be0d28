"""How commands start: Hydra on ``conf/``, whatever the working directory, and errors as one message each."""

from __future__ import annotations

import dataclasses
import os
import re
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import hydra
import yaml
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import CompactHydraException, MissingConfigException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf

from experiments.commands.signals import Stopped
from experiments.settings import (
    CHECKOUT,
    KINDS,
    TYPE_IS_GONE,
    ConfigError,
    PPOConfig,
    RunConfig,
    as_data,
    construct,
    run_config,
)
from segar.errors import SegarError, did_you_mean

WITH_OPTIONS = ("task", "observation")  # groups whose ``options`` are the keyword arguments of what they name


def conf_dir() -> Path:
    """Absolute path of the configuration: $SEGAR_CONF, else ``conf/`` of the checkout."""
    return Path(os.environ.get("SEGAR_CONF") or CHECKOUT / "conf").resolve()


def run_command(
    task: Callable[[Any], Any],
    config_name: str = "config",
    build: Callable[[DictConfig], Any] | None = None,
    settings: Mapping[str, Any] | None = None,
) -> None:
    """Runs ``task`` with what the command line says, under Hydra (so ``--multirun`` works).

    Exits with 1 on an error, and what a user can mend ends with one message; HYDRA_FULL_ERROR=1 shows where it came
    from. Exits with 128 + n where signal n stopped it, as the shell has it.

    Args:
        build: makes the argument of ``task`` from Hydra's result; None makes a :class:`RunConfig`.
        settings: defaults beyond those of a :class:`RunConfig`, known to Hydra as ``base_<config_name>``.
    """
    register_defaults()
    if settings is not None:
        register_settings(config_name, settings)

    problems: list[SegarError] = []

    def call(config: DictConfig) -> Any:
        try:
            return task((build or build_run)(config))
        except SegarError as error:
            if HydraConfig.get().mode is RunMode.MULTIRUN:
                raise  # Hydra says which of the runs it was
            problems.append(error)  # told below; Hydra would put a line of its own before it

    full_error = os.environ.get("HYDRA_FULL_ERROR") == "1"
    os.environ["HYDRA_FULL_ERROR"] = "1"  # Hydra lets errors through, so that they are told once, and here
    try:
        hydra.main(version_base="1.3", config_path=str(conf_dir()), config_name=config_name)(call)()
    except (SegarError, CompactHydraException) as error:
        if full_error:
            raise
        sys.exit(f"error: {explain(error, settings)}")
    except KeyboardInterrupt as stop:
        print(f"{stop or 'stopped'}. The same command goes on from the last checkpoint", file=sys.stderr)
        sys.exit(128 + (stop.signal if isinstance(stop, Stopped) else signal.SIGINT))
    if problems:
        if full_error:
            raise problems[0]
        sys.exit(f"error: {explain(problems[0], settings)}")


def run_simple_command(task: Callable[[Any], Any], settings: type, about: str | None) -> None:
    """Runs ``task`` with a dataclass of ``settings`` that the command line states as ``name=value``, values as in YAML.

    For commands that have no groups of settings and no sweeps. Exits with 1 and one message where a user can mend it.
    """
    arguments = sys.argv[1:]
    fields = dataclasses.fields(settings)
    if {"-h", "--help"} & {*arguments}:
        defaults = {f.name: "required" if f.default is dataclasses.MISSING else f"default: {f.default}" for f in fields}
        print(f"{(about or '').strip()}\n\n" + "\n".join(f"  {name}=...  ({note})" for name, note in defaults.items()))
        return
    try:
        config = construct(settings, parse_settings(arguments), "")
        task(config)
    except SegarError as error:
        if os.environ.get("HYDRA_FULL_ERROR") == "1":
            raise
        sys.exit(f"error: {explain(error)}")
    except KeyboardInterrupt:
        sys.exit(128 + signal.SIGINT)


def parse_settings(arguments: Sequence[str]) -> dict[str, Any]:
    """Names and values of ``name=value``; raises :class:`ConfigError` for anything else."""
    data: dict[str, Any] = {}
    for argument in arguments:
        name, equals, value = argument.partition("=")
        if not equals or not name.isidentifier():
            raise ConfigError(f"'{argument}' is no setting; settings are given as name=value")
        try:
            data[name] = yaml.safe_load(value)
        except yaml.YAMLError as error:
            raise ConfigError(f"{name}: '{value}' cannot be read: {error}") from error
    return data


def compose(overrides: Sequence[str] = (), config_name: str = "config") -> RunConfig:
    """The settings that overrides state, as a command line would; raises :class:`SegarError`."""
    register_defaults()
    within = GlobalHydra.instance().is_initialized()  # a command is at work, on the same files
    try:
        with nullcontext() if within else hydra.initialize_config_dir(str(conf_dir()), version_base="1.3"):
            return build_run(hydra.compose(config_name, list(overrides)))
    except CompactHydraException as error:
        raise ConfigError(explain(error)) from error


def build_run(config: DictConfig) -> RunConfig:
    """Hydra's result as a :class:`RunConfig`; nothing after this sees a ``DictConfig``. Raises :class:`ConfigError`."""
    return run_config(plain(config))


def plain(config: DictConfig) -> dict[str, Any]:
    """Hydra's result as plain data."""
    data = OmegaConf.to_container(config, resolve=True)
    assert isinstance(data, dict)
    return {str(key): value for key, value in data.items()}


def register_defaults() -> None:
    """Tells Hydra the defaults, which live in the dataclasses, as plain data: it knows their names, we check the rest.

    The defaults of each kind of algorithm are the choice ``base_<kind>`` of the group ``algorithm``.
    """
    store = ConfigStore.instance()
    store.store(name="base_config", node={key: v for key, v in as_data(RunConfig()).items() if key != "algorithm"})
    for kind, cls in KINDS.items():
        store.store(group="algorithm", name=f"base_{kind}", node=as_data(cls()))


def register_settings(config_name: str, settings: Mapping[str, Any]) -> None:
    """Tells Hydra the defaults of a command's own settings, as ``base_<config_name>``."""
    ConfigStore.instance().store(name=f"base_{config_name}", node=dict(settings))


def explain(error: Exception, settings: Mapping[str, Any] | None = None) -> str:
    """What is wrong, and the nearest right name; in one message."""
    if isinstance(error, MissingConfigException) and error.options is not None:
        group, _, name = str(error.missing_cfg_file).rpartition("/")
        options = [option for option in error.options if not option.startswith("base_")]
        return f"no {group} is called '{name}'.{did_you_mean(name, options)}"
    unknown = re.search(r"Could not override '([^']+)'", str(error))
    if unknown:
        if unknown[1] == "algorithm.type":
            return f"algorithm.type: {TYPE_IS_GONE}"
        group, _, option = unknown[1].partition(".options.")
        if option and group in WITH_OPTIONS:
            return f"{unknown[1]} has no value yet; with a + before it, it gets one: +{unknown[1]}=..."
        experiment = re.match(r"grids\.(\w+)\.", unknown[1])
        if experiment and (conf_dir() / "experiment" / f"{experiment[1]}.yaml").exists():
            return (
                f"the file of {experiment[1]} does not state {unknown[1]}; ++ adds what it does not: ++{unknown[1]}=..."
            )
        return f"no setting is called '{unknown[1]}'.{did_you_mean(unknown[1], setting_names(settings))}"
    cause = f"\n{error.__cause__}" if error.__cause__ is not None else ""
    if isinstance(error, CompactHydraException):
        return f"{error}{cause}"
    return "\n".join([str(error), *getattr(error, "__notes__", ())])


def setting_names(more: Mapping[str, Any] | None = None) -> list[str]:
    """Dotted names of all settings of a run that have a default, of the groups, and of ``more`` settings."""

    def names(data: Mapping[str, Any], place: str = "") -> list[str]:
        found = []
        for key, value in data.items():
            found.append(f"{place}{key}")
            found += names(value, f"{place}{key}.") if isinstance(value, Mapping) else []
        return found

    return names({**as_data(RunConfig(algorithm=PPOConfig())), **(more or {})})
