"""The reference distance has the means of the 2022 code in all panels that its measurements cover."""

import numpy as np
import pytest

import segar
from segar.metrics import w2
from tests.analysis.grids import W2

# Mean distance of n train levels to 100 test levels over 5 seeds, as the code of 2022 gives it, for n = 1, 10, 100.
SIZES = (1, 10, 100)
MEANS_OF_2022 = {(name, name): (one, ten, hundred) for name, (one, ten, _, hundred, _) in W2.items()} | {
    ("empty-easy", "empty-medium"): (0.429, 0.359, 0.351),
    ("empty-medium", "empty-hard"): (0.567, 0.476, 0.432),
    ("objectsx1-easy", "objectsx1-medium"): (0.482, 0.422, 0.387),
    ("objectsx1-medium", "objectsx1-hard"): (0.712, 0.594, 0.570),
    ("tilesx1-easy", "tilesx1-medium"): (0.593, 0.422, 0.382),
    ("tilesx1-medium", "tilesx1-hard"): (0.790, 0.603, 0.547),
}
SEEDS = 20


@pytest.mark.slow
@pytest.mark.parametrize("panel", MEANS_OF_2022, ids=lambda panel: "->".join(panel))
def test_means_are_those_of_2022(panel):
    train, test = (segar.family(name) for name in panel)
    found = np.empty((SEEDS, len(SIZES)))
    for seed in range(SEEDS):
        levels, others = train.sample(max(SIZES), seed=seed, split="train"), test.sample(100, seed=seed, split="test")
        found[seed] = [w2(levels[:n], others, mode="reference") for n in SIZES]
    # Single levels scatter widely: both means' errors, with the spread measured here standing for that of 2022.
    error = found.std(axis=0, ddof=1) * np.sqrt(1 / SEEDS + 1 / 5) + 0.0005
    away = (found.mean(axis=0) - MEANS_OF_2022[panel]) / error
    print(f"\n{'->'.join(panel)}: {found.mean(axis=0).round(3)}, {away.round(1)} standard errors")
    assert (np.abs(away) < 3.5).all()  # 45 means, of which one in 50 runs is farther by chance


@pytest.mark.parametrize("name", ["empty-hard", "empty-medium", "tilesx1-hard"])
def test_means_of_ten_levels_are_those_of_2022(name):
    dist = segar.family(name)
    values = [w2(dist.sample(10, s), dist.sample(100, s, "test"), mode="reference") for s in range(12)]
    # The means of 2022 are over 5 seeds, and its standard deviation there is up to 0.04.
    assert np.mean(values) == pytest.approx(MEANS_OF_2022[name, name][1], abs=3 * 0.04 / np.sqrt(5))
