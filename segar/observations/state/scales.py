"""Numbers of a state in units of the prior: measured from its mean, divided by its spread.

The prior is the distribution that the levels come from. Equal numbers of training and test levels of one distribution thus
mean equal states. A number that several types may supply has the mean and the spread of their mixture in equal parts. A
vector has one spread, the root mean square of its components', so that directions stay comparable. A number that the prior
does not vary keeps its unit and is measured from its constant. Size keeps its unit [m] and its zero, since outlines of hulls
do not follow it.
"""

import numpy as np

from segar.errors import LevelError
from segar.language import Factor, Size
from segar.levels import Levels, source_moments
from segar.observations.state.places import EMPTY, Places

NO_SPREAD = 1e-9  # standard deviation over mean below which a factor is constant but for rounding


def shift_and_scale(places: Places, levels: Levels) -> tuple[np.ndarray, np.ndarray]:
    """The number to subtract from each entry of ``places.reads``, and the factor to multiply by then; float64 ``[k]`` both.

    Raises:
        LevelError: the levels know no distribution.
    """
    moments = source_moments(levels)
    if not moments:
        raise LevelError(
            "StateVector(normalise=True) measures by the prior, and these levels know none: they were made by hand, or saved"
            " by an earlier version. Sample them from a LevelDistribution, or leave normalise out"
        )
    shift, scale = np.zeros(len(places.reads)), np.ones(len(places.reads))
    for k, (slot, (factor, component)) in enumerate(zip(places.reads[:, 0], places.read_factors, strict=True)):
        kinds = levels.layout.slots[slot].types if slot != EMPTY else ()
        known = [moments[kind, factor] for kind in kinds if (kind, factor) in moments]
        if known and not issubclass(factor, Size):
            mean, spread = _mean_and_spread(known, factor)
            shift[k], scale[k] = mean[component], 1.0 / spread
    return shift, scale


def _mean_and_spread(known: list[tuple[np.ndarray, np.ndarray]], factor: type[Factor]) -> tuple[np.ndarray, float]:
    """Mean of each component, and the one spread, of a mixture of distributions with these means and variances; a spread of 1
    where the mixture is constant."""
    means, variances = (np.stack(values) for values in zip(*known, strict=True))
    mean, variance = means.mean(axis=0), variances.mean(axis=0) + means.var(axis=0)
    spread = float(np.sqrt(variance.mean()))
    return mean, spread if spread > NO_SPREAD * max(float(np.abs(means).max()), NO_SPREAD) else 1.0
