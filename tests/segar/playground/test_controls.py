"""A page used as a person uses it, in Chromium: mouse, keys, sliders, text; and what it says when something is wrong."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import segar
from segar.datasets import read_play
from segar.envs import VectorEnv
from tests.segar.playground.browsers import Chromium
from tests.segar.playground.conftest import LEVELS
from tests.waiting import until


@pytest.fixture
def page(chromium: Chromium, saved: Path) -> Iterator[Any]:
    """The page, opened anew; it has said nothing to the console when the test ends, and asked for nothing."""
    chromium.open(saved)
    yield chromium.page
    chromium.assert_quiet()


def state(page: Any) -> dict[str, Any]:
    return page.evaluate(
        """() => { const { world } = window.playground; return { level: world.level, steps: world.steps, total: world.total,
        over: world.over, running: window.playground.player.running, values: [...world.values].map(String) } }"""
    )


def drag(page: Any, start: tuple[float, float], stop: tuple[float, float]) -> None:
    """Drag over the arena, from and to places in metres."""
    box = page.locator("#arena").bounding_box()

    def pixel(place: tuple[float, float]) -> tuple[float, float]:
        return box["x"] + (place[0] + 1) / 2 * box["width"], box["y"] + (1 - place[1]) / 2 * box["height"]

    page.mouse.move(*pixel(start))
    page.mouse.down()
    page.mouse.move(*pixel(stop), steps=3)
    page.mouse.up()


def ball(page: Any) -> tuple[float, float]:
    values = state(page)["values"]
    return float(values[0]), float(values[1])


def enter(page: Any, field: str, value: str) -> None:
    page.fill(field, value)
    page.press(field, "Enter")


def assert_same_state(page: Any, env: VectorEnv) -> None:
    """The page and an environment have the same numbers."""
    values = env.state().state.values.ravel().tolist()
    assert [float(v) for v in state(page)["values"] if v != "NaN"] == [v for v in values if v == v]


def test_a_hit_by_mouse_is_the_action_that_python_takes(page: Any) -> None:
    enter(page, "#seed", "7")
    x, y = ball(page)
    drag(page, (x, y), (x + 0.3, y))
    until(lambda: state(page)["steps"])
    page.keyboard.press(" ")
    actions = np.array(page.evaluate("window.playground.world.actions.map((one) => [...one])"), np.float32)
    assert np.abs(actions[0] - [0.5, 0.0]).max() < 0.02  # 0.6 m is as hard as can be
    env = VectorEnv(LEVELS, 1, seed=7)
    env.reset(options={"levels": np.array([0])})
    for action in actions:
        env.step(action[None])
    assert_same_state(page, env)


def test_keys_hit_pause_step_and_go_on(page: Any) -> None:
    page.focus("#arena")
    page.keyboard.press("ArrowRight")
    until(lambda: state(page)["steps"] >= 2)
    page.keyboard.press(" ")
    before = state(page)
    assert not before["running"]
    page.keyboard.press(".")
    assert state(page)["steps"] == before["steps"] + 1
    page.keyboard.press("r")
    assert (state(page)["steps"], state(page)["level"]) == (0, 0)
    page.keyboard.press("n")
    assert state(page)["level"] == 1
    page.click("#before")
    page.click("#before")
    assert state(page)["level"] == len(LEVELS) - 1


def test_a_replay_ends_where_the_episode_ended(page: Any) -> None:
    page.select_option("#speed", "4")
    page.focus("#arena")
    page.keyboard.press("ArrowLeft")
    until(lambda: state(page)["over"])
    first = state(page)
    assert "level 0" in page.inner_text("#status")
    page.click("#replay")
    until(lambda: state(page)["over"])
    assert state(page)["values"] == first["values"]
    assert state(page)["total"] == first["total"]


def open_changes(page: Any) -> None:
    page.click("summary:has-text('Change this level')")


def test_sliders_and_numbers_change_the_level_and_undo_brings_it_back(page: Any) -> None:
    open_changes(page)
    was = state(page)["values"]
    enter(page, "#factor-Mass", "2.5")
    assert page.evaluate("window.playground.levels.factor(0, 0, 'Mass')") == [2.5]
    assert state(page)["values"] != was
    wrong = [("Mass", "1e31", ""), ("Visible", "0.5", ""), ("Charge", "", ""), ("Size", "0", "")]
    for factor, value, what in (*wrong, ("Mass", "-1", "a"), ("Size", "-0.3", "a")):
        enter(page, f"#factor-{factor}", value)
        assert f"{factor} of 'golfball' must be {what}" in page.inner_text("details[open] > p.note")
        assert page.evaluate("window.playground.levels.factor(0, 0, 'Mass')") == [2.5]
    assert float(page.get_attribute("input[aria-label^='Size']", "min")) > 0
    page.click("text=Undo")
    assert state(page)["values"] == was


@pytest.mark.parametrize("wrong", ["-1", "2.5", "1e30", str(2**64), ""])
def test_a_seed_is_a_whole_number_that_python_takes(page: Any, wrong: str) -> None:
    enter(page, "#seed", str(2**64 - 1))
    assert page.is_hidden("#trouble")
    enter(page, "#seed", wrong)
    assert "A seed is a whole number from 0 to 2^64 - 1" in page.inner_text("#trouble")
    assert page.input_value("#seed") == str(2**64 - 1)
    page.click("#again")
    assert page.evaluate("String(window.playground.world.seed)") == str(2**64 - 1)


def test_things_are_dragged_removed_and_changed_into_others(page: Any) -> None:
    open_changes(page)
    page.check("text=move things by dragging")
    x, y = ball(page)
    drag(page, (x, y), (-0.5, 0.25))
    assert np.abs(np.array(ball(page)) - [-0.5, 0.25]).max() < 0.01
    assert state(page)["steps"] == 0
    things = page.locator("select[aria-label='Thing'] option").all_inner_texts()
    page.select_option("select[aria-label='Thing']", label=next(name for name in things if name.startswith("object")))
    kinds = page.locator("select[aria-label='Kind of the thing'] option").all_inner_texts()
    assert len(kinds) > 2
    marked = "(() => { const p = window.playground, k = p.levels.kindOf(p.level, p.marked);"
    marked += " return k < 0 ? '(not there)' : p.levels.about.kinds[k].name })()"
    for kind in kinds:
        page.select_option("select[aria-label='Kind of the thing']", label=kind)
        assert page.evaluate(marked) == kind
        page.click("#single")
        assert state(page)["steps"] == 1


def test_the_level_as_text_goes_both_ways_and_says_where_it_is_wrong(page: Any) -> None:
    open_changes(page)
    page.click("summary:has-text('The level as text')")
    text = page.input_value("textarea")
    data = json.loads(text)
    for one in data["entities"].values():
        one.pop("sampled", None)  # a level that was changed is not as it was drawn
    data["entities"]["golfball"]["factors"]["Position"] = [-0.25, 0.5]
    data["parameters"]["Gravity"] = 3.5
    page.fill("textarea", json.dumps(data))
    page.click("text=Use this text")
    assert ball(page) == (-0.25, 0.5)
    assert json.loads(page.input_value("textarea")) == data
    kept = state(page)["values"]
    wrong = {
        "{": ("no JSON", ""),
        json.dumps({"entities": {}}): ("entities.golfball is missing", ""),
        json.dumps(data | {"parameters": {"Gravitas": 1}}): ('parameters: there is no "Gravitas" here, only', ""),
        text.replace('"Mass": 1.0', '"Mass": 1.0.0', 1): ("no JSON", ".0"),
        text.replace('"Mass": 1.0', '"Mass": "heavy"', 1): ("factors.Mass must be a number", '"Mass"'),
        text.replace('"GolfBall"', '"Golfball"', 1): ("entities.golfball.type", '"Golfball"'),
        text[:-3]: ("no JSON", ""),
    }
    for edit, (why, place) in wrong.items():
        page.fill("textarea", edit)
        page.click("text=Use this text")
        assert why in (note := page.inner_text("details[open] > p.note"))
        assert state(page)["values"] == kept and page.input_value("textarea") == edit
        start = page.evaluate("document.querySelector('textarea').selectionStart")
        assert edit[start:].startswith(place), edit[start : start + 20]
        line = edit[:start].count("\n") + 1
        assert f"line {line}, column" in note


def test_a_changed_level_plays_as_python_plays_it(page: Any, tmp_path: Path) -> None:
    open_changes(page)
    enter(page, "#factor-Charge", "0.75")
    page.click("summary:has-text('The level as text')")
    with page.expect_download() as waiting:
        page.click("details[open] details[open] >> text=Save as file")
    waiting.value.save_as(tmp_path / "level.json")
    page.click("summary:has-text('The level as text')")
    for _ in range(30):
        page.click("#single")
    env = VectorEnv(segar.Levels.load(tmp_path / "level.json"), 1, seed=0)
    env.reset()
    for _ in range(30):
        env.step(np.zeros((1, 2), np.float32))
    assert_same_state(page, env)


def address(page: Any) -> str:
    """The address that the page gives for what it shows."""
    page.click("#link")
    page.locator("#address a").wait_for()
    return page.evaluate("document.querySelector('#address a').href")


@pytest.mark.parametrize("changes", [{}, {"Charge": 0.3}, {"Mass": 1 / 3, "Charge": -0.0}])
def test_an_address_opens_a_page_at_the_level_that_was_shown(chromium: Chromium, page: Any, changes: dict) -> None:
    enter(page, "#seed", str(2**64 - 1))
    page.click("#next")
    if changes:
        page.evaluate(
            "(() => { const { levels } = window.playground;"
            " levels.setKind(1, levels.about.slots.findIndex((one) => one.optional), -1) })()"
        )
    for factor, value in changes.items():
        page.evaluate(f"window.playground.levels.setFactor(1, 0, '{factor}', [{value!r}])")
    page.click("#again")
    there, shown = address(page), state(page)
    assert ("is=" in there) == bool(changes)
    assert len(there) < 2500
    chromium.visit("about:blank")
    chromium.visit(there)
    chromium.until("!!window.playground")
    assert state(page) == shown
    assert page.input_value("#seed") == str(2**64 - 1)
    assert page.evaluate("window.playground.levels.changed.size") == bool(changes)
    page.click("#single")
    after = state(page)["values"]
    page.click("#again")
    page.click("#single")
    assert state(page)["values"] == after


def test_an_address_that_says_nonsense_is_told_and_the_page_goes_on(page: Any) -> None:
    good = address(page).partition("#")[2]
    wrong = {
        "levels=0123": "it was made in a page of other levels",
        good.replace("level=0", "level=12"): "its level must be a whole number below 12, not 12",
        good.replace("level=0", "level=-1"): "not -1",
        f"{good}&seed={2**64}": "its seed must be a whole number below",
        f"{good}&is=%25": "the level in it is damaged; take the link again",
        f"{good}&is=AAAA": "the level in it is damaged; take the link again",
        f"{good}&is=q1YqycjMSy9WslIwrAUA": "a level has entities",  # the text {"things": 1}
        f"{good}&is=" + "A" * 60_000: "at most 50000 are read",
    }
    for fragment, why in wrong.items():
        page.evaluate("(fragment) => { window.location.hash = fragment }", fragment)
        page.locator("#trouble", has_text=why).wait_for()
        assert state(page)["level"] == 0
    page.evaluate("(fragment) => { window.location.hash = fragment }", good.replace("level=0", "level=3"))
    until(lambda: (state(page)["level"], page.is_visible("#trouble")) == (3, False))


def test_what_a_person_played_is_played_again_by_python(page: Any, tmp_path: Path) -> None:
    page.select_option("#speed", "4")
    for level, key in enumerate(["ArrowLeft", "ArrowUp"]):
        page.focus("#arena")
        page.keyboard.press(key)
        until(lambda: state(page)["over"])
        if not level:
            page.click("#next")
    last = state(page)["total"]
    page.click("#next")
    page.click("#single")
    page.click("#again")  # leaves an episode of one step
    page.click("summary:has-text('Your episodes')")
    for level in (0, 2, 5):  # levels that were played, and one that nobody played: the file has them as they came
        page.evaluate(f"window.playground.levels.setFactor({level}, 0, 'Mass', [3])")
    page.click("#single")
    page.click("#again")  # of a level that was changed: it is not in the file
    with page.expect_download() as waiting:
        page.click("details[open] >> text=Save as file")
    waiting.value.save_as(tmp_path / "episodes.json")
    levels, episodes = read_play(tmp_path / "episodes.json")
    assert levels == LEVELS
    assert [one.options["level"] for one in episodes] == [0, 1, 2]
    assert episodes[1].rewards.sum() == pytest.approx(last)
    assert (len(episodes[2].rewards), episodes[2].terminations[-1], episodes[2].truncations[-1]) == (1, False, False)
    assert page.evaluate("window.playground.levels.factor(2, 0, 'Mass')") == [3]
    assert page.evaluate("[...window.playground.levels.changed]") == [0, 2, 5]


@pytest.mark.parametrize(
    "missing, why",
    [
        ("Object.defineProperty(window, 'WebAssembly', { value: undefined })", "does not run WebAssembly"),
        ("delete window.DecompressionStream", "older than 2023"),
    ],
)
def test_a_browser_that_lacks_something_is_told(chromium: Chromium, saved: Path, missing: str, why: str) -> None:
    context = chromium.browser.new_context()
    page = context.new_page()
    page.add_init_script(missing)
    page.goto(saved.as_uri())
    page.locator("#trouble").wait_for(state="visible")
    assert why in page.inner_text("#trouble")
    context.close()


def test_a_page_that_may_not_run_wasm_says_so(chromium: Chromium, saved: Path, tmp_path: Path) -> None:
    forbidden = tmp_path / "forbidden.html"
    forbidden.write_text(saved.read_text().replace(" 'wasm-unsafe-eval'", ""))
    chromium.open(forbidden)
    assert "does not let the page run WebAssembly" in chromium.page.inner_text("#trouble")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_wrong(chromium: Chromium, page: Any, scheme: str) -> None:
    page.emulate_media(color_scheme=scheme)
    page.evaluate("document.querySelectorAll('details').forEach((one) => { one.open = true })")
    page.evaluate("() => Promise.all(document.getAnimations().map((one) => one.finished))")
    chromium.assert_accessible()
