from .dynamics import (
    Outcomes as Outcomes,
    Readings as Readings,
    dynamics_distance,
    dynamics_w2,
    readings_of as readings_of,
    rule_set_distances,
    squared_distances as squared_distances,
)
from .kolmogorov import ks, ks_by_factor, ks_report
from .level_design import design
from .level_vectors import embed as embed, mmd_test, w2_sliced
from .marginal_distributions import (
    component as component,
    factor_distribution as factor_distribution,
    parameter_distribution as parameter_distribution,
)
from .matched_sets import matched_set
from .points import Spread as Spread, relevant_factors as relevant_factors, spread
from .representative_sets import coverage, effective_number, sample_entropy
from .unseen import unseen_differences
from .visual import clustering_w2 as clustering_w2, visual_distance, visual_w2
from .w2_parts import decompose, w2_debiased
from .wasserstein import MISMATCH as MISMATCH, cost_matrix, w2, w2_report

__all__ = [
    "cost_matrix", "coverage", "decompose", "design", "dynamics_distance", "dynamics_w2", "effective_number", "ks",
    "ks_by_factor", "ks_report", "matched_set", "mmd_test", "rule_set_distances",
    "sample_entropy", "spread", "unseen_differences", "visual_distance", "visual_w2", "w2",
    "w2_debiased", "w2_report", "w2_sliced",
]  # fmt: skip
