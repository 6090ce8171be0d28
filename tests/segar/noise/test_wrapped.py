"""Angles: distributions that come round again."""

import math

import numpy as np
import pytest

import segar.noise as sn
from segar.noise import wrap

UNIFORM = sn.UniformNoise(-math.pi, math.pi)


def test_a_wide_distribution_is_uniform_once_it_is_wrapped():
    wrapped = sn.Wrapped(sn.GaussianNoise(1.0, 20.0))
    assert wrapped.entropy() == pytest.approx(math.log(math.tau)) and sn.ks_line(wrapped, UNIFORM) < 1e-9
    assert sn.Wrapped(UNIFORM).cdf(0.3) == UNIFORM.cdf(0.3)


def test_numbers_are_wrapped_into_one_turn_around_zero():
    x = np.array([-0.5, 0.5, 0.49, 7.25, -3.75, 0.5 - 1e-18])
    assert np.allclose(wrap(x, 1.0), [-0.5, -0.5, 0.49, 0.25, 0.25, -0.5])
