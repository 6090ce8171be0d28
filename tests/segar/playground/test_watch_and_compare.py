"""The panels of the agent and of the comparison: what they say is what Python says of the same levels."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import segar
from segar.envs import VectorEnv
from segar.evaluation import find_baselines, play_episodes
from segar.evaluation.episodes import BATCH
from segar.playground import make_playground
from segar.policies import NetworkPolicy
from tests.segar.playground.browsers import Browser, Chromium
from tests.segar.playground.test_policies import convolutional

TRAIN = segar.family("objectsx1-hard").sample(6, seed=3)
TEST = segar.family("tilesx1-hard").sample(4, seed=4, split="test")

BUTTON = "const button = (text) => [...document.querySelectorAll('button')].find((one) => one.textContent === text);"
TO_THE_END = "while (!window.playground.world.over) window.playground.single();"
AGENT = "return window.playground.results.episodes.map((set) => set.agent.map((plays) => plays[0]))"


@segar.rule
def gusts(thing: tuple[segar.Velocity]) -> segar.Differential[segar.Velocity]:
    """Each thing that can move is pushed somewhere."""
    (v,) = thing
    return segar.Differential[segar.Velocity](v, (segar.random.normal(0.0, 2.0), segar.random.normal(0.0, 2.0)))


@pytest.fixture
def page(browser: Browser, tmp_path: Path) -> Browser:
    """A page with a policy, in a browser."""
    browser.show(tmp_path, make_playground(TRAIN, TEST, observations=["textures"], policy=convolutional("textures")))
    return browser


def test_the_agent_plays_all_levels_as_in_python_and_its_failures_come_first_where_asked(page: Browser) -> None:
    page.run(f"{BUTTON} button('Let the agent play all levels').click()")
    page.until("window.playground.results.episodes[1].agent.length === 4")
    policy = NetworkPolicy(convolutional("textures"))
    for levels, found in zip((TRAIN, TEST), page.run(AGENT), strict=True):
        expected = play_episodes(levels, np.arange(len(levels)), policy, seed=0, observation="textures")
        assert [one["returned"] for one in found] == expected.returns.tolist()
        assert [one["success"] for one in found] == expected.success.tolist()
        assert [one["steps"] for one in found] == expected.length.tolist()
    page.until("!document.querySelector('.strip button').title.includes('not played')")
    page.run("[...document.querySelectorAll('label')].find((one) => one.textContent.includes('failures')).click()")
    cells = page.run(
        "return [...document.querySelectorAll('.strip')].map((one) => [...one.children].map((c) => c.title))"
    )
    for titles, results in zip(cells, page.run(AGENT), strict=True):
        expected = sorted(range(len(results)), key=lambda k: (results[k]["success"], results[k]["returned"]))
        failed = [k for k in expected if not results[k]["success"]]
        assert [int(title.split(":")[0][6:]) for title in titles][: len(failed)] == failed
    last = int(cells[1][-1].split(":")[0][6:])
    page.run("[...document.querySelectorAll('.strip')][1].lastChild.click()")
    shown = page.run(
        "const p = window.playground; return [p.set, p.level, p.player.running, p.player.actor === p.policy]"
    )
    assert shown == [1, last, True, True]
    assert page.run(f"{TO_THE_END} return window.playground.world.total") == page.run(AGENT)[1][last]["returned"]
    second_batch = VectorEnv(TEST, 2, seed=BATCH)
    second_batch.reset(seed=BATCH, options={"levels": [3, 2]})
    page.run(f"window.playground.world.start(2, 0n, {BATCH + 1})")
    key = page.run("return String(window.playground.world.machine.array('key')[0])")
    assert key == str(second_batch.state().state.key[1])


def test_what_the_agent_plays_is_not_counted_for_the_person(page: Browser) -> None:
    episodes = "window.playground.results.episodes[0].you.flat().length"
    rows = "[...document.querySelectorAll('h2')].find((one) => one.textContent === 'Your episodes').closest('details')"
    rows += ".querySelectorAll('tbody tr').length"
    for did, counted in (
        (f"{BUTTON} button('Let the agent play').click();", 0),
        (f"{BUTTON} button('Stop the agent').click();", 1),
        ("window.playground.player.replay();", 1),
    ):
        page.run(f"{did} {TO_THE_END}")
        assert page.run(f"return [{episodes}, {rows}]") == [counted, counted]


def test_scores_and_plans_are_those_of_python_even_where_rules_draw(browser: Browser, tmp_path: Path) -> None:
    windy = segar.family("empty-easy").with_rules((*segar.DEFAULT_RULES, gusts)).sample(4, seed=2)
    browser.show(tmp_path, make_playground(windy, plans=True))
    baselines = find_baselines(windy, rng=np.random.default_rng(0))
    found = browser.run("return window.playground.about.sets[0].baselines")
    names = ("random", "idle", "oracle")
    assert [found[name] for name in names] == [getattr(baselines, name).tolist() for name in names]
    browser.run(
        "window.plans = []; const play = (k) => window.playground.results.play(0, 'planner', k, 0n);"
        "for (let k = 0; k < 4; k++) play(k).then((one) => window.plans.push(one))"
    )
    browser.until("window.plans.length === 4")
    assert browser.run("return window.plans.map((one) => one.returned)") == baselines.oracle.tolist()
    for level in range(4):
        browser.run(f"window.playground.go({level}); window.playground.player.act([0.3, 1]); {TO_THE_END}")
    mine = browser.run("return [0, 1, 2, 3].map((k) => window.playground.results.returned(0, 'you', k))")
    score = browser.run("return window.playground.results.score(0, 'you', [0, 1, 2, 3])")
    assert score == pytest.approx(baselines.normalised(np.mean(mine)), rel=1e-12)
    some = browser.run("return window.playground.results.score(0, 'you', [1, 3])")
    part = type(baselines)(*(getattr(baselines, name)[[1, 3]] for name in names))
    assert some == pytest.approx(part.normalised(np.mean([mine[1], mine[3]])), rel=1e-12)


def test_the_way_of_the_planner_is_drawn_on_the_level_as_it_came(browser: Browser, tmp_path: Path) -> None:
    browser.show(tmp_path, make_playground(TRAIN[:2], plans=True))
    way = "const way = [...document.querySelectorAll('select')].find((s) => [...s.options].some((o) => o.value === 'planner'));"
    browser.run(f"{way} way.value = 'planner'; way.dispatchEvent(new Event('change'))")
    browser.until("window.playground.ghost !== null")
    plan = find_baselines(TRAIN[:2], rng=np.random.default_rng(0)).plan
    assert plan is not None
    ghost = browser.run("return window.playground.ghost")
    body, column = 0, TRAIN.layout.columns[segar.Position]
    assert len(ghost) == plan.steps[0] + 1
    assert browser.run("return window.playground.levels.about.agents[0]") == body
    assert ghost[-1] == plan.values[0, body, column : column + 2].tolist()
    browser.run("window.playground.go(1)")
    browser.until(f"window.playground.ghost?.length === {plan.steps[1] + 1}")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_wrong_in_the_panels(scheme: Any, chromium: Chromium, tmp_path: Path) -> None:
    probes = {"golfball.Position.x": (0.934, 0.91, 0.96), "goal.Position.x": (-0.2, -0.3, -0.001)}
    chromium.page.emulate_media(color_scheme=scheme)
    chromium.show(tmp_path, make_playground(TRAIN, TEST, policy=convolutional("rgb"), probes=probes, plans=True))
    chromium.run(
        f"{BUTTON} button('Let the agent play all levels').click();"
        " document.querySelectorAll('details').forEach((d) => d.open = true)"
    )
    chromium.until("window.playground.results.episodes[1].agent.length === 4")
    chromium.page.get_by_role("button", name="level 0: ").first.focus()
    for key in ("ArrowRight", "ArrowDown", "Home", "ArrowRight", "ArrowRight", "Enter"):
        chromium.page.keyboard.press(key)
    assert chromium.run("return document.querySelectorAll('.strip button[tabindex=\"0\"]').length") == 2
    chromium.until("document.getElementById('said').textContent.includes('level 2')")
    chromium.until("document.querySelector('details .note + .bar').style.width === '100%'")
    assert "Value of what it sees: " in chromium.page.inner_text("details >> nth=0")
    known = chromium.page.get_by_role("region", name="What the representation knows")
    assert known.locator("tr").all_inner_texts()[1:] == [
        "golfball.Position.x\t0.93 [0.91, 0.96]\t",
        "goal.Position.x\t-0.20 [-0.30, 0.00]\t",
    ]
    assert known.locator(".bar").evaluate_all("(bars) => bars.map((one) => one.style.width)") == ["93.4%", "0%"]
    chromium.assert_accessible()
    chromium.assert_quiet()
