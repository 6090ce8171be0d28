"""Designs of training levels that share few rule sets."""

import numpy as np
import pytest

from segar.errors import LevelError
from segar.experiments.levels import rule_sets
from segar.experiments.levels.builders import make_levels
from segar.experiments.levels.rule_sets import situations_of
from segar.experiments.settings import ConfigError, LevelsConfig
from segar.levels import share_rule_sets, shared_rule_sets
from segar.metrics import rule_set_distances
from segar.support import emd


def levels_of(**settings):
    return make_levels(LevelsConfig(**{"train": "empty-hard", "test_count": 20, **settings}))


def rule_sets_of(design, count=40, **settings):
    return levels_of(count=count, variation="rule_space", test_variation="rule_space_unseen", design=design, **settings)


def test_training_levels_take_turns_with_as_many_rule_sets_as_the_design_says():
    train, test = rule_sets_of("rule_sets_7")
    all_of_own = rule_sets_of("rule_sets_40")[0]
    pairs = shared_rule_sets(train, all_of_own)
    np.testing.assert_array_equal(pairs[:, 1], np.arange(40) % 7)
    assert not len(shared_rule_sets(test, train))


def test_near_rule_sets_are_nearer_and_far_ones_farther_than_any_of_others(monkeypatch):
    monkeypatch.setattr(rule_sets, "SETS", 50)
    (near, test), (far, _) = (rule_sets_of(f"rule_sets_5{what}") for what in ("_near", "_far"))
    situations, every = situations_of(test), rule_sets_of("rule_sets_40")[0]
    fives = [near[:5], far[:5], *(every[first : first + 5] for first in range(0, 40, 5))]
    apart = [np.sqrt(emd(rule_set_distances(one, test, situations) ** 2)) for one in fives]
    assert apart[0] < np.mean(apart[2:]) < apart[1] and apart[0] < np.sort(apart[2:])[1]
    for picked in (near, far):
        assert len(set(shared_rule_sets(picked, every)[:, 1])) == 5
        assert picked == rule_sets_of(f"rule_sets_5_{'near' if picked is near else 'far'}")[0]


def test_rule_sets_that_cannot_be_picked_are_told():
    with pytest.raises(ConfigError, match="rule_sets_41_near: 41 rule sets cannot be picked among 40 levels"):
        rule_sets_of("rule_sets_41_near")
    with pytest.raises(ConfigError, match="rule_sets_41: rule sets: there must be 1 to 40"):
        rule_sets_of("rule_sets_41")
    with pytest.raises(ConfigError, match="one world for all"):
        levels_of(count=4, design="rule_sets_2_far")


@pytest.mark.parametrize("wrong", [0, 9, True, 1.5, [], [8], [-1], [0.5], [[1]], "two"])
def test_rule_sets_that_are_no_number_or_indices_are_refused(wrong):
    levels = rule_sets_of("iid", count=8)[0]
    with pytest.raises(LevelError, match="rule sets: "):
        share_rule_sets(levels, wrong)
