"""Levels: what they are, the distributions that they are sampled from, and what is known about these distributions."""

from segar.levels.checks import require_distribution, require_factors, require_generator, require_levels, require_units
from segar.levels.distribution import LevelDistribution
from segar.levels.hashing import content_hash
from segar.levels.level_data import LEVEL_ARRAYS, Provenance
from segar.levels.level_set import Levels
from segar.levels.moments import (
    PointSets,
    entity_types,
    gather,
    gather_parameters,
    gather_state,
    law_moments,
    mean_and_variance,
    moments_of_distribution,
    moments_of_levels,
)
from segar.levels.named_families.registry import DIFFICULTIES, TASK_LEVELS, TASKS, families, family
from segar.levels.priors import Prior, factors_needed
from segar.levels.probability.marginals import marginals, mix, slot_laws
from segar.levels.sampling.plan import Draw, Group, Plan

__all__ = [
    "DIFFICULTIES",
    "LEVEL_ARRAYS",
    "TASKS",
    "TASK_LEVELS",
    "Draw",
    "Group",
    "LevelDistribution",
    "Levels",
    "Plan",
    "PointSets",
    "Prior",
    "Provenance",
    "content_hash",
    "entity_types",
    "factors_needed",
    "families",
    "family",
    "gather",
    "gather_parameters",
    "gather_state",
    "law_moments",
    "marginals",
    "mean_and_variance",
    "mix",
    "moments_of_distribution",
    "moments_of_levels",
    "require_distribution",
    "require_factors",
    "require_generator",
    "require_levels",
    "require_units",
    "slot_laws",
]
