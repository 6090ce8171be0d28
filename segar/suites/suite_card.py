"""The card of a suite: what differs, how far training and test are apart and of what that is made, and what certifies it."""

import warnings
from typing import Any

from segar.errors import PriorError, UnseenDifferenceWarning
from segar.metrics import decompose, ks, ks_by_factor, unseen_differences
from segar.suites.causal_twins import groups_in_words
from segar.suites.freezing import admission
from segar.suites.suite_file import Suite

SEED = 1  # of the training levels whose distance to the test is told
PLAYS = 5  # random episodes on each level
LEAST_KS = 1e-9  # statistics that are told


def card(suite: Suite, plays: int = PLAYS) -> dict[str, Any]:
    """All that is told of a suite, as plain data: the same numbers in a terminal and on its page.

    W2 is that of the test levels to the training levels of seed 1. Kolmogorov-Smirnov statistics are exact, of the two
    distributions, and so is the probability of a shared level, were test levels not left out of training.

    Args:
        plays: random episodes on each test level.
    """
    train = suite.sample(SEED)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnseenDifferenceWarning)  # the card says what distances do not see
        parts = decompose(train, suite.test_levels)
        joint, marginals = ks(suite.train, suite.test), ks_by_factor(suite.train, suite.test)
    unseen = unseen_differences(train, suite.test_levels, "exact")
    found = admission(suite, plays)
    shares = {name: value / parts.value**2 for name, value in parts.by_factor.items() if value > 0}
    told = {name: value for name, value in marginals.items() if value >= LEAST_KS}
    return {
        **{name: getattr(suite, name) for name in ("name", "axis", "shift", "says")},
        "differs": groups_in_words(suite),
        "training_levels": suite.training_levels,
        "test_levels": len(suite.test_levels),
        "task": suite.task.name,
        "max_steps": suite.task.max_steps,
        "hidden": ", ".join(factor.__name__ for factor in suite.hidden) or "nothing",
        "textures": " to ".join(suite.textures) or "any",
        "w2": parts.value,
        "ks": joint,
        "shared_probability": _shared(suite),
        "solved_by_planner": found.planner,
        "steps_of_plans": float(suite.plans.steps.mean()),
        "solved_by_idle": found.idle,
        "solved_by_random": found.random,
        "is_fit": found.is_fit,
        "unsolved": suite.unsolved,
        "hash": suite.hash,
        "hashes": dict(suite.hashes),
        "w2_by_factor": dict(sorted(shares.items(), key=lambda item: -item[1])),
        "ks_by_factor": dict(sorted(told.items(), key=lambda item: -item[1])),
        "unseen": list(unseen),
    }


def _shared(suite: Suite) -> float | None:
    """The probability that a test level is a training level, were none left out; None where it is not known exactly."""
    try:
        return suite.train.shared_probability(suite.training_levels, suite.test).value
    except PriorError:
        return None
