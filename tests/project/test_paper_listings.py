"""Every listing of the paper runs as printed, once its names are imported, and does what the paper says of it.

The listings are read from the file that ``SEGAR_PAPER`` names (see ``conftest.py``); none is copied here.
"""

import math
import os
import re
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import segar
from segar import LevelDistribution, Position, Prior, Size, family
from segar.language.values import VectorValue as Vector
from tests.places import ROOT

PAPER = Path(os.environ.get("SEGAR_PAPER", ROOT.parent / "shared" / "paper" / "segar.tex"))
LISTING = re.compile(r"\\begin\{lstlisting\}(?:\[[^\]]*\])?\n(.*?)\\end\{lstlisting\}", re.DOTALL)
LISTINGS = [
    "\n".join(line for line in textwrap.dedent(text).splitlines() if line.strip() != "...")
    for text in LISTING.findall(PAPER.read_text())
]


def run(listing: str) -> dict[str, Any]:
    """All names after the listing ran; ``value`` is what it says if it is no statement but expressions."""
    names: dict[str, Any] = {}
    exec("from typing import Tuple\nfrom segar import *", names)
    try:
        code = compile(f"(\n{listing}\n)", "<listing>", "eval")
    except SyntaxError:
        exec(compile(listing, "<listing>", "exec"), names)
        return names
    return {"value": eval(code, names)}


def listing_with(text: str) -> dict[str, Any]:
    found = [listing for listing in LISTINGS if text in listing]
    assert len(found) == 1, f"{len(found)} listings contain {text!r}"
    return run(found[0])


def test_there_are_seven_listings():
    assert len(LISTINGS) == 7


@pytest.mark.parametrize("listing", LISTINGS, ids=lambda text: text.strip().splitlines()[0][:40])
def test_the_listing_runs_as_printed(listing):
    assert run(listing)


def test_the_dictionary_makes_an_object():
    entity = segar.Object(listing_with("Mass: 0.4")["value"])
    assert entity[Position] == (0.1, -0.1) and entity[segar.Mass] == 0.4 and entity[segar.Shape] == segar.Circle()


@pytest.mark.parametrize("name", ["apply_friction", "lorentz_law", "move"])
def test_the_rules_are_rules_and_a_world_takes_them(name):
    function = listing_with(f"def {name}(")[name]
    rule = segar.rule(function)
    assert rule.name == name
    world = family("empty-easy").with_rules([function]).world
    assert [r.name for r in world.rules] == [name]


def test_the_friction_of_the_paper_brakes_by_mu_g_over_m():
    apply_friction = listing_with("def apply_friction(")["apply_friction"]
    velocity = segar.Velocity([3.0, 4.0])
    seen = _argument(segar.Acceleration, [0.0, 0.0])
    effect = apply_friction((segar.Mass(2.0), velocity, seen), (segar.Friction(0.1),), segar.Gravity(10.0))
    assert isinstance(effect, segar.Aggregate)
    assert tuple(map(float, effect.value)) == pytest.approx((-0.3, -0.4))
    still = segar.Velocity([0.0, 0.0])
    assert apply_friction((segar.Mass(2.0), still, seen), (segar.Friction(0.1),), segar.Gravity(10.0)) is None


def test_like_charges_repel_by_the_inverse_square_in_the_paper():
    lorentz_law = listing_with("def lorentz_law(")["lorentz_law"]
    none, rest = segar.Magnetism(0.0), segar.Velocity([0.0, 0.0])
    source = (segar.Position([0.0, 0.0]), rest, segar.Charge(2.0), none)
    pulled = (segar.Charge(1.0), segar.Mass(4.0), _argument(segar.Acceleration, [0, 0]))
    effect = lorentz_law(source, (segar.Position([0.5, 0.0]), rest, *pulled))
    assert tuple(map(float, effect.value)) == pytest.approx((2.0 / 0.25 / 4.0, 0.0))


def test_the_move_of_the_paper_is_the_velocity_above_the_least_speed():
    move = listing_with("def move(")["move"]
    place = _argument(segar.Position, [0.0, 0.0])
    for speed, moved in ((0.5, 0.5), (1e-5, 0.0)):
        effect = move(place, segar.Velocity([speed, 0.0]), segar.MinVelocity(1e-4))
        assert tuple(map(float, effect.value)) == (moved, 0.0)


def test_the_default_configuration_of_puttputt_is_the_family_puttputt():
    config = listing_with("puttputt_default_config")["puttputt_default_config"]
    dist = LevelDistribution(**config)
    assert dist.hash == family("puttputt").hash
    levels = dist.sample(20)
    assert levels.values.tobytes() == family("puttputt").sample(20).values.tobytes()


def priors() -> list[Any]:
    """What the listings of priors say: one of them, and a pair."""
    return [run(text)["value"] for text in LISTINGS if text.strip().startswith("Prior(")]


def test_the_prior_of_the_paper_sets_the_size_of_objects():
    single = next(value for value in priors() if isinstance(value, Prior))
    assert single.factor is Size and single.entity_type is segar.Object
    assert single.value == segar.GaussianNoise(0.2, 0.01, clip=(0.1, 0.3))


def test_of_the_two_priors_of_the_paper_the_one_for_chargers_counts_for_chargers_and_none_may_stand_twice():
    pair = next(value for value in priors() if isinstance(value, tuple))
    places = Prior(Position, segar.RandomUniformLocation())
    levels = LevelDistribution([(segar.Charger, 1), (segar.Magnet, 1)], [*pair, places]).sample(200)
    size = levels.sampled_values[:, :2, levels.layout.columns[Size]]
    assert np.abs(size.mean(axis=0) - [0.3, 0.2]).max() < 5 * 0.02 / math.sqrt(200)
    with pytest.raises(segar.errors.PriorError, match="same condition"):
        LevelDistribution([(segar.Charger, 1)], [*pair, pair[0]])


def _argument(factor: type, value: Any) -> Vector:
    """A vector factor as a rule receives it: it remembers what it was read from."""
    from segar.language.values import Source

    return Vector(*value, source=Source(0, factor))
