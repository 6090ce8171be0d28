"""Level sets by design: each kind keeps its promise, and says where its levels come from."""

import numpy as np
import pytest

import segar
from segar import Mass, Position, Size, design
from segar.errors import LevelError
from segar.language import Order
from segar.metrics import coverage, effective_number, spread, w2

LAW = segar.family("objectsx1-hard")


@pytest.mark.parametrize("kind", ["iid", "clustered", "covering"])
def test_levels_can_be_rebuilt_from_their_indices(kind):
    made = design(LAW, 12, kind, seed=3, split="some", pool=200)
    assert len(made) == 12 == len(set(made.provenance.indices.tolist()))
    assert LAW.sample(200, seed=3, split="some")[made.provenance.indices] == made
    assert design(LAW, 12, kind, seed=3, split="some", pool=200) == made


def test_independent_levels_are_the_first_of_the_split():
    assert design(LAW, 5, seed=1, split="train") == LAW.sample(5, seed=1, split="train")


def test_clustered_levels_are_closer_and_covering_ones_farther_than_independent_ones():
    clustered, independent, covering = (design(LAW, 20, kind) for kind in ("clustered", "iid", "covering"))
    scale = spread(LAW)
    worth = [effective_number(levels, scale=scale) for levels in (clustered, independent, covering)]
    assert worth[0] < 0.7 * worth[1] < 0.7 * worth[2]
    pool = LAW.sample(1000, seed=0, split="train")
    assert coverage(covering, pool).radius < coverage(independent, pool).radius < coverage(clustered, pool).radius


def test_clustered_levels_are_the_nearest_of_the_pool():
    made = design(LAW, 10, "clustered", pool=50)
    pool = LAW.sample(50, seed=0, split="train")
    distances = np.array([w2(made[0], level) for level in pool])
    np.testing.assert_allclose([w2(made[0], level) for level in made], np.sort(distances)[:10], atol=1e-9)


def test_only_nuisance_factors_vary():
    made = design(LAW, 15, "nuisance_only", nuisance=[Order, Size], seed=2)
    values, columns = np.nan_to_num(made.sampled_values[:, :-1]), made.layout.columns
    varies = {f for f in made.layout.factors if np.ptp(values[..., columns[f]], axis=0).any()}
    assert varies == {Order, Size}
    assert (made.types == made.types[0]).all()
    assert w2(made, made[0], factors=[Mass]) == 0.0 < w2(made, made[0])


def test_nuisance_levels_say_which_level_and_do_not_pass_for_levels_of_the_distribution():
    made = design(LAW, 4, "nuisance_only", nuisance=[Order], seed=5)
    place = int(made.provenance.name.split()[1])
    assert made.provenance.name == f"level {place} of objectsx1-hard with other Order"
    assert made.provenance.distribution != LAW.hash
    pool = LAW.sample(1000, seed=5, split="train")
    order = made.layout.columns[Order]
    np.testing.assert_array_equal(made.values[..., order], pool[made.provenance.indices].values[..., order])
    one = pool[place].values.copy()
    one[..., order] = made.values[:1, :, order]
    np.testing.assert_array_equal(made.values[:1], one)


def test_nuisance_positions_are_kept_apart():
    made = design(LAW, 30, "nuisance_only", nuisance=[Position])
    assert made == made.without_overlaps()


@pytest.mark.parametrize(("n", "target"), [(5, 4.0), (10, 5.0), (50, 3.0)])
def test_a_target_is_hit_within_the_tolerance(n, target):
    test = LAW.sample(60, seed=0, split="test")
    made = design(LAW, n, "target", test=test, target=target)
    assert w2(made, test) == pytest.approx(target, abs=0.01 * target)
    assert len(set(made.provenance.indices.tolist())) == n
    assert LAW.sample(max(1000, 20 * n), seed=0)[made.provenance.indices] == made


def test_a_target_out_of_reach_names_the_range():
    test = LAW.sample(20, seed=0, split="test")
    with pytest.raises(LevelError, match=r"at W2 0.5 ± 0.01 from the test set; the nearest is \d.*sets tried reach"):
        design(LAW, 5, "target", test=test, target=0.5, tolerance=0.01)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"kind": "clusterd"}, "unknown kind 'clusterd'. Did you mean 'clustered'"),
        ({"kind": "nuisance_only"}, "needs nuisance="),
        ({"kind": "iid", "nuisance": [Order]}, "no other kind takes it"),
        ({"kind": "nuisance_only", "nuisance": [segar.Shape]}, "must be factors that are numbers"),
        ({"kind": "nuisance_only", "nuisance": [Order], "pool": 10, "n": 10}, "have the same entities as level"),
        ({"kind": "target", "target": 1.0}, "needs test=levels and target=distance"),
        ({"kind": "iid", "target": 1.0}, "needs test=levels and target=distance, and no other kind"),
        ({"kind": "covering", "pool": 3}, "5 levels cannot be picked from a pool of 3"),
        ({"kind": "iid", "n": 0}, "must be a whole number above 0, not 0"),
    ],
)
def test_wrong_options_are_named(options, message):
    with pytest.raises(LevelError, match=message):
        design(LAW, **({"n": 5} | options))
