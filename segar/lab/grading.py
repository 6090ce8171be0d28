"""Grades: how far a law is from the hidden one in what it predicts, which options are right, and how long it is."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from segar.evaluation import Interval
from segar.hardness import Situations, make_situations
from segar.lab.hidden_world import Lab
from segar.lab.laws import EMPTY, bits_of, law_in, levels_of
from segar.language import Position
from segar.levels import Levels
from segar.metrics import squared_distances

GRADED_LEVELS = 16  # of each set
HORIZONS = (1, 5, 10)  # steps; later, what bodies touched when decides more than the law does
RESAMPLES = 200  # of levels, for intervals
DIGITS = 12  # of scores; further ones are rounding
SETS = ("held_out", "interventions", "shifted")


@dataclass(frozen=True)
class Grade:
    """How good a law is.

    Attributes:
        score: mean of the scores of the three sets of levels: 0 for the empty law and for the default physics, whichever is
            better, 1 for the hidden law. Intervals are of 95 %, over levels.
        scores: by set: levels of the distribution that nobody saw, the same with other factors, and levels of the shifted
            distribution.
        distances: by set, as :func:`segar.metrics.dynamics_w2`; and under ``empty`` and ``default`` those of the two laws
            that the scale begins with.
        precision, recall: of the options; None where none was named, or the answer is code.
        errors: of the constants of options that are right, in their units.
        bits: description length.
    """

    score: Interval
    scores: Mapping[str, Interval]
    distances: Mapping[str, Mapping[str, float]]
    precision: float | None
    recall: float | None
    errors: Mapping[str, float]
    bits: float

    def data(self) -> dict[str, Any]:
        """The grade as plain data."""
        scores = {name: one._asdict() for name, one in self.scores.items()}
        return {**vars(self), "score": self.score._asdict(), "scores": scores}


class Grader:
    """Grades laws in the hidden world of a lab. What becomes of the hidden law is found once.

    Attributes:
        situations: by the names of :data:`SETS`.
    """

    def __init__(self, lab: Lab) -> None:
        self.lab = lab
        known = lab.distribution.sample(GRADED_LEVELS, lab.seed, "graded")
        sets = known, _intervened(lab, known), lab.other_levels.sample(GRADED_LEVELS, lab.seed, "graded")
        rng = np.random.default_rng(lab.seed)
        made = [make_situations(levels, lab.task, rng=rng, horizons=HORIZONS) for levels in sets]
        self.situations: dict[str, Situations] = dict(zip(SETS, made, strict=True))
        self._law = law_in(lab.hidden, lab.space)["options"]
        self._truth = [situations.outcomes(lab.hidden) for situations in made]
        self._scale = np.stack([self._squares(levels_of(lab, [EMPTY])), self._squares(lab.default_physics)])[:, :, 0]
        weights = np.random.default_rng(lab.seed).multinomial(
            GRADED_LEVELS, [1 / GRADED_LEVELS] * GRADED_LEVELS, (len(SETS), RESAMPLES)
        )
        self._weights = np.concatenate([np.ones((len(SETS), 1, GRADED_LEVELS)), weights], axis=1) / GRADED_LEVELS

    def grade(self, law: Any) -> Grade:
        """The grade of one law, as data; raises :class:`SegarError` as :func:`levels_of`."""
        return self.grades([law])[0]

    def grades(self, laws: Sequence[Any]) -> list[Grade]:
        """The grades of laws. Laws of options run in one kernel, which is compiled for the experiments."""
        squares = self._squares(levels_of(self.lab, laws))  # (sets, laws, levels)
        distances = np.sqrt(self._weights @ squares.transpose(0, 2, 1))  # (sets, 1 + resamples, laws)
        least = np.sqrt(self._weights @ self._scale.transpose(1, 2, 0)).min(axis=-1)[..., None]
        share = np.divide(distances, least, out=np.where(distances > 0, np.inf, 0.0), where=least > 0)
        scores = np.clip(1.0 - share, 0.0, 1.0).round(DIGITS)
        start = np.sqrt(self._scale.mean(axis=-1))
        return [self._grade(law, scores[..., k], distances[:, 0, k], start) for k, law in enumerate(laws)]

    def _squares(self, laws: Levels) -> np.ndarray:
        """Squared distances of laws from the hidden one, float64 ``(sets, laws, levels)``."""
        found = [situations.outcomes(laws) for situations in self.situations.values()]
        pairs = zip(self._truth, found, strict=True)
        return np.stack([squared_distances(truth, one, GRADED_LEVELS)[:, 0].T[one.of_level] for truth, one in pairs])

    def _grade(self, law: Any, scores: np.ndarray, distances: np.ndarray, start: np.ndarray) -> Grade:
        truth, answer = self._law, law.get("options", {})
        right = [name for name in answer if name in truth]
        values = zip(SETS, distances.tolist(), *start.tolist(), strict=True)
        return Grade(
            _interval(scores.mean(axis=0)),
            {name: _interval(own) for name, own in zip(SETS, scores, strict=True)},
            {name: {"law": d, "empty": empty, "default": default} for name, d, empty, default in values},
            len(right) / len(answer) if answer else None,
            len(right) / len(truth) if "options" in law and truth else None,
            {c: abs(answer[name][c] - value) for name in right for c, value in truth[name].items()},
            bits_of(self.lab, law),
        )


def _interval(scores: np.ndarray) -> Interval:
    """The first score, and 95 % of the others."""
    low, high = np.quantile(scores[1:], (0.025, 0.975))
    return Interval(float(scores[0]), float(min(low, scores[0])), float(max(high, scores[0])))


def _intervened(lab: Lab, levels: Levels) -> Levels:
    """The levels with all factors that may be set, but places, drawn within their bounds."""
    rng, values = np.random.default_rng(lab.seed), levels.values.copy()
    for factor, (low, high) in lab.settable.items():
        if factor in levels.layout.columns and factor is not Position:
            at = levels.layout.columns_of(factor)
            drawn = rng.uniform(low, high, values[..., at].shape)
            values[..., at] = np.where(np.isnan(values[..., at]), np.nan, drawn)
    return replace(levels, values=values)
