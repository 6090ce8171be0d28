"""Distances between level sets and distributions, and measures of single level sets, all without any training.

The room imports ``levels``, ``textures`` and the rooms below them, and never the engine. Others use the names that are
imported here; each measure names its options and its source in its docstring.
"""

from segar.metrics.dynamics import (
    DynamicsDistance,
    DynamicsW2,
    HasOutcomes,
    Outcomes,
    Readings,
    dynamics_distance,
    dynamics_w2,
    readings_of,
    rule_set_distances,
)
from segar.metrics.entropy_estimate import SampleEntropy, sample_entropy
from segar.metrics.kolmogorov import FactorKS, KSReport, dkw_band, ks, ks_by_factor, ks_report
from segar.metrics.level_design import design
from segar.metrics.level_vectors import TwoSampleTest, embed, mmd_test
from segar.metrics.marginal_distributions import component, factor_distribution, parameter_distribution
from segar.metrics.matched_sets import matched_set
from segar.metrics.points import Spread, relevant_factors, spread
from segar.metrics.representative_sets import (
    Coverage,
    Representativeness,
    coverage,
    effective_number,
    representativeness,
)
from segar.metrics.sliced import SlicedW2, w2_sliced
from segar.metrics.unseen import unseen_differences
from segar.metrics.visual import VisualDistance, clustering_w2, visual_distance, visual_w2
from segar.metrics.w2_parts import DebiasedW2, Decomposition, Floor, decompose, same_distribution_floor, w2_debiased
from segar.metrics.wasserstein import MISMATCH, W2Report, cost_matrix, w2, w2_report

__all__ = [
    "MISMATCH", "Coverage", "DebiasedW2", "Decomposition", "DynamicsDistance", "DynamicsW2", "FactorKS",
    "Floor", "HasOutcomes", "KSReport", "Outcomes", "Readings", "Representativeness", "SampleEntropy",
    "SlicedW2", "Spread", "TwoSampleTest", "VisualDistance", "W2Report", "clustering_w2", "component",
    "cost_matrix", "coverage", "decompose", "design", "dkw_band", "dynamics_distance", "dynamics_w2",
    "effective_number", "embed", "factor_distribution", "ks", "ks_by_factor", "ks_report", "matched_set",
    "mmd_test", "parameter_distribution", "readings_of", "relevant_factors", "representativeness",
    "rule_set_distances", "same_distribution_floor", "sample_entropy", "spread", "unseen_differences",
    "visual_distance", "visual_w2", "w2", "w2_debiased", "w2_report", "w2_sliced",
]  # fmt: skip
