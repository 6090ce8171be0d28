"""Conditional priors in levels: where their relations hold, and how other factors shift and scale a distribution."""

from typing import Any

import numpy as np

from segar.language import Factor, holds
from segar.levels.conditional import Dependent
from segar.levels.level_data import LevelData
from segar.levels.priors import Prior, factors_read, relation_holds
from segar.levels.sampling.plan import Draw, SamplingPlan


def shift_and_scale(
    plan: SamplingPlan, levels: LevelData, slot: int, value: Any, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Shift and scale of a slot's dependent distribution in the levels ``rows``, float64 ``(rows,)`` each.

    None if ``value`` is no :class:`Dependent`.
    """
    if not isinstance(value, Dependent):
        return None
    source = slot if value.of is None else plan.layout.names.index(value.of)
    shift, scale = np.empty(len(rows)), np.empty(len(rows))
    kinds = levels.types[rows, source]
    for kind in np.unique(kinds):
        of_kind = kinds == kind

        def read(factor: type[Factor], part: int, chosen: np.ndarray = rows[of_kind], kind: int = kind) -> np.ndarray:
            held = holds(plan.layout.types[kind], factor)
            assert held is not None  # checked where the plan was made
            return levels.sampled_values[chosen, source, plan.layout.columns[held] + part]

        shift[of_kind], scale[of_kind] = value.shift_and_scale(read, int(of_kind.sum()))
    return shift, scale


def where_prior_applies(
    plan: SamplingPlan, levels: LevelData, draw: Draw, prior: Prior, rows: np.ndarray
) -> np.ndarray:
    """Whether the prior's relation holds for the slot's entity in each of the levels ``rows``, bool ``(rows,)``.

    A prior without a relation on values applies everywhere.
    """
    applies = np.ones(len(rows), dtype=bool)
    if not factors_read(prior):
        return applies
    for place, row in enumerate(rows):
        values = levels.sampled_values[row, draw.slot]

        def read(factor: type[Factor], component: int, values: np.ndarray = values) -> float:
            return float(values[plan.layout.columns[factor] + component])

        applies[place] = relation_holds(prior, plan.layout.types[levels.types[row, draw.slot]], read)
    return applies
