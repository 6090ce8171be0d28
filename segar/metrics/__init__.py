"""Distances between level sets: how far train is from test, before anything is trained."""

from segar.metrics.kolmogorov import ks, ks_by_factor
from segar.metrics.points import spread
from segar.metrics.wasserstein import W2Report, w2, w2_report

__all__ = ["W2Report", "ks", "ks_by_factor", "spread", "w2", "w2_report"]
