"""The rules of verdicts, judged on planted data."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from analysis.report import error_rates
from analysis.report.claims.verdicts import NOT_SUPPORTED, SUPPORTED
from analysis.report.error_rates import AT_MARGIN, EVEN, FALLING, NOTHING, noise_of, of_matched_sets


def grid(seeds=30):
    places = [(f, d, n, s) for f in "abc" for d in ("easy", "hard") for n in (1, 10, 100) for s in range(seeds)]
    return pd.DataFrame(places, columns=["family", "difficulty", "n", "seed"])


@pytest.mark.parametrize("kind", [EVEN, FALLING])
def test_noise_has_variance_one_and_runs_of_a_training_set_share_half_of_it(kind):
    table = grid()
    drawn = np.array([noise_of(table, np.random.default_rng(k), kind) for k in range(100)])
    assert (drawn**2).mean() == pytest.approx(1.0, abs=0.05)
    spread = drawn.std(axis=0)
    one, ten = (drawn[:, (table["n"] == n).to_numpy()] / spread[(table["n"] == n).to_numpy()] for n in (1, 10))
    assert (one * ten).mean() == pytest.approx(0.5, abs=0.05)
    ratio = spread[(table["n"] == 1).to_numpy()].mean() / spread[(table["n"] == 100).to_numpy()].mean()
    assert ratio == pytest.approx(10.0 if kind == FALLING else 1.0, rel=0.05)


def test_matched_sets_are_seldom_judged_wrongly_and_a_margin_is_found_half_of_the_time():
    rows = pd.DataFrame(list(of_matched_sets(10, 200))).set_index(["noise", "planted"])
    for noise in (EVEN, FALLING):
        assert rows.loc[(noise, NOTHING), SUPPORTED] <= 0.06
        assert rows.loc[(noise, AT_MARGIN), NOT_SUPPORTED] <= 0.06
        assert rows.loc[(noise, AT_MARGIN), SUPPORTED] == pytest.approx(0.5, abs=0.15)


def test_a_correlation_is_planted_as_large_as_is_said():
    table = grid(60).assign(w2=lambda t: np.random.default_rng(0).normal(size=len(t)), panel=lambda t: t["family"])
    found = [error_rates.Relation(table, "w2", ("panel",), -0.3, EVEN).found(seed).estimate for seed in range(20)]
    assert np.mean(found) == pytest.approx(-0.3, abs=0.03)


@pytest.mark.results
def test_the_shipped_simulations_err_in_at_most_one_of_twenty():
    table = pd.read_csv(Path(__file__).parents[3] / "docs" / "results" / "error_rates.csv")
    assert (table["simulations"] >= 1000).all() and set(table["noise"]) == {EVEN, FALLING}
    effect, absence = (table["claimed"] == one for one in ("an effect", "absence"))
    wrong = (effect & (table["planted"] == NOTHING)) | (absence & (table["planted"] == AT_MARGIN))
    assert wrong.sum() == 12 and (table[wrong][SUPPORTED] <= 0.05).all()
