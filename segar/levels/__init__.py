"""Levels, the distributions that they are sampled from, and the probabilities and entropies of these distributions.

The room imports ``errors``, ``support``, ``language``, ``rules`` and ``noise``. ``sampling`` draws levels,
``probability`` computes what is known without sampling; others use the names that are imported here.
"""

from segar.levels import checks, moments
from segar.levels.apart import near_levels
from segar.levels.conditional import Dependent
from segar.levels.description import all_subclasses, description_of
from segar.levels.distribution import LevelDistribution
from segar.levels.distribution_text import read_distribution, written
from segar.levels.hashing import content_hash, hash_of_levels
from segar.levels.interventions import ENTITIES, drawn_mechanisms, mechanisms, set_as, with_mechanisms
from segar.levels.level_data import LEVEL_ARRAYS, Provenance
from segar.levels.level_json import level_schema
from segar.levels.level_set import Levels, levels_from_data
from segar.levels.mixing import RESERVED as RESERVED_GROUPS
from segar.levels.mixing import REST, SEPARATOR, Groups, check_fits, mixed_levels, places
from segar.levels.moments import PointSets, entity_types, gather, source_moments
from segar.levels.mutation import mutate
from segar.levels.named_families import DIFFICULTIES, TASK_LEVELS, TASKS, families, family
from segar.levels.priors import Prior, factors_needed
from segar.levels.probability.marginals import marginals, mix, slot_distributions
from segar.levels.rule_sets import active_options, rule_space_of, rules_in_words, share_rule_sets, shared_rule_sets
from segar.levels.sampling.plan import Draw, SamplingPlan, SlotGroup
from segar.levels.validity import check_levels

__all__ = [
    "DIFFICULTIES", "ENTITIES", "LEVEL_ARRAYS", "RESERVED_GROUPS", "REST", "SEPARATOR", "TASKS", "TASK_LEVELS",
    "Dependent", "Draw", "Groups", "LevelDistribution", "Levels", "PointSets", "Prior", "Provenance", "SamplingPlan",
    "SlotGroup", "active_options", "all_subclasses", "check_fits", "check_levels", "checks", "content_hash",
    "description_of", "drawn_mechanisms", "entity_types", "factors_needed", "families", "family", "gather",
    "hash_of_levels", "level_schema", "levels_from_data", "marginals", "mechanisms", "mix", "mixed_levels", "moments",
    "mutate", "near_levels", "places", "read_distribution", "rule_space_of", "rules_in_words", "set_as",
    "share_rule_sets", "shared_rule_sets", "slot_distributions", "source_moments", "with_mechanisms", "written",
]  # fmt: skip
