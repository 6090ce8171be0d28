"""The space of a search: settings by name, each with an interval or a list of choices."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from experiments.settings import ConfigError, RunConfig, as_data, construct, flat, path_of, require, run_config
from segar.errors import did_you_mean

if TYPE_CHECKING:
    from optuna.trial import Trial

SPACE = "search.space"


@dataclass(frozen=True)
class Dimension:
    """The values that one setting may take: an interval, or a list of choices."""

    low: float | None = None
    high: float | None = None
    log: bool = False  # whether all orders of magnitude are equally likely
    whole: bool = False  # whether only whole numbers are meant
    choices: tuple[Any, ...] = ()

    def suggest(self, trial: Trial, name: str) -> Any:
        """The value of the setting ``name`` in a trial."""
        if self.choices:  # Optuna takes no lists (of widths, for example), but their text
            return json.loads(str(trial.suggest_categorical(name, [json.dumps(choice) for choice in self.choices])))
        assert self.low is not None and self.high is not None
        if self.whole:
            return trial.suggest_int(name, int(self.low), int(self.high), log=self.log)
        return trial.suggest_float(name, self.low, self.high, log=self.log)

    @property
    def example(self) -> Any:
        """One of the values."""
        return self.choices[0] if self.choices else int(self.low or 0) if self.whole else self.low


def dimensions(space: Mapping[str, Any], place: str = "") -> dict[str, Dimension]:
    """Dotted name and values of each setting in a space, which is nested as the settings are.

    Raises:
        ConfigError: an entry is neither a group of settings nor an interval nor a list of choices.
    """
    found: dict[str, Dimension] = {}
    for key, value in space.items():
        name = path_of(place, key)
        if not isinstance(value, Mapping):
            raise ConfigError(f"{SPACE}.{name}: {value!r} must say low and high, or choices")
        if {"low", "high", "choices"} & value.keys():
            found[name] = _dimension(value, f"{SPACE}.{name}")
        else:
            found |= dimensions(value, name)
    return found


def _dimension(data: Mapping[str, Any], place: str) -> Dimension:
    choices = data.get("choices", [])
    require(isinstance(choices, list), place, choices, "a list of choices")
    made = construct(Dimension, {k: v for k, v in data.items() if k != "choices"}, place, choices=tuple(choices))
    is_interval = made.low is not None and made.high is not None and made.low < made.high
    require(bool(made.choices) != is_interval, place, dict(data), "low and high, low < high; or choices")
    require(not made.log or (made.low or 0) > 0, place, made.low, "above 0, where log is true")
    return made


def with_values(run: RunConfig, values: Mapping[str, Any]) -> RunConfig:
    """``run`` with these values of settings, by dotted name; raises :class:`ConfigError` for an unknown name."""
    data = as_data(run)
    for name, value in values.items():
        *groups, last = name.split(".")
        group: Any = data
        for part in groups:
            group = group.get(part, {}) if isinstance(group, dict) else {}
        if not isinstance(group, dict) or last not in group:
            raise ConfigError(f"{SPACE}: no setting is called '{name}'.{did_you_mean(name, flat(data))}")
        group[last] = value
    return run_config(data)
