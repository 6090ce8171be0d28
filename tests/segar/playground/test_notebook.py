"""What notebooks show of levels, distributions, worlds and evaluations: small, complete, and safe to show."""

import json
import re
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

import segar
from segar.levels import TASK_LEVELS
from segar.suites import find_causes, own_suite, suite, twins
from tests.places import ROOT
from tests.segar.playground.browsers import Chromium

LEAST, MOST = 1_000, 100_000  # bytes of a card
NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))


def still(seen: np.ndarray) -> np.ndarray:
    return np.zeros((len(seen), 2), np.float32)


@pytest.fixture(scope="module")
def cards() -> dict[str, str]:
    easy, hard = segar.family("empty-easy"), segar.family("empty-hard")
    train, test = (easy.sample(3, seed=0, split=split) for split in ("train", "test"))
    found = segar.evaluate_policy(still, train, test)
    shown = {
        "levels": segar.family("objectsx3-hard").sample(100),
        "distribution": segar.family("tilesx3-hard"),
        "world": segar.World(),
        "rule space": suite("rules-rules-v1").train.world,
        "evaluation": found,
        "level set": found.test,
        "causes": find_causes(still, twins(own_suite(easy, hard, hard.sample(2, split="test")))),
    }
    return {name: one._repr_html_() for name, one in shown.items()}


@pytest.mark.parametrize("name", [*(one for one in segar.families() if one.endswith("-hard")), *TASK_LEVELS])
def test_cards_of_all_distributions_are_small_and_show_all_things(name):
    distribution = segar.family(name)
    levels = distribution.sample(8)
    card = levels._repr_html_()
    assert all(LEAST < len(one.encode()) < MOST for one in (card, distribution._repr_html_()))
    shaped = (levels.shape_kind > 0) & (levels.types >= 0)
    assert card.count("<title>") == shaped.sum()


def test_cards_ask_for_nothing_and_run_nothing(cards):
    for card in cards.values():
        assert LEAST < len(card.encode()) < MOST
        assert not re.search(r"<script|\bon\w+=|https?:|src=|url\(", card)


def test_names_of_others_are_text():
    name = "<script>alert(1)</script>"
    card = segar.LevelDistribution([(segar.GolfBall, 1)], name=name)._repr_html_()
    assert name not in card and "&lt;script&gt;" in card


def test_a_card_says_what_print_says(cards):
    assert "gap (test - train)" in cards["evaluation"] and "control" in cards["causes"]
    assert "apply_friction" in cards["world"] and "RandomUniformLocation()" in cards["distribution"]


def test_a_browser_shows_cards_on_a_narrow_screen(chromium: Chromium, cards: dict[str, str], tmp_path: Path):
    page = tmp_path / "cards.html"
    page.write_text("<!doctype html><meta charset='utf-8'>" + "".join(cards.values()))
    chromium.page.set_viewport_size({"width": 400, "height": 800})
    chromium.visit(page.as_uri())
    wide = chromium.run("return document.documentElement.scrollWidth")
    seen = chromium.run(
        "return [...document.querySelectorAll('.segar-levels svg')].map((one) => one.getBoundingClientRect().width)"
    )
    chromium.page.set_viewport_size({"width": 1240, "height": 900})
    assert wide <= 400 and len(seen) == 12 and min(seen) >= 100
    assert not chromium.messages and len(chromium.requests) == 1


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_are_kept_without_what_they_show(path: Path):
    code = [cell for cell in json.loads(path.read_text())["cells"] if cell["cell_type"] == "code"]
    assert not [cell for cell in code if cell["outputs"] or cell["execution_count"]]
    assert sum(bool(line.strip()) for cell in code for line in cell["source"]) <= 40


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_that_read_results_ask_for_an_installation_that_finds_them_from_every_folder(path: Path):
    text = path.read_text()
    assert ("policies.load" in text) == ("`pip install -e" in text)


@pytest.mark.docs
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_a_browser_shows_its_cards_pages_and_videos(path: Path, chromium: Chromium, tmp_path: Path):
    import nbformat
    from jupyter_client import AsyncKernelManager
    from nbclient import NotebookClient

    notebook = nbformat.read(path, as_version=4)
    with TemporaryDirectory() as sockets:  # a port that is free now may be another's when the kernel asks for it
        manager = AsyncKernelManager(transport="ipc", ip=f"{sockets}/kernel")
        NotebookClient(notebook, manager, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    shown = [output.data["text/html"] for output in outputs if "text/html" in output.get("data", {})]
    ours = [html for html in shown if "<video" not in html]  # a video is as long as an episode of that agent
    assert len(ours) >= 2 and max(map(len, ours)) < 300_000
    page = tmp_path / "shown.html"
    page.write_text("<!doctype html><meta charset='utf-8'>" + "".join(shown))
    chromium.visit(page.as_uri())
    chromium.until("[...document.querySelectorAll('iframe')].every((one) => one.contentWindow.playground)")
    chromium.until("[...document.querySelectorAll('video')].every((one) => one.duration > 0)")
    assert "Traceback" not in chromium.run("return document.body.innerText") and not chromium.messages
