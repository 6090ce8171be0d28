"""The report's figures, by name: each is drawn from the evidence, or an error says why it is not.

``main_grid``, ``agents`` and ``beyond`` draw them, with what ``drawing`` has in common. This room imports claims,
plotting and results; others use :data:`FIGURES`.
"""

from collections.abc import Callable, Mapping

from segar.analysis.report.claims.evidence import Evidence
from segar.analysis.report.figures import agents, beyond, main_grid
from segar.analysis.report.figures.drawing import Drawn

FIGURES: Mapping[str, Callable[[Evidence], Drawn]] = {
    draw.__name__: draw
    for draw in (
        main_grid.figure_3a, main_grid.specification_curves, main_grid.figure_3b,
        main_grid.train_and_test, main_grid.figure_4a, agents.figure_4b, agents.figure_5a, agents.figure_5b,
        agents.appendix_mass, agents.appendix_sac, agents.performance_profiles, beyond.fixed_n,
        beyond.matched_sets, beyond.dose_response, beyond.twins, beyond.diversity, beyond.attribution, beyond.rules,
        beyond.rule_sets, beyond.trials, beyond.visual, beyond.hardness, beyond.upper_bound, beyond.w2_study,
    )
}  # fmt: skip
