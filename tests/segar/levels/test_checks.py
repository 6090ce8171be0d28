"""What is not a level set, a distribution, a generator, a list of factors or units is refused in the measure's name."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import segar
from segar import Mass, Position, SegarError, hardness, metrics

RNG = np.random.default_rng(0)

MEASURES: dict[str, Callable[..., Any]] = {
    "w2": lambda a, **options: metrics.w2(a, a, **options),
    "decompose": lambda a, **options: metrics.decompose(a, a, **options),
    "embed": lambda a, **options: metrics.embed(a, a, **options),
    "ks": lambda a, **options: metrics.ks(a, a, **options),
    "coverage": lambda a, **options: metrics.coverage(a, a, **options),
    "effective_number": lambda a, **options: metrics.effective_number(a, **options),
    "make_situations": lambda a, **options: hardness.make_situations(a, rng=RNG, **options),
    "sample_entropy": lambda a, **options: metrics.sample_entropy(a, "mean_field", **options),
}
DRAWING: dict[str, Callable[..., Any]] = {
    "w2_report": lambda a, rng: metrics.w2_report(a, a, rng=rng),
    "w2_debiased": lambda a, rng: metrics.w2_debiased(a, a, rng=rng),
    "w2_sliced": lambda a, rng: metrics.w2_sliced(a, a, rng=rng),
    "ks_report": lambda a, rng: metrics.ks_report(a, a, rng=rng),
    "mmd_test": lambda a, rng: metrics.mmd_test(a, a, rng=rng),
    "coverage": lambda a, rng: metrics.coverage(a, a.distribution, rng=rng),
    "hardness": lambda a, rng: hardness.hardness(a, rng=rng),
    "plan": lambda a, rng: hardness.plan(a, rng=rng),
    "influence": lambda a, rng: hardness.influence(a, rng=rng),
    "make_situations": lambda a, rng: hardness.make_situations(a, rng=rng),
    "dynamics_w2": lambda a, rng: metrics.dynamics_w2(a, a, hardness.make_situations(a, rng=RNG), rng=rng),
    "dynamics_distances": lambda a, rng: hardness.dynamics_distances(a, a, rng=rng),
}


COUNTS: dict[str, Callable[..., Any]] = {
    "w2_report .* resamples": lambda a, n: metrics.w2_report(a, a, rng=RNG, resamples=n),
    "w2_debiased .* repeats": lambda a, n: metrics.w2_debiased(a, a, rng=RNG, repeats=n),
    "ks_report .* resamples": lambda a, n: metrics.ks_report(a, a, rng=RNG, resamples=n),
    "mmd_test .* resamples": lambda a, n: metrics.mmd_test(a, a, rng=RNG, resamples=n),
    "visual_distance .* samples": lambda a, n: metrics.visual_distance("baseline", "baseline", rng=RNG, samples=n),
    "visual_distance .* resamples": lambda a, n: metrics.visual_distance("baseline", "baseline", rng=RNG, resamples=n),
    "design: .* pool": lambda a, n: metrics.design(a.distribution, 5, "covering", pool=n),
    "design: .* from a pool": lambda a, n: metrics.matched_set(a.distribution, 5, test=a, pool=n),
    "hardness .* random play": lambda a, n: hardness.hardness(a, rng=RNG, plays=n),
    "search .* samples": lambda a, n: hardness.plan(a, rng=RNG, samples=n),
    "search .* iterations": lambda a, n: hardness.plan(a, rng=RNG, iterations=n),
    "influence .* play": lambda a, n: hardness.influence(a, rng=RNG, plays=n),
    "influence .* horizon": lambda a, n: hardness.influence(a, rng=RNG, horizon=n),
    "dynamics_distances .* sequences": lambda a, n: hardness.dynamics_distances(a, a, rng=RNG, sequences=n),
    "dynamics_distances .* horizon": lambda a, n: hardness.dynamics_distances(a, a, rng=RNG, horizon=n),
}


def levels() -> segar.Levels:
    return segar.family("empty-hard").sample(10, seed=0)


@pytest.mark.parametrize("name", MEASURES)
@pytest.mark.parametrize(
    ("factors", "message"),
    [
        (Position, r"factors must be a list of factor classes such as \[Position\], not <class"),
        (["Position"], "factors are classes such as segar.Position, not 'Position'"),
        ([segar.Vector], "no entity here has the factor Vector. Known: .*Mass"),
    ],
)
def test_factors_that_are_no_list_of_factors_are_refused_in_the_name_of_the_measure(name, factors, message):
    with pytest.raises(SegarError, match=f"{name}: {message}"):
        MEASURES[name](levels(), factors=factors)


@pytest.mark.parametrize("name", ["w2", "decompose", "embed", "coverage", "effective_number"])
def test_a_number_is_no_unit_of_each_factor(name):
    with pytest.raises(SegarError, match=rf"{name}: scale must map .* as segar.metrics.spread\(a, b\) does, not 2.0"):
        MEASURES[name](levels(), scale=2.0)


@pytest.mark.parametrize("name", COUNTS)
@pytest.mark.parametrize("count", [20.5, 50.0, "20", True, 0])
def test_a_count_is_a_whole_number(name, count):
    with pytest.raises(SegarError, match=f"({name}).*{count}"):
        COUNTS[name](levels(), count)


@pytest.mark.parametrize("name", DRAWING)
def test_a_seed_is_no_generator(name):
    with pytest.raises(SegarError, match=rf"{name}: rng must be a generator such as np.random.default_rng\(0\), not 0"):
        DRAWING[name](levels(), 0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda a: metrics.spread(a, 3), "spread needs a level distribution .* not a int"),
        (lambda a: segar.design(a, 5), "design needs a level distribution"),
        (lambda a: segar.design(a.distribution, 5, "target", test=a.distribution, target=1.0), "design takes"),
        (lambda a: segar.design(a.distribution, 5, "nuisance_only", nuisance=Mass), "nuisance must be factors"),
        (lambda a: segar.design(a.distribution, 5, "nuisance_only", nuisance=[Mass]), "Mass is the same"),
        (lambda a: hardness.plan("levels.npz", rng=RNG), "hardness takes level sets .* a str is not supported"),
        (lambda a: hardness.plan(a, "puttputt", rng=RNG), r"such as segar.puttputt\(\), not 'puttputt'"),
        (lambda a: hardness.policy_similarity(a, a), "a Levels is neither"),
    ],
)
def test_what_is_of_the_wrong_kind_is_named(call, message):
    with pytest.raises(SegarError, match=message):
        call(levels())
