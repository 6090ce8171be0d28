"""Files of studies: an experiment with the settings of its runs. How they are read, and their schema."""

import dataclasses
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from segar.experiments.commands.overrides import quoted
from segar.experiments.reproduction.experiment_file import (
    OF_GRID,
    OF_TESTS,
    TESTS,
    ClaimConfig,
    ExperimentConfig,
    GridConfig,
    Others,
    TransferConfig,
    entry,
    experiment_at,
)
from segar.experiments.runs.own_modules import is_own, names_in
from segar.experiments.runs.run_folder import LONGEST
from segar.experiments.runs.trust import settings_of_file
from segar.experiments.settings import ConfigError, add_module_path, construct, flat, require, without_files
from segar.support import data_in, read_yaml

PLAIN = re.compile(r"[A-Za-z0-9_.:/+-]+")  # values that Hydra reads without quotation marks
# Of the settings in OF_GRID: what every grid says, and what says nothing where a grid says it, too.
ALWAYS_OF_GRID, ONLY_HERE = ("families", "counts", "level_sets", "designs", "variations"), ("frames", "interval")


@dataclass(frozen=True)
class StudyConfig(ExperimentConfig):
    """What a study's file says."""

    settings: Mapping[str, Any] = entry("of all runs: choices of groups, and any by dotted names", {})


@dataclass(frozen=True)
class StudyFile:
    """A study: its name, which is the file's, the experiment as data, the settings of its runs, and the file's folder."""

    name: str
    experiment: Mapping[str, Any]
    settings: Mapping[str, Any]
    folder: Path

    def overrides(self) -> list[str]:
        """The settings as on a command line; choices of groups come first."""
        values = flat(self.settings)
        return [f"{name}={_as_text(values[name])}" for name in sorted(values, key=lambda name: "." in name)]

    def as_data(self) -> dict[str, Any]:
        """Plain data that says it all."""
        own = {"settings": dict(self.settings), "module_path": [str(self.folder)]}
        return {"name": self.name, **self.experiment, **own}


def read_study(path: Path) -> StudyFile:
    """The study in a file; from now on, modules are also looked for in the folder of the file.

    Raises:
        ConfigError: the file cannot be read, or says something wrong; the message says where. RunFolderError: it names code of
            SEGAR, of Python or of an installed package, and somebody else wrote it.
    """
    data, text = data_in(path.resolve(), "a study", ConfigError, lambda raw: (read_yaml(raw), raw.decode()), LONGEST)
    if not isinstance(data, Mapping):
        raise ConfigError(f"{path} is no study: it holds {type(data).__name__}, not keys such as title and grid")
    if not path.stem.replace("-", "_").isidentifier():
        raise ConfigError(f"{path}: the name of the file is the study's; give it letters, digits, - and _ alone")
    folder = path.resolve().parent
    add_module_path([str(folder)])
    try:
        data = without_files(data, folder=folder)
        settings_of_file(path, data, {one.package for _, one in names_in(data) if is_own(one.package)}, text)
        config = construct(StudyConfig, data, "")
        experiment = {key: value for key, value in data.items() if key != "settings"}
        experiment_at(path.stem, experiment, next(iter(config.scales), ""))
        for name, values in config.grid.items():
            wanted = "a list of one or more; leave it out, and it is as the scale has it"
            require(values != [], f"grid.{name}", values, wanted)
        check_settings(config.settings, config.grid, "settings.")
    except ConfigError as error:
        raise ConfigError(f"{path}: {str(error).replace(f'grids.{path.stem}.', '')}") from error
    return StudyFile(path.stem, experiment, config.settings, folder)


def check_settings(settings: Mapping[str, Any], grid: Mapping[str, Any], place: str = "") -> None:
    """Raises :class:`ConfigError` for settings of all runs that say nothing, because the grid of a study says it."""
    varied = grid.get("vary") or {}
    for name in flat(settings):
        by = "vary" if name in varied else OF_GRID.get("levels.train" if name == "levels" else name)
        if by in ("vary", *ALWAYS_OF_GRID) or (by in ONLY_HERE and grid.get(by) is not None):
            raise ConfigError(
                f"{place}{name}: it would say nothing beside the grid, which says it for all runs: grid.{by}"
            )


def _as_text(value: Any) -> str:
    """A value in Hydra's grammar."""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    if isinstance(value, str):
        return value if PLAIN.fullmatch(value) else quoted(value)
    if isinstance(value, Mapping):
        return "{" + ",".join(f"{key}:{_as_text(one)}" for key, one in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ",".join(map(_as_text, value)) + "]"
    return repr(value)


@dataclass(frozen=True)
class AtScale(Others, GridConfig):
    """What may differ at a scale."""


def schema() -> dict[str, Any]:
    """The JSON schema of study files (draft 2020-12), made from the dataclasses that check them."""
    classes = (StudyConfig, GridConfig, ClaimConfig, AtScale)
    _, made = TypeAdapter.json_schemas([(cls, "validation", TypeAdapter(cls)) for cls in classes])
    parts = made["$defs"]
    for part in parts.values():
        part["additionalProperties"] = False
    parts["ClaimConfig"]["allOf"] = _keys_of_tests()
    whole = parts.pop("StudyConfig")
    whole["properties"]["grid"] = _reference_to(GridConfig)
    for name, cls in (("claims", ClaimConfig), ("scales", AtScale)):
        whole["properties"][name]["additionalProperties"] = _reference_to(cls)
    about = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "A study of SEGAR"}
    return {**whole, **about, "$defs": parts}


def _reference_to(cls: type) -> dict[str, str]:
    return {"$ref": f"#/$defs/{cls.__name__}"}


def _keys_of_tests() -> list[dict[str, Any]]:
    """For each test of a claim, and for one of the user's own, which keys it does not take, and that a difference needs two
    values."""
    kinds = {name: {"const": name} for name in TESTS} | {"": {"not": {"enum": [*TESTS]}}}
    return [
        {
            "if": {"properties": {"test": kind}, "required": ["test"]},
            "then": {
                "properties": {key: False for key in OF_TESTS if key not in TESTS.get(name, ())},
                "required": ["between"] if name == "difference" else [],
            },
        }
        for name, kind in kinds.items()
    ]


def fields_text() -> str:
    """All keys of a study's file with their meanings, for people."""
    places = {"": StudyConfig, "grid.": GridConfig, "transfers[].": TransferConfig, "claims.NAME.": ClaimConfig}
    lines = []
    for place, cls in places.items():
        lines += [f"  {place + one.name:<26} {one.metadata['description']}" for one in dataclasses.fields(cls)]
    return "\n".join(["Keys of the file; title is required, and of a claim says, test and expected:", *lines])
