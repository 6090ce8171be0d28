"""What conditional priors read in levels: whether a relation holds, and how other factors shift and scale a law."""

from __future__ import annotations

from typing import Any

import numpy as np

from segar.language import Entity, Factor, holds
from segar.levels.conditional import Dependent
from segar.levels.priors import Prior, relation_holds
from segar.levels.sampling.plan import Draw, Plan


def dependence(plan: Plan, block: Any, slot: int, law: Any, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Shift and scale of a slot's dependent law in each of the levels ``rows`` (of a ``Block`` or ``Levels``); None
    for another law."""
    if not isinstance(law, Dependent):
        return None
    source = slot if law.of is None else plan.layout.names.index(law.of)
    shift, scale = np.empty(len(rows)), np.empty(len(rows))
    kinds = block.types[rows, source]
    for kind in np.unique(kinds):
        mine = kinds == kind
        values, entity = block.sampled_values[rows[mine], source], plan.layout.types[kind]

        def read(
            factor: type[Factor], part: int, values: np.ndarray = values, entity: type[Entity] = entity
        ) -> np.ndarray:
            held = holds(entity, factor)
            assert held is not None  # checked where the plan was made
            return values[:, plan.layout.columns[held] + part]

        shift[mine], scale[mine] = law.shift_and_scale(read, int(mine.sum()))
    return shift, scale


def claimed(plan: Plan, block: Any, draw: Draw, prior: Prior, rows: np.ndarray) -> np.ndarray:
    """Whether the prior's relation holds for the slot's entity in each of the levels ``rows``."""
    claim = np.zeros(len(rows), dtype=bool)
    for place, row in enumerate(rows):
        values = block.sampled_values[row, draw.slot]

        def read(factor: type[Factor], component: int, values: np.ndarray = values) -> float:
            return float(values[plan.layout.columns[factor] + component])

        claim[place] = relation_holds(prior, plan.layout.types[block.types[row, draw.slot]], read)
    return claim
