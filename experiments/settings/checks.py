"""Checks of settings: each raises :class:`ConfigError` with the dotted path of the setting and what it may be."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from experiments.settings.errors import ConfigError
from segar.errors import SegarError, did_you_mean
from segar.support import named_object

DESIGNS = ("iid", "clustered", "covering", "nuisance_only")  # kinds of segar.design that need no test levels
TARGET_DESIGN = re.compile(r"w2_(x?)(\d+(?:\.\d+)?)")  # its kind target, in the mode exact
SEEDS = 2**63  # how many different seeds all generators take


def require(holds: bool, place: str, value: Any, wanted: str) -> None:
    """Raises :class:`ConfigError` unless ``holds``."""
    if not holds:
        raise ConfigError(f"{place}: {value!r} is not allowed; it must be {wanted}")


def require_known(place: str, name: str, names: Sequence[str]) -> None:
    """Raises :class:`ConfigError` that names the nearest of ``names``, unless ``name`` is one of them."""
    if name not in names:
        raise ConfigError(f"{place}: '{name}' is unknown.{did_you_mean(name, names)}")


def require_design(place: str, name: str) -> None:
    """Raises :class:`ConfigError` unless ``name`` is in DESIGNS, or says a W2 between training and test levels.

    ``w2_4.2`` is that distance; ``w2_x1.2`` is 1.2 times the mean distance of independent sets of as many levels.
    """
    target = TARGET_DESIGN.fullmatch(name)
    if target is None and name.startswith("w2_"):
        raise ConfigError(
            f"{place}: '{name}' says no distance; w2_4.2 does, and w2_x1.2, 1.2 times that of independent sets"
        )
    if target is None:
        require_known(place, name, DESIGNS)
    else:
        require(float(target[2]) > 0, place, name, "a distance above 0")


def require_seed(place: str, seed: int) -> None:
    """Raises :class:`ConfigError` unless all generators take ``seed``."""
    require(0 <= seed < SEEDS, place, seed, f"0 or more, and less than {SEEDS}")


def import_object(name: str, place: str) -> Any:
    """The object that ``module:attribute`` names; raises :class:`ConfigError` that names ``place``."""
    try:
        return named_object(name)
    except SegarError as error:
        raise ConfigError(f"{place}: {error}") from error
