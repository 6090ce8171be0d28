from .causal_twins import ALL_THAT_DIFFERS as ALL_THAT_DIFFERS, Twin as Twin, Twins as Twins, twins
from .causes import (
    Cause as Cause,
    Causes as Causes,
    causes_of as causes_of,
    find_causes,
    looks_like as looks_like,
    write_causes as write_causes,
)
from .freezing import admission, freeze, own_suite
from .gymnasium_ids import register_suites as register_suites
from .rules_by_name import RULES as RULES
from .sides import (
    TEXTURED as TEXTURED,
    named_observation as named_observation,
    observation_on as observation_on,
    side_options,
)
from .suite_card import card as card
from .suite_evaluation import RANDOM_PLAYS as RANDOM_PLAYS, evaluate_on_side, evaluate_on_suite, plans_on as plans_on
from .suite_file import (
    Suite as Suite,
    TrainingSide as TrainingSide,
    hide_tests as hide_tests,
    outline as outline,
    read_suite,
    suite,
)
from .suite_names import AXES as AXES, CORE as CORE, suites

__all__ = [
    "admission", "evaluate_on_side", "evaluate_on_suite", "find_causes", "freeze", "own_suite", "read_suite",
    "side_options", "suite", "suites", "twins",
]  # fmt: skip
