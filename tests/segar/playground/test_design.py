"""The panel that compares the two sets of a page: its distances are those of Python, and it states the same objective."""

import dataclasses
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import segar
from segar import Ball, Count, Flag, GoalTile, GolfBall, Mass, Parameter, Position, Shape, Tile
from segar.experiments.levels.builders import make_levels
from segar.experiments.settings import LevelsConfig
from segar.language import ConvexHull, Visible
from segar.levels import Levels, gather
from segar.metrics import decompose, ks, ks_by_factor, spread, unseen_differences, w2
from segar.playground import make_playground
from segar.playground.objective import described_objective
from tests.segar.playground.browsers import Browser, Chromium

pytestmark = pytest.mark.filterwarnings("ignore::segar.errors.UnseenDifferenceWarning")

MEASURE = """
const { measures } = window.playground.design;
const steps = measures.measured();
let next = steps.next();
while (!next.done) next = steps.next();
const { w2, ks, parts, marginals } = next.value;
return { w2, ks, parts: Object.fromEntries(parts), by: Object.fromEntries(marginals.map((one) => [one.name, one.ks])) };
"""


class Heading(segar.Scalar, default=0.0, period=6.0):
    """Where a thing looks."""


class Eyes(Count, default=2):
    """How many eyes a thing has."""


class Asleep(Flag, default=False):
    """Whether a thing sleeps."""


class Owl(Ball):
    heading: Heading
    eyes: Eyes
    asleep: Asleep


class Mist(Parameter, default=0.5):
    """How dense the air is."""


class Hour(Parameter, default=0.0, period=24.0):
    """The time of the day."""


# What rules do is not the point, and few are compiled sooner.
STILL = segar.World(rules=(segar.rules.move,), limit=None, wall_contact=None, pair_contact=None)


def family(name: str, n: int, split: str = "train") -> Levels:
    return segar.family(name).sample(n, seed=4, split=split)


def still(*family_and_number: Any) -> Levels:
    return dataclasses.replace(family(*family_and_number), world=STILL)


def own(seed: int, n: int, parameters: tuple[type[Parameter], ...], *rest: Callable[[], segar.Entity]) -> Levels:
    """Levels made by hand: owls that look somewhere, and other things; where they stand decides nothing here."""
    rng = np.random.default_rng(seed)

    def owl() -> Owl:
        x, y, angle, eyes = rng.normal(size=4)
        return Owl({Position: [0.3 * x, 0.3 * y], Heading: 4 * angle, Eyes: int(abs(3 * eyes)), Asleep: x > 0})

    levels = [
        [GolfBall(), GoalTile(), *(owl() for _ in range(rng.integers(4))), *(make() for make in rest)] for _ in range(n)
    ]
    return Levels.from_entities(levels, {one: rng.normal(0.0, 9.0, n) for one in parameters}, world=STILL)


def rack(seed: int) -> Levels:
    """Twelve levels of ten balls."""
    places = np.random.default_rng(seed).uniform(-0.8, 0.8, (12, 10, 2))
    levels = [[GolfBall(), GoalTile(), *(Ball({Position: place}) for place in level)] for level in places]
    return Levels.from_entities(levels, world=STILL)


def hull(radius: float) -> Tile:
    return Tile({Shape: ConvexHull([[0, 0], [radius, 0], [radius, radius], [-0.1, 0.2]]), Position: [0.5, 0.5]})


PAIRS: dict[str, Callable[[], tuple[Levels, Levels]]] = {
    "absent things": lambda: (still("objectsx3-hard", 30), still("objectsx3-hard", 18, "test")),
    "many things of a type": lambda: (rack(1), rack(2)),
    "hulls": lambda: (still("tilesx2-easy", 20), still("hazardtilesx2-hard", 21)),
    "other layouts, periods and own parameters": lambda: (
        own(1, 25, (Mist, Hour), lambda: hull(0.2)),
        own(2, 15, (Hour,), lambda: hull(0.3), lambda: Ball({Mass: 2.0})),
    ),
    "one level": lambda: (still("empty-hard", 1), still("empty-hard", 7, "test")),
    "the same levels": lambda: (still("empty-hard", 9), still("empty-hard", 9)),
}
SLOW = {"hulls"}


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow if n in SLOW else ()) for n in PAIRS])
def test_w2_and_ks_with_their_parts_are_those_of_python(name: str, browser: Browser, tmp_path: Path) -> None:
    a, b = PAIRS[name]()
    browser.show(tmp_path, make_playground(a, b, observations=["state"]))
    agree(browser.run(MEASURE), a, b, same_plan=True)


def agree(found: dict[str, Any], a: Levels, b: Levels, scale: Any = None, same_plan: bool = False) -> None:
    close: dict[str, Any] = {"rel": 1e-9, "abs": 1e-9}
    assert found["w2"] == pytest.approx(w2(a, b, scale=scale), **close)
    assert found["ks"] == pytest.approx(ks(a, b), **close)
    assert found["by"] == pytest.approx(ks_by_factor(a, b), **close)
    assert sum(found["parts"].values()) == pytest.approx(found["w2"] ** 2, **close)
    if same_plan:  # of a shift that is unique, as that of numbers drawn from densities
        parts = {name: part for name, part in decompose(a, b, scale=scale).by_name.items() if part > 0}
        assert found["parts"] == pytest.approx(parts, **close)


def test_priors_are_those_that_the_things_of_a_kind_are_drawn_from() -> None:
    sets = family("objectsx3-hard", 300), family("tilesx3-easy", 300)
    found = described_objective(*sets)
    seen = 0
    for k, levels in enumerate(sets):
        kinds = {kind.__name__: kind for kind in levels.layout.types}
        factors = {one.__name__: one for one in levels.layout.factors}
        for one in found["types"]:
            for factor in one["factors"] if one["name"] in kinds else ():
                numbers = gather(levels, [kinds[one["name"]]], [factors[factor["name"]]], levels.sampled_values).points
                for axis, number in enumerate(factor["priors"][k]):
                    law = found["densities"][number]
                    edges = np.linspace(law["low"], law["high"], len(law["bins"]) + 1)[1:]
                    below = (numbers[:, axis, None] <= edges + 1e-9).mean(axis=0)
                    assert np.abs(below - np.cumsum(law["bins"])).max() < np.sqrt(np.log(2e6) / (2 * len(numbers)))
                    seen += 1
    assert seen > 100


@pytest.fixture(scope="module")
def sets() -> tuple[Levels, Levels]:
    return family("objectsx3-hard", 30), family("objectsx3-hard", 18, "test")


@pytest.fixture(scope="module")
def saved(sets: tuple[Levels, Levels], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("design") / "page.html"
    make_playground(*sets).save(path)
    return path


@pytest.fixture
def page(chromium: Chromium, saved: Path) -> Iterator[Any]:
    """The page, opened anew and measured; it has said nothing to the console when the test ends, and asked for nothing."""
    chromium.open(saved)
    measured(chromium)
    yield chromium.page
    chromium.assert_quiet()


def measured(chromium: Chromium, unlike: str = "") -> str:
    """What the panel says once it says something else."""
    chromium.until("![argument, ''].includes(document.querySelector('.value').textContent)", unlike)
    return chromium.page.inner_text(".value")


def words(a: Levels, b: Levels) -> str:
    return f"W2 {w2(a, b):.4g}, KS {ks(a, b):.4g}"


def factor(levels: Levels, level: int, slot: int, which: Any, value: float) -> Levels:
    """The levels with another number."""
    values = levels.values.copy()
    values[level, slot, levels.layout.columns[which]] = value
    return dataclasses.replace(levels, values=values)


def test_a_level_that_is_changed_counts_at_once_and_undo_brings_the_distance_back(
    chromium: Chromium, page: Any, sets: tuple[Levels, Levels]
) -> None:
    first = measured(chromium)
    assert first == words(*sets)
    page.click("button[aria-label='test level 5']")
    assert page.evaluate("[window.playground.levels.about.title, window.playground.level]") == ["test", 5]
    page.click("summary:has-text('Change this level')")
    page.fill("#factor-Position-x", "0.83")
    page.press("#factor-Position-x", "Enter")
    second = measured(chromium, first)
    changed = factor(sets[1], 5, 0, Position, 0.83)
    assert second == words(sets[0], changed) != first
    agree(page.evaluate(f"() => {{ {MEASURE} }}"), sets[0], changed)
    assert page.locator("button.changed").get_attribute("aria-label") == "test level 5, changed"
    page.fill("#factor-Mass", "3.5")  # all masses are 1, so that W2 has no unit for them
    page.press("#factor-Mass", "Enter")
    page.locator("text=GolfBall.Mass has no spread in the units, and so no weight in W2; KS sees it.").wait_for()
    heavy = factor(changed, 5, 0, Mass, 3.5)
    assert measured(chromium, second) == words(sets[0], heavy)
    assert w2(sets[0], heavy) == w2(sets[0], changed)
    page.click("text=Undo")
    page.click("text=Undo")
    chromium.until("document.querySelector('.value').textContent === argument", first)
    assert page.locator("button.changed").count() == 0


def test_things_that_are_taken_away_and_other_worlds_count(chromium: Chromium, tmp_path: Path) -> None:
    a, b = PAIRS["other layouts, periods and own parameters"]()
    chromium.show(tmp_path, make_playground(a, b, observations=["state"]))
    first = measured(chromium)
    level, slot = next((k, e) for k, e in np.argwhere(a.types >= 0).tolist() if a.layout.slots[e].optional)
    chromium.run(
        "const { sets, player } = window.playground; sets[0].setKind(argument[0], argument[1], -1);"
        " sets[1].setParameter(3, 'Hour', 30.5); player.start(0)",
        [level, slot],
    )
    types, values, parameters = a.types.copy(), a.values.copy(), b.parameters.copy()
    types[level, slot], values[level, slot] = -1, np.nan
    parameters[3, b.layout.parameters.index(Hour)] = 30.5
    taken = dataclasses.replace(a, types=types, values=values)
    later = dataclasses.replace(b, parameters=parameters)
    measured(chromium, first)
    agree(chromium.run(MEASURE), taken, later, scale=spread(a, b))
    assert 'segar.Levels.load("train.json", world=world)' in chromium.page.inner_text(".wide")


def test_what_it_is_made_of_is_listed(page: Any, sets: tuple[Levels, Levels]) -> None:
    rows = [row.split("\t") for row in page.locator(".wide tbody tr").all_inner_texts()]
    parts, square = decompose(*sets).by_name, w2(*sets) ** 2
    assert [(name, share) for name, share, *_ in rows] == [
        (name, f"{100 * part / square:.1f} %") for name, part in parts.items() if part > 0
    ]
    varied = page.locator(".cards b").all_inner_texts()
    by_factor = ks_by_factor(*sets)
    assert {name for name, value in by_factor.items() if value > 0} <= set(varied) <= set(by_factor)
    ball = page.locator(".cards figure", has_text="GolfBall.Size")
    assert f"KS\N{NO-BREAK SPACE}{by_factor['GolfBall.Size']:.3f}" in ball.inner_text()
    assert ball.locator("path.prior").count() == 2


def test_levels_are_drawn_when_they_come_into_sight_and_keys_go_through_them(chromium: Chromium, page: Any) -> None:
    drawn = """(() => { const canvas = document.querySelector(`button[aria-label="${argument}"]`).firstChild;
        return canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.some((x) => x) })()"""
    chromium.until(drawn, "train level 0")
    assert page.locator(".wall").first.locator("button").count() == 30
    page.focus("button[aria-label='train level 0']")
    for key in ("ArrowRight", "ArrowRight", "ArrowDown", "ArrowUp", "ArrowLeft", "End", "Enter"):
        page.keyboard.press(key)
    assert page.evaluate("[window.playground.level, window.playground.world.steps]") == [29, 0]  # no key hit the ball
    chromium.until(drawn, "train level 29")
    chromium.until("document.querySelector('.wall [aria-current]')?.title === 'train level 29'")
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.title") == "test level 0"


def test_the_python_and_the_settings_state_the_same_levels(page: Any, sets: tuple[Levels, Levels]) -> None:
    python, settings = page.locator("pre").all_inner_texts()
    assert stated_in_python(python) == sets
    config = yaml.safe_load(settings)["levels"]
    assert make_levels(LevelsConfig(**config)) == sets
    assert page.locator("button:has-text('Save train.json')").is_hidden()


def stated_in_python(text: str) -> tuple[Levels, Levels]:
    found: dict[str, Any] = {}
    exec(text, found)
    return found["train"], found["test"]


def test_changed_levels_are_stated_by_files(
    chromium: Chromium, page: Any, sets: tuple[Levels, Levels], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = measured(chromium)
    page.click("summary:has-text('Change this level')")
    page.fill("#factor-Position-y", "-0.5")
    page.press("#factor-Position-y", "Enter")
    said = measured(chromium, first)
    python, settings = page.locator("pre").all_inner_texts()
    assert "Save train.json beside them." in page.inner_text(".wide")
    with page.expect_download() as waiting:
        page.click("button:has-text('Save train.json')")
    waiting.value.save_as(tmp_path / "train.json")
    monkeypatch.chdir(tmp_path)
    train, test = stated_in_python(python)
    assert said == words(train, test)
    assert (train.values[0, 0, 1], test) == (-0.5, sets[1])
    again = make_levels(LevelsConfig(**yaml.safe_load(settings)["levels"]))
    assert np.array_equal(again[0].values, train.values, equal_nan=True)
    assert again[1] == test


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_wrong_and_a_phone_needs_no_sideways_scrolling(
    chromium: Chromium, page: Any, scheme: str
) -> None:
    size = page.viewport_size
    page.emulate_media(color_scheme=scheme)
    chromium.assert_accessible()
    page.set_viewport_size({"width": 360, "height": 740})
    assert page.evaluate("document.documentElement.scrollWidth") <= 360
    page.set_viewport_size(size)


def test_differences_that_no_distance_sees_are_told(chromium: Chromium, tmp_path: Path) -> None:
    def seen(visible: bool) -> Levels:
        ball = [{Position: [x, 0.2], Visible: visible} for x in (0.1, 0.2, 0.4)]
        return Levels.from_entities([[GoalTile(), GolfBall(one)] for one in ball] * 5, world=STILL)

    a, b = seen(True), seen(False)
    told = unseen_differences(a, b)
    assert told
    chromium.show(tmp_path, make_playground(a, b, observations=["state"]))
    assert measured(chromium) == "W2 0, KS 0"
    for text in told:
        assert text in chromium.page.inner_text(".wide")
    assert 'segar.Levels.load("test.json", world=world)' in chromium.page.inner_text(".wide")


def test_of_many_levels_the_first_ones_count(chromium: Chromium, tmp_path: Path) -> None:
    a, b = still("empty-hard", 310), still("empty-hard", 5, "test")
    chromium.show(tmp_path, make_playground(a, b, observations=["state"]))
    assert measured(chromium) == words(a[:300], b)
    assert "The first 300 levels of each set count." in chromium.page.inner_text(".wide")
    chromium.page.click("text=More levels >> visible=true")
    assert chromium.page.locator(".wall").first.locator("button").count() == 240


def test_a_page_of_one_set_has_none_of_this(chromium: Chromium, tmp_path: Path) -> None:
    chromium.show(tmp_path, make_playground(still("empty-hard", 3), observations=["state"]))
    assert "panel_design.js" not in chromium.run("return Object.keys(window.playground.about.scripts)")
    assert chromium.page.locator(".wide").count() == 0
