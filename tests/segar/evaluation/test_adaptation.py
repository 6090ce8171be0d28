"""Evaluation over the trials of a level: each trial by itself, and what a policy gains from the first to the last one."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats

import segar
from segar.errors import SegarError
from segar.evaluation import QUANTITIES, adaptation_gain, episodes
from segar.observations import Joined, PreviousStep

TRAIN, TEST = (segar.family("tilesx1-easy").sample(9, seed=3, split=split) for split in ("train", "test"))
OBSERVATION = Joined(["state", PreviousStep()])


class Pushes:
    """Pushes the ball towards the goal."""

    def __call__(self, observations: np.ndarray) -> np.ndarray:
        return np.tanh(observations[:, 11:13] - observations[:, :2]).astype(np.float32)


class Learns(Pushes):
    """Does nothing in the first trial on a level, and pushes in all others."""

    def begin(self, env: Any) -> None:
        self.seen = np.zeros(env.num_envs)

    def __call__(self, observations: np.ndarray) -> np.ndarray:
        self.seen += observations[:, -4]
        return super().__call__(observations) * (self.seen > 1)[:, None]


def idle(observations: np.ndarray) -> np.ndarray:
    return np.zeros((len(observations), 2), np.float32)


def test_a_policy_without_a_memory_gains_exactly_nothing_in_a_world_without_chance():
    found = segar.evaluate_policy(Pushes(), TRAIN, TEST, observation=OBSERVATION, trials=3)
    once = segar.evaluate_policy(Pushes(), TRAIN, TEST, observation=OBSERVATION)
    assert found.test.trials == 3 and once.test.trials == 1 and len(found.test.episodes) == 27
    for quantity in QUANTITIES:
        for trial in range(3):
            np.testing.assert_array_equal(found.test.of_levels(quantity, trial), once.test.of_levels(quantity))
        assert found.test.adaptation_gain(quantity).value == 0


@pytest.mark.parametrize("batch", [512, 4])
def test_a_policy_that_learns_is_measured_trial_by_trial(monkeypatch, batch):
    monkeypatch.setattr(episodes, "BATCH", batch)
    before, after = (segar.evaluate_policy(p, TRAIN, TEST, observation=OBSERVATION) for p in (idle, Pushes()))
    found = segar.evaluate_policy(Learns(), TRAIN, TEST, observation=OBSERVATION, trials=3, episodes=2)
    for quantity in QUANTITIES:
        for trial, alike in enumerate((before, after, after)):
            np.testing.assert_array_equal(found.train.of_levels(quantity, trial), alike.train.of_levels(quantity))
        gains = after.train.of_levels(quantity) - before.train.of_levels(quantity)
        assert found.train.adaptation_gain(quantity).value == pytest.approx(gains.mean(), abs=1e-12)
    figures, gain = found.figures(), found.test.adaptation_gain("return")
    names = ("test/adaptation_gain_return", "test/adaptation_gain_return_low", "test/adaptation_gain_return_high")
    assert tuple(figures[name] for name in names) == gain and gain.value != 0
    assert figures["train/success_trial_0"] == before.train.mean("success").value
    assert "test: success in trials 0 to 2" in str(found) and "adaptation gain" not in str(before)
    assert not any("trial" in name or "adaptation" in name for name in before.figures())


def test_the_gain_has_student_s_interval_over_levels():
    rng = np.random.default_rng(0)
    level, trial = np.repeat(np.arange(20), 6), np.tile([0, 1, 2], 40)
    values = rng.normal(size=120) + trial
    of = {k: np.array([values[(level == i) & (trial == k)].mean() for i in range(20)]) for k in (0, 2)}
    expected = stats.ttest_1samp(of[2] - of[0], 0).confidence_interval(0.95)
    found = adaptation_gain(level, trial, values)
    np.testing.assert_allclose(found, ((of[2] - of[0]).mean(), expected.low, expected.high), rtol=1e-12)
    order = rng.permutation(120)
    np.testing.assert_allclose(adaptation_gain(level[order] * 3, trial[order], values[order]), found, rtol=1e-12)


def test_the_gain_of_a_share_ends_where_it_can():
    gain = adaptation_gain(np.array([0, 0, 1, 1, 2, 2]), np.array([0, 1] * 3), np.array([0, 1, 0, 1, 1, 1], bool))
    assert gain.value == pytest.approx(2 / 3) and gain.high == 1.0


def test_the_gain_of_a_table_takes_lists_and_columns():
    table = pd.DataFrame({"level": [4, 4, 9, 9], "trial": [0, 1, 0, 1], "return": [1.0, 2.0, 3.0, 5.0]})
    expected = adaptation_gain(*(table[name].to_numpy() for name in table))
    assert expected.value == 1.5
    assert adaptation_gain(*(table[name] for name in table)) == expected
    assert adaptation_gain(*(table[name].tolist() for name in table)) == expected


def test_what_cannot_be_told_is_refused():
    with pytest.raises(SegarError, match="level 7 lacks its first or its last trial"):
        adaptation_gain(np.array([3, 3, 7]), np.array([0, 1, 0]), np.zeros(3))
    with pytest.raises(SegarError, match=r"must be of one length, not of \(2,\), \(2,\), \(3,\)"):
        adaptation_gain([0, 0], [0, 1], [1.0, 2.0, 3.0])
    once = segar.evaluate_policy(idle, TRAIN, TEST)
    with pytest.raises(SegarError, match="each level was played once in a row; play several trials on it, by trials="):
        once.test.adaptation_gain()
    for call in (once.test.mean, once.test.adaptation_gain):
        with pytest.raises(SegarError, match=r"no quantity of episodes is called 'retrun'\. Did you mean 'return'"):
            call("retrun")
    found = segar.evaluate_policy(idle, TRAIN, TEST, trials=2)
    for wrong in (2, -1):
        with pytest.raises(SegarError, match=r"trial must lie in 0\.\.1, as so many were played"):
            found.test.mean("return", wrong)
