from . import checks as checks, moments as moments
from .apart import WITHOUT_EFFECT as WITHOUT_EFFECT, near_levels as near_levels
from .conditional import Dependent
from .crossings import check_crossings as check_crossings, hull_radii as hull_radii
from .description import description_of as description_of
from .distribution import LevelDistribution
from .distribution_text import read_distribution as read_distribution, written as written
from .family_names import DIFFICULTIES as DIFFICULTIES, TASKS as TASKS, TASK_LEVELS as TASK_LEVELS, families
from .hashing import content_hash as content_hash, hash_of_levels as hash_of_levels
from .interventions import (
    ENTITIES as ENTITIES,
    drawn_mechanisms as drawn_mechanisms,
    mechanisms as mechanisms,
    set_as as set_as,
    with_mechanisms as with_mechanisms,
)
from .level_data import LEVEL_ARRAYS as LEVEL_ARRAYS, Provenance as Provenance
from .level_json import level_schema as level_schema
from .level_set import Levels, levels_from_data as levels_from_data
from .mixing import (
    RESERVED_GROUPS as RESERVED_GROUPS,
    REST as REST,
    RULES as RULES,
    SEPARATOR as SEPARATOR,
    check_fits as check_fits,
    mixed_levels as mixed_levels,
    places as places,
    with_room as with_room,
)
from .moments import (
    PointSets as PointSets,
    entity_types as entity_types,
    gather as gather,
    source_moments as source_moments,
)
from .mutation import mutate as mutate
from .named_families import family
from .priors import Prior, factors_needed as factors_needed
from .probability.marginals import marginals as marginals, mix as mix, slot_distributions as slot_distributions
from .rule_sets import (
    active_options,
    rule_space_of as rule_space_of,
    rules_in_words,
    share_rule_sets as share_rule_sets,
    shared_rule_sets,
)
from .sampling.plan import Draw as Draw, SamplingPlan as SamplingPlan, SlotGroup as SlotGroup
from .validity import check_levels as check_levels

__all__ = [
    "Dependent", "LevelDistribution", "Levels", "Prior", "active_options", "families", "family", "rules_in_words",
    "shared_rule_sets",
]  # fmt: skip
