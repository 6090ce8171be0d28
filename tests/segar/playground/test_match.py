"""A match in a page: five training levels and five test levels beside the agent, by keys alone or by touch; then the gaps."""

import base64
import gzip
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import segar
from segar.evaluation import RecordedActions, find_baselines, play_episodes
from segar.playground import make_playground
from segar.playground.page import DOCUMENTATION, STATIC
from segar.policies import NetworkPolicy
from tests.places import ROOT
from tests.segar.playground.browsers import Browser, Chromium
from tests.segar.playground.test_policies import convolutional

TASK = segar.puttputt(max_steps=12)
TRAIN = segar.family("objectsx1-hard").sample(6, seed=3)
TEST = segar.family("tilesx1-hard").sample(5, seed=4, split="test")
SETS = (TRAIN[:5], TEST)
CHANGED = "Things are objects in training, and tiles in the test."
GAPS = "[...document.querySelectorAll('.result tbody td:last-child')].map((one) => one.textContent)"
WATCH = """
window.told = [];
for (const one of document.querySelectorAll('[role=status], [aria-live]')) {
  const notes = new MutationObserver(() => window.told.push(performance.now()));
  notes.observe(one, { childList: true, characterData: true, subtree: true });
}
"""


@pytest.fixture(scope="module")
def match(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a match."""
    path = tmp_path_factory.mktemp("match") / "page.html"
    make_playground(TRAIN, TEST, task=TASK, policy=convolutional("rgb"), plans=True, match=CHANGED).save(path)
    assert path.stat().st_size <= 300_000
    return path


def gap(returns: list[np.ndarray]) -> str:
    train, test = (float(np.mean(one)) for one in returns)
    return f"{test - train:+.2f}".replace("-", "\N{MINUS SIGN}")


@pytest.mark.parametrize(("scheme", "width"), [("dark", 400), pytest.param("light", 1240, marks=pytest.mark.slow)])
def test_a_match_is_played_by_keys_alone_and_ends_with_the_gaps_of_python(
    scheme: Any, width: int, chromium: Chromium, match: Path
) -> None:
    page, before = chromium.page, chromium.page.viewport_size
    page.set_viewport_size({"width": width, "height": 800})
    page.emulate_media(color_scheme=scheme)
    chromium.open(match)
    chromium.run(WATCH)
    played: list[list[list[float]]] = []
    for k in range(10):
        assert chromium.run("return window.playground.player.speed = window.playground.world.steps + 4") == 4
        for key in ["ArrowLeft"] * (k + 1) + ["Shift+ArrowUp", "Enter"]:
            page.keyboard.press(key)
        chromium.until("window.playground.world.over")
        played.append(chromium.run("return window.playground.world.actions.map((one) => [...one])"))
        if k in (0, 9):
            chromium.until(f"window.told.length > {k // 9}")
            chromium.assert_accessible()
        page.keyboard.press("Enter")
    assert CHANGED in page.inner_text("#match") and page.title().startswith("Beat the agent")
    mine, agents, plans = [], [], []
    for side, levels in enumerate(SETS):
        every = np.arange(len(levels))
        actions = np.zeros((5, 12, 2), np.float32)
        for level, one in enumerate(played[5 * side : 5 * side + 5]):
            actions[level, : len(one)] = one
        mine.append(play_episodes(levels, every, RecordedActions(actions), task=TASK, seed=0).returns)
        policy = NetworkPolicy(convolutional("rgb"))
        agents.append(play_episodes(levels, every, policy, seed=0, observation="rgb", task=TASK).returns)
        plans.append(find_baselines((TRAIN, TEST)[side], TASK, rng=np.random.default_rng(0)).oracle[:5])
    assert chromium.run(f"return {GAPS}") == [gap(mine), gap(agents), gap(plans)]
    chromium.assert_accessible()
    assert chromium.run("return document.documentElement.scrollWidth <= window.innerWidth")
    chromium.until("window.told.length > 2")
    told = chromium.run("return window.told")
    assert min(np.diff(told)) > 800  # [ms]; the observer may hear late of the first one
    chromium.until("document.getElementById('said').textContent.includes('Play again')")
    for key in ("ArrowDown", " "):
        page.keyboard.press(key)
    chromium.until("window.scrollY > 0 || document.documentElement.scrollHeight <= window.innerHeight")
    assert "gap" in page.inner_text("#match h2")  # keys that scroll begin no new match
    assert chromium.messages == []
    assert [one for one in chromium.requests if not one.startswith(("blob:", "data:"))] == [match.as_uri()]
    page.set_viewport_size(before)


def test_the_ghost_is_where_the_agent_is_and_time_stands_while_one_aims(browser: Browser, match: Path) -> None:
    browser.open(match)
    browser.until("window.playground.match.ghost() !== null")
    browser.run(
        "const p = window.playground, arena = document.getElementById('arena'), box = arena.getBoundingClientRect();"
        "arena.setPointerCapture = () => {}; p.player.act([0, 0]); p.step = p.player.step(); p.player.step();"
        "const at = { clientX: box.left + 9, clientY: box.top + 9, pointerId: 1 };"
        "arena.dispatchEvent(new PointerEvent('pointerdown', at)); window.up = new PointerEvent('pointerup', at);"
    )
    steps = browser.run("return window.playground.world.steps")
    assert not browser.run("return window.playground.player.running")
    ghost = browser.run("return window.playground.match.ghost()")
    way = browser.run("return window.playground.results.episodes[0].agent[0][0].path")
    assert ghost == way[min(steps, len(way) - 1)]
    browser.run("document.getElementById('arena').dispatchEvent(window.up)")
    browser.until(f"window.playground.world.steps > {steps}")


def test_the_whole_playground_is_behind_a_match(chromium: Chromium, match: Path) -> None:
    chromium.open(match)
    assert not chromium.page.is_visible("#panels")
    chromium.page.get_by_role("button", name="Open the whole playground").click()
    assert chromium.page.is_visible("#panels") and not chromium.page.query_selector("#match")
    assert chromium.page.inner_text("h1") == chromium.run("return window.playground.about.title")


def test_the_verdict_says_that_a_test_costs_only_where_it_does(chromium: Chromium, match: Path) -> None:
    chromium.open(match)
    said = {
        gaps: chromium.run(
            "return import('segar/match.js').then((match) =>"
            " match.verdictOf({ gap: argument[0], solved: [1, 0] }, { gap: argument[1] }))",
            gaps,
        )
        for gaps in [(-1.0, -2.0), (-2.0, 1.0), (0.5, -1.0), (2.0, 1.0), (1.0, 2.0)]
    }
    assert [one.rpartition(": the test ")[2] for one in said.values()] == [
        "cost you less.",
        "cost you more.",
        "cost you less.",
        "helped you more.",
        "helped you less.",
    ]
    assert [one.startswith("You beat the agent") for one in said.values()] == [True, False, True, True, False]


def test_the_page_that_the_readme_names_has_the_program_of_today() -> None:
    page = (ROOT / "docs" / "beat-the-agent.html").read_text(encoding="utf-8")
    packed = base64.b85decode(re.findall(r'id="data">([^<]*)', page)[0].replace(",", "<"))
    data = gzip.decompress(packed[4 : 4 + int.from_bytes(packed[:4], "big")])
    start = 8 + int.from_bytes(data[:8], "little")
    about = json.loads(data[8:start])
    scripts = {
        name: data[start + about["blobs"][k][0] :][: about["blobs"][k][1]] for name, k in about["scripts"].items()
    }
    now = {path.name: DOCUMENTATION.sub("", path.read_text(encoding="utf-8")).encode() for path in STATIC.glob("*.js")}
    command = "segar playground number-more-v1 --policy ppo_fast-state-laptop -o docs/beat-the-agent.html"
    assert scripts == {name: now[name] for name in scripts} and (STATIC / "page.css").read_text() in page, (
        f"run {command}"
    )
    assert len(page) <= 300_000 and command.replace("docs/beat-the-agent", "page") in (ROOT / "README.md").read_text()


def test_a_match_needs_all_its_parts() -> None:
    with pytest.raises(segar.SegarError, match="a match needs test levels, a policy and plans"):
        make_playground(TRAIN, match=CHANGED)
