"""MINE, InfoNCE, SMILE: nothing where there is nothing, all where there is all, and what went wrong in 2022."""

import math

import numpy as np
import pytest
import torch

from segar.analysis.probes import mine_accuracy
from segar.analysis.probes.critics import CriticSettings, infonce_value, jsd_value, smile_value
from segar.analysis.probes.information import estimate_bounds, mine_of_2022
from segar.analysis.probes.pairs import Column, Pairs
from segar.errors import SegarError


def rng(seed=0):
    return np.random.default_rng(seed)


def pairs_of(x, z, episode=None):
    n = len(x)
    episode = np.arange(n) if episode is None else episode
    columns = tuple(Column("ball", f"f{k}") for k in range(z.shape[1]))
    return Pairs(np.float32(x), z, columns, episode)


def hidden_layer(state, width, seed):
    """What an untrained layer makes of a state: many columns that depend on each other."""
    return np.maximum(state @ rng(seed).normal(size=(state.shape[1], width)), 0)


def test_shuffling_columns_finds_information_where_there_is_none():
    """The code of 2022 tells dependence within phi, not between phi and z."""
    x, z = hidden_layer(rng(4).normal(size=(1500, 6)), 256, 5), rng(6).normal(size=(1500, 5))
    assert mine_accuracy(x, z, rng(), marginal="paper") > 0.9
    assert mine_accuracy(x, z, rng(), marginal="joint") == pytest.approx(0.5, abs=0.02)


def test_the_critic_of_2022_is_right_where_its_marginal_is():
    states = [(hidden_layer(rng(s).normal(size=(1000, 6)), 256, 5), rng(s + 9).normal(size=(1000, 5))) for s in (1, 2)]
    sets = [pairs_of(*one) for one in states]
    train, test = mine_of_2022(*sets, rng())
    joint_train, joint_test = mine_of_2022(*sets, rng(), joint=True)
    assert train > 0.9 and test > 0.9
    assert joint_test == pytest.approx(0.5, abs=0.03)
    assert joint_train > joint_test + 0.02  # on the pairs that it was fitted on, some of it is learnt by heart


def test_episodes_that_resemble_themselves_fool_nobody():
    """Frames of an episode share phi and z: as independent rows they would betray each other."""
    episode = np.repeat(np.arange(100), 12)
    x = rng(7).normal(size=(100, 4))[episode] + 0.1 * rng(8).normal(size=(1200, 4))
    z = rng(9).normal(size=(100, 3))[episode]
    assert mine_accuracy(x, z, rng()) > 0.9
    assert mine_accuracy(x, z, rng(), episode=episode) == pytest.approx(0.5, abs=0.07)


@pytest.mark.parametrize("bound", ["infonce", "smile"])
def test_bounds_come_near_the_information_of_gaussians(bound):
    z = rng(10).normal(size=(2000, 2))
    x = 0.8 * z + 0.6 * rng(11).normal(size=z.shape)
    _, value = estimate_bounds(pairs_of(x, z), rng(), [bound], replicates=1)[bound]
    assert value.estimate == pytest.approx(-np.log1p(-(0.8**2)), rel=0.15)  # of two Gaussians, -log(1 - r²) / 2 each


def test_the_accuracy_of_gaussians_is_that_of_the_best_critic():
    """T > 0 where log p(x, z) > log p(x) p(z): nothing can be better."""
    r = 0.9
    z = rng(12).normal(size=200_000)
    x = r * z + math.sqrt(1 - r * r) * rng(13).normal(size=z.shape)

    def log_ratio(a, b):
        return -0.5 * math.log(1 - r * r) - (r * r * (a * a + b * b) - 2 * r * a * b) / (2 * (1 - r * r))

    best = ((log_ratio(x, z) > 0).mean() + (log_ratio(x, np.roll(z, 1)) < 0).mean()) / 2
    found, _ = estimate_bounds(pairs_of(x[:2000, None], z[:2000, None]), rng(), ["jsd"], replicates=1)["jsd"]
    assert best - 0.03 < found.estimate < best + 0.015


def test_values_of_bounds_stay_below_their_ceilings():
    scores = torch.full((64, 64), -50.0)
    scores.fill_diagonal_(50.0)
    others = 1 - torch.eye(64)
    assert jsd_value(scores, others).item() == pytest.approx(2 * math.log(2))
    assert infonce_value(scores, others).item() == pytest.approx(math.log(64), rel=1e-3)
    assert smile_value(scores, others, clip=5.0).item() == pytest.approx(55)  # no bound
    flat = torch.zeros(64, 64)
    assert [float(f(flat, others)) for f in (jsd_value, infonce_value)] == pytest.approx([0, 0], abs=1e-6)


def test_replicates_repeat_from_their_seed_and_have_an_interval():
    data = pairs_of(rng(16).normal(size=(600, 4)), rng(17).normal(size=(600, 2)))
    quick = CriticSettings(steps=50)
    first, second = (estimate_bounds(data, rng(5), ["jsd"], replicates=3, settings=quick)["jsd"] for _ in range(2))
    assert first == second
    assert first[0].n == 3 and first[0].low < first[0].estimate < first[0].high


@pytest.mark.parametrize(
    ("x", "z", "options", "message"),
    [
        (np.zeros((10, 2)), np.zeros((9, 1)), {}, "10 representations but factors of 9"),
        (np.zeros((10, 2)), np.zeros((10, 1)), {}, "no factor varies"),
        (np.full((10, 2), np.nan), np.arange(10.0), {}, "not finite"),
        (np.zeros((10, 2)), np.arange(10.0), {"marginal": "jont"}, "Did you mean 'joint'"),
        (np.zeros((10, 2)), np.arange(10.0), {"episode": np.zeros(10)}, "2 folds need at least 2 episodes"),
        (np.zeros((10, 2)), np.arange(10.0), {"marginal": "paper"}, "fewer than a batch of 64"),
    ],
)
def test_what_cannot_be_asked_says_why(x, z, options, message):
    with pytest.raises(SegarError, match=message):
        mine_accuracy(x, z, rng(), **options)
