"""The elementary functions of networks agree with numpy to a few units in the last place."""

import numpy as np
import pytest

from segar.policies import mathematics


@pytest.mark.parametrize(
    ("name", "low", "high"), [("exp", -700, 700), ("exp", -1, 1), ("tanh", -20, 20), ("log", 1e-16, 1.0), ("cos", 0, 7)]
)
def test_a_function_agrees_with_numpy(name, low, high):
    x = np.random.default_rng(0).uniform(low, high, 20_000)
    found = np.array([getattr(mathematics, name)(one) for one in x])
    np.testing.assert_allclose(found, getattr(np, name)(x), rtol=1e-14, atol=1e-16)


def test_limits_are_reached():
    assert mathematics.exp(np.inf) == np.inf and mathematics.exp(-np.inf) == 0.0 and mathematics.exp(0.0) == 1.0
    assert np.isnan(mathematics.exp(np.nan)) and mathematics.tanh(-1e300) == -1.0 and mathematics.tanh(0.0) == 0.0
    assert mathematics.log(1.0) == 0.0 and mathematics.cos(0.0) == 1.0
