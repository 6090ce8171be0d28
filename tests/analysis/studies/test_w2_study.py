"""What W2 is made of before anything is trained: panels and numbers of levels explain nearly all of it."""

import dataclasses

import numpy as np
import pytest

from segar import GolfBall, Position, family
from segar.analysis.studies.w2 import COUNTS, IN_MODELS, MEANS_OF_2022, dealt, distances, means_of, models_of
from segar.metrics import w2

IN_DISTRIBUTION = [pair for pair in MEANS_OF_2022 if pair[0] == pair[1]]


@pytest.fixture(scope="module")
def table():
    return distances(range(3), IN_DISTRIBUTION, IN_MODELS)


@pytest.mark.slow
def test_panel_and_number_of_levels_explain_nine_tenths_of_log_w2(table):
    models = models_of(table).set_index("mode")
    assert (models["panel_and_log_n"] > 0.9).all()
    assert (models["cell"] >= models["panel_and_log_n"]).all()
    assert models.loc["reference", "panel"] == pytest.approx(0.60, abs=0.08)  # as the code of 2022 gives it
    assert models.loc["reference", "log_n"] == pytest.approx(0.35, abs=0.08)


def test_means_lie_at_those_of_2022(table):
    means = means_of(table)
    chosen = means[means["mode"] == "reference"]
    assert len(chosen) == len(IN_DISTRIBUTION) * len(IN_MODELS)
    assert np.sqrt((chosen["standard_errors_apart"] ** 2).mean()) < 2.0
    assert means.loc[means["mode"] != "reference", "mean_2022"].isna().all()


def test_smaller_sets_are_the_first_levels_of_larger_ones():
    few, many = (distances([0], [("empty-hard", "empty-hard")], counts) for counts in ((1,), (1, 200)))
    assert few["w2_exact"].iloc[0] == many["w2_exact"].iloc[0]


def test_there_is_a_published_mean_for_every_number_of_levels():
    assert all(len(means) == len(COUNTS) for means in MEANS_OF_2022.values())


def test_dealt_levels_have_the_same_marginals_and_nothing_else_of_the_joint_distribution():
    levels = family("objectsx3-hard").sample(300, seed=3)
    made = dealt(levels, np.random.default_rng(0))
    x = levels.layout.columns[Position]
    assert (made.types == levels.types).all()
    for t in range(len(levels.layout.types)):
        own, other = (one.values[levels.types == t] for one in (levels, made))
        assert np.array_equal(np.sort(own, axis=0), np.sort(other, axis=0), equal_nan=True)
    values = levels.values.copy()
    values[..., x + 1] = values[..., x]  # both coordinates are one, until they are dealt
    joint = dataclasses.replace(levels, values=values)
    ball = levels.types == list(levels.layout.types).index(GolfBall)
    found = [
        np.corrcoef(one.values[ball][:, x : x + 2].T)[0, 1] for one in (joint, dealt(joint, np.random.default_rng(0)))
    ]
    assert found[0] == pytest.approx(1) and abs(found[1]) < 0.2
    assert w2(made, levels) < w2(levels, family("objectsx3-hard").sample(300, seed=4))
