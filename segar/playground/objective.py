"""What a page needs to measure how far apart its two level sets are, and to state them in Python and in settings."""

from collections.abc import Sequence
from typing import Any

from segar import language
from segar.errors import LevelError
from segar.language import Factor, Parameter
from segar.levels import TASK_LEVELS, LevelDistribution, Levels, entity_types, families, family
from segar.metrics import (
    MISMATCH,
    component,
    factor_distribution,
    parameter_distribution,
    relevant_factors,
    spread,
    unseen_differences,
)
from segar.noise import Noise, Wrapped
from segar.playground.world import density


def described_objective(train: Levels, test: Levels) -> dict[str, Any]:
    """The units of W2 between two level sets, what it does not see, priors, and where each set comes from, as plain data.

    Entity types and world parameters are those of both sets, matched by class; a set that does not know one has -1 for
    its number there.
    """
    sets = (train, test)
    units = spread(*sets)
    priors = _Priors(sets)
    parameters = dict.fromkeys(one for levels in sets for one in levels.layout.parameters)

    def known(owner: type, factor: type[Factor]) -> dict[str, Any]:
        return _factor(factor, units.get((owner, factor), 0.0)) | {"priors": priors.of(owner, factor)}

    return {
        "types": [
            {
                "name": kind.__name__,
                "kinds": [_place(levels.layout.types, kind) for levels in sets],
                "factors": [known(kind, one) for one in relevant_factors(kind)],
            }
            for kind in entity_types(*sets)
        ],
        "parameters": [
            {
                **known(Parameter, one),
                "default": float(one.default),
                "columns": [_place(levels.layout.parameters, one) for levels in sets],
            }
            for one in parameters
        ],
        "densities": priors.densities,
        "mismatch": MISMATCH,
        "unseen": unseen_differences(train, test),
        "origins": [_origin(levels) for levels in sets],
    }


class _Priors:
    """The densities of priors in both sets, each once."""

    def __init__(self, sets: Sequence[Levels]) -> None:
        self.sets = sets
        self.densities: list[dict[str, Any] | None] = []

    def of(self, owner: type, factor: type[Factor]) -> list[list[int]]:
        """In each set, the number of the density of each component of a factor; none where it depends on other factors."""
        return [[self._number(law) for law in _laws(levels, owner, factor)] for levels in self.sets]

    def _number(self, law: Noise) -> int:
        found = density(law)
        if found not in self.densities:
            self.densities.append(found)
        return self.densities.index(found)


def _laws(levels: Levels, owner: type, factor: Any) -> list[Noise]:
    if not isinstance(levels.distribution, LevelDistribution):
        return []
    try:
        if owner is Parameter:
            law = parameter_distribution(levels.distribution, factor)
        else:
            law = factor_distribution(levels.distribution, owner, factor)
    except LevelError:  # it depends on other factors, or these levels know no such things
        return []
    if factor.period is not None:
        law = Wrapped(law, factor.period)
    return [component(law, axis) for axis in range(factor.width)]


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
