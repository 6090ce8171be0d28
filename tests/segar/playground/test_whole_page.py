"""A page says in plain words what is wrong with itself, and what it shows, to everybody."""

import re
from pathlib import Path
from typing import Any

import pytest

from segar.levels import hash_of_levels
from segar.rendering import SIGNS
from tests.segar.playground.browsers import Chromium
from tests.segar.playground.conftest import LEVELS

WORDS = "was cut short"
HASH = hash_of_levels(LEVELS)


def visible(chromium: Chromium, text: bytes, path: Path, until: str = "true") -> str:
    """What a person reads on a page with these bytes, once it is there."""
    path.write_bytes(text)
    chromium.visit(path.as_uri())
    chromium.until(f"document.readyState === 'complete' && {until}")
    return chromium.page.inner_text("body")


ENDED = "(!!window.playground || !document.getElementById('trouble').hidden)"


def test_a_page_that_was_cut_short_says_so_wherever_that_is(chromium: Chromium, saved: Path, tmp_path: Path) -> None:
    whole = saved.read_bytes()
    first, last = whole.index(b"</p>"), whole.rindex(b"</script>")
    inside = [whole.index(mark) + 3 for mark in (b"<style>", b"<main", b"<canvas", b'id="data"', b'"use strict"')]
    points = [first, *inside, (first + last) // 2, last - 1, *range(first, last, (last - first) // 12)]
    for point in points:
        assert WORDS in visible(chromium, whole[:point], tmp_path / "cut.html"), point
    assert first < 1000
    assert WORDS not in visible(chromium, whole, tmp_path / "cut.html", ENDED)


def test_a_page_with_a_damaged_byte_says_so_or_plays_as_it_should(
    chromium: Chromium, saved: Path, tmp_path: Path
) -> None:
    whole = saved.read_bytes()
    start = whole.index(b'id="data">') + 10
    end = whole.index(b"</script>", start)
    first = [start + k for k in (0, 3, 4, 9, 40)]
    for point in (*first, *range(start + 100, end, (end - start) // 8), end - 1):
        for other in (b"A", b"\xff"):
            if whole[point : point + 1] == other:
                continue
            said = visible(chromium, whole[:point] + other + whole[point + 1 :], tmp_path / "damaged.html", ENDED)
            plays = chromium.run("return !!window.playground")
            assert plays or WORDS in said, (point, other)
            if plays:  # what was changed is behind the end of the data
                assert chromium.run("return window.playground.levels.about.hash") == HASH


def test_a_damaged_program_leaves_the_sentence(chromium: Chromium, saved: Path, tmp_path: Path) -> None:
    whole = saved.read_bytes()
    at = whole.index(b"const unpacked")
    assert WORDS in visible(chromium, whole[:at] + b"}" + whole[at + 1 :], tmp_path / "damaged.html")


def test_signs_are_drawn_as_pictures_have_them(chromium: Chromium, saved: Path) -> None:
    chromium.open(saved)
    found = chromium.run(
        """const { scene, world, levels } = window.playground;
        const { walls } = levels.about, side = scene.canvas.width, context = scene.canvas.getContext('2d');
        const pixel = ([x, y]) =>
          [...context.getImageData((x / walls + 1) / 2 * side, (1 - y / walls) / 2 * side, 1, 1).data].slice(0, 3);
        const goal = scene.things(world.values, world.level).find((one) => one.type.goal);
        const at = (share) => pixel([goal.x + share * goal.radius, goal.y]);
        return { middle: at(0), ring: at(argument), ground: at(0.52),
          signs: window.playground.about.signs };""",
        SIGNS["goal_rings"][0],
    )
    assert found["middle"] == found["ring"] == [255, 255, 255] != found["ground"]
    assert found["signs"]["goal_rings"] == list(SIGNS["goal_rings"])
    assert found["signs"]["dead"]["colour"] == [230, 40, 40]


def test_who_listens_is_told_once_a_second_and_where_things_are(chromium: Chromium, saved: Path) -> None:
    chromium.open(saved)
    told = chromium.page.evaluate(
        """async () => {
          const { player } = window.playground, said = document.getElementById('said');
          let changes = 0;
          new MutationObserver(() => { changes += 1; }).observe(said, { childList: true, characterData: true, subtree: true });
          player.act([1, 0]);
          await new Promise((resolve) => setTimeout(resolve, 2500));
          player.running = false;
          return changes;
        }"""
    )
    assert 1 <= told <= 4
    label = chromium.page.get_attribute("#arena", "aria-label")
    assert re.search(r"golfball at -?[\d.]+, -?[\d.]+; .*level 0, step", label or "")
    assert chromium.page.get_attribute("#said", "role") == "status"


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (400, 800)])
def test_no_control_is_cut(chromium: Chromium, saved: Path, width: int, height: int) -> None:
    page = chromium.page
    before = page.viewport_size
    page.set_viewport_size({"width": width, "height": height})
    chromium.open(saved)
    boxes: list[Any] = [
        one.bounding_box() for one in page.query_selector_all("#stage button, #stage input, #stage select")
    ]
    page.set_viewport_size(before)
    assert all(one["x"] >= 0 and one["x"] + one["width"] <= width for one in boxes if one)
    assert all(one["y"] + one["height"] <= height for one in boxes if one)


def test_an_address_may_name_a_level_alone(chromium: Chromium, saved: Path) -> None:
    chromium.visit(f"{saved.as_uri()}#level=2")
    chromium.until("window.playground?.level === 2")
