"""Messages about numbers that are not finite: which entity and factor, and which rules change it."""

from collections.abc import Sequence

import numpy as np

from segar.engine.compiler.finite import changed_of_type
from segar.language import Layout, Rule
from segar.levels import Levels

MOST_PLACES = 3  # that a message names
ADVICE = (
    "Numbers must stay finite: where a rule would divide by zero, let it return None, or divide by"
    " segar.language.maximum(x, 1e-9). The states have changed: reset, or restore a snapshot and look at the step with"
    " segar.Interpreter(...).step(..., explain=True)"
)


def numbers_not_finite(layout: Layout, values: np.ndarray, wrong: np.ndarray) -> list[str]:
    """The first places of a state that are wrong, such as ``Mass of 'ball' is inf``.

    Args:
        values: float64 ``(entities, columns)``, with ``wrong`` (bool) of the same shape.
    """
    return [said for _, _, said in _places(layout, values, wrong)][:MOST_PLACES]


def state_not_finite(env: int, levels: Levels, level: int, values: np.ndarray, rules: Sequence[Rule]) -> str:
    """What to say of an environment in whose state, float64 ``(entities, columns)``, a number is not finite.

    A factor that a rule from outside this package changes is named first: that is mostly where it began.
    """
    layout, wrong = levels.layout, np.isfinite(values) == np.isnan(levels.values[level])
    said: dict[bool, list[str]] = {True: [], False: []}
    for slot, factor, place in _places(layout, values, wrong):
        kind = layout.types[levels.types[level, slot]]
        changing = [rule for rule in rules if factor in changed_of_type(rule, kind)]
        own = [rule for rule in changing if not str(rule.function.__module__).startswith("segar.")]
        names = ", ".join(rule.where for rule in own or changing)
        said[bool(own)].append(f"{place} (changed by {names})" if names else place)
    places = (said[True] + said[False])[:MOST_PLACES]
    return f"environment {env}, level {level}: after this step, {'; '.join(places)}. {ADVICE}"


def reward_not_finite(env: int, level: int, reward: float, rules: Sequence[Rule]) -> str:
    """What to say of an environment whose reward is not finite, although its state is."""
    names = ", ".join(rule.where for rule in rules)
    return f"environment {env}, level {level}: the reward of this step is {reward:g} ({names}). {ADVICE}"


def _places(layout: Layout, values: np.ndarray, wrong: np.ndarray) -> list[tuple[int, type, str]]:
    """Slot, factor and words of each factor with a wrong number."""
    return [
        (slot, factor, f"{factor.__name__} of '{name}' is {', '.join(f'{x:g}' for x in numbers[slot])}")
        for factor, column in layout.columns.items()
        for numbers in [values[:, column : column + factor.width]]
        for slot, name in enumerate(layout.names)
        if wrong[slot, column : column + factor.width].any()
    ]
