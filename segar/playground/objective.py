"""What a page needs to measure how far apart its two level sets are, and to state them in Python and in settings."""

from typing import Any

from segar import language, metrics
from segar.errors import LevelError
from segar.language import Factor, Parameter
from segar.levels import TASK_LEVELS, LevelDistribution, Levels, entity_types, families, family
from segar.noise import Noise, Wrapped
from segar.playground.world import density


def described_objective(train: Levels, test: Levels) -> dict[str, Any]:
    """The units of W2 between two level sets, what it does not see, priors, and where each set comes from, as plain data.

    Entity types and world parameters are those of both sets, matched by class; a set that does not know one has -1 for
    its number there.
    """
    sets = (train, test)
    units = metrics.spread(*sets)
    densities: list[dict[str, Any] | None] = []
    parameters = dict.fromkeys(one for levels in sets for one in levels.layout.parameters)

    def number_of(law: Noise) -> int:
        found = density(law)
        if found not in densities:
            densities.append(found)
        return densities.index(found)

    def known(owner: type, factor: type[Factor]) -> dict[str, Any]:
        """A factor with the numbers of the densities of its components in each set; none where they depend on others."""
        return {
            "name": factor.__name__,
            "width": factor.width,
            "unit": factor.unit,
            "scale": units.get((owner, factor), 0.0),
            "period": factor.period,
            "of_area": factor is language.Size,  # of a hull, it follows from the outline
            "priors": [[number_of(law) for law in _laws(levels, owner, factor)] for levels in sets],
        }

    return {
        "types": [
            {
                "name": kind.__name__,
                "kinds": [_place(levels.layout.types, kind) for levels in sets],
                "factors": [known(kind, one) for one in metrics.relevant_factors(kind)],
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
        "densities": densities,
        "mismatch": metrics.MISMATCH,
        "unseen": metrics.unseen_differences(train, test),
        "origins": [_origin(levels) for levels in sets],
    }


def _laws(levels: Levels, owner: type, factor: Any) -> list[Noise]:
    if not isinstance(levels.distribution, LevelDistribution):
        return []
    try:
        if owner is Parameter:
            law = metrics.parameter_distribution(levels.distribution, factor)
        else:
            law = metrics.factor_distribution(levels.distribution, owner, factor)
    except LevelError:  # it depends on other factors, or these levels know no such things
        return []
    if factor.period is not None:
        law = Wrapped(law, factor.period)
    return [metrics.component(law, axis) for axis in range(factor.width)]


def _place(where: tuple[type, ...], one: type) -> int:
    return where.index(one) if one in where else -1


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
