"""From plain data (Hydra's result, or a run folder's ``config.yaml``) to the settings of a run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from experiments.settings.algorithms import NAMES_OF_CLASS, algorithm_class
from experiments.settings.construct import construct
from experiments.settings.release_0_1 import refuse_old_names
from experiments.settings.run import RunConfig


def run_config(data: Mapping[str, Any]) -> RunConfig:
    """The settings that plain data states.

    ``data["algorithm"]["kind"]`` names a built-in algorithm, ``data["algorithm"]["_target_"]`` the dataclass of another.

    Raises:
        ConfigError: a name, type or value is wrong, or a name is one of release 0.1.
    """
    refuse_old_names(data)
    settings = data.get("algorithm", {})
    own = {key: value for key, value in settings.items() if key not in NAMES_OF_CLASS}
    algorithm = construct(algorithm_class(settings), own, "algorithm")
    rest = {key: value for key, value in data.items() if key != "algorithm"}
    return construct(RunConfig, rest, "", algorithm=algorithm)
