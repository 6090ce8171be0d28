"""Suites: pairs of level distributions with frozen test levels, on which methods are compared. Each is data: a text file, the
levels of its test, and the plans that solve them, all with their hashes.

The room imports ``evaluation``, ``tasks`` and what lies below them.
"""

from segar.suites.causal_twins import ALL_THAT_DIFFERS, Twin, Twins, twins
from segar.suites.causes import Cause, Causes, causes_of, find_causes, looks_like
from segar.suites.freezing import Admission, admission, freeze
from segar.suites.registration import register_suites
from segar.suites.rules_by_name import RULES
from segar.suites.sides import TEXTURED, named_observation, observation_on, side_options
from segar.suites.suite_card import card
from segar.suites.suite_evaluation import RANDOM_PLAYS, evaluate_on_side, evaluate_on_suite, plans_on
from segar.suites.suite_file import AXES, CORE, Suite, outline, read_suite, suite, suites

__all__ = [
    "ALL_THAT_DIFFERS", "AXES", "CORE", "RANDOM_PLAYS", "RULES", "TEXTURED", "Admission", "Cause", "Causes", "Suite",
    "Twin", "Twins", "admission", "card", "causes_of", "evaluate_on_side", "evaluate_on_suite", "find_causes", "freeze",
    "looks_like", "named_observation", "observation_on", "outline", "plans_on", "read_suite", "register_suites",
    "side_options", "suite", "suites", "twins",
]  # fmt: skip
