"""What a page needs to measure how far apart its two level sets are, and to state them in Python and in settings."""

from typing import Any

from segar import language
from segar.language import Factor
from segar.levels import TASK_LEVELS, Levels, entity_types, families, family
from segar.metrics import MISMATCH, relevant_factors, spread, unseen_differences


def described_objective(train: Levels, test: Levels) -> dict[str, Any]:
    """The units of W2 between two level sets, what it does not see, and where each set comes from, as plain data.

    Entity types and world parameters are those of both sets, matched by class; a set that does not know one has -1 for
    its number there.
    """
    sets = (train, test)
    units = spread(*sets)
    parameters = dict.fromkeys(one for levels in sets for one in levels.layout.parameters)
    return {
        "types": [
            {
                "name": kind.__name__,
                "kinds": [_place(levels.layout.types, kind) for levels in sets],
                "factors": [_factor(one, units.get((kind, one), 0.0)) for one in relevant_factors(kind)],
            }
            for kind in entity_types(*sets)
        ],
        "parameters": [
            _factor(one, units.get((language.Parameter, one), 0.0))
            | {"default": float(one.default), "columns": [_place(levels.layout.parameters, one) for levels in sets]}
            for one in parameters
        ],
        "mismatch": MISMATCH,
        "unseen": unseen_differences(train, test),
        "origins": [_origin(levels) for levels in sets],
    }


def _place(where: tuple[type, ...], one: type) -> int:
    return where.index(one) if one in where else -1


def _factor(factor: type[Factor], scale: float) -> dict[str, Any]:
    return {
        "name": factor.__name__,
        "width": factor.width,
        "unit": factor.unit,
        "scale": scale,
        "period": factor.period,
        "of_area": factor is language.Size,  # of a hull, it follows from the outline
    }


def _origin(levels: Levels) -> dict[str, Any]:
    """The named family whose first levels these are, to the bit, and whether their rules are those of any level file."""
    origin = levels.provenance
    found: dict[str, Any] = {"seed": str(origin.seed), "split": origin.split, "own_rules": levels.world is not None}
    if origin.name in (*families(), *TASK_LEVELS):
        named = family(origin.name)
        same = (named.world, named.task) == (levels.world, levels.task)
        if same and named.sample(len(levels), seed=origin.seed, split=origin.split) == levels:
            found["family"] = origin.name
    return found
