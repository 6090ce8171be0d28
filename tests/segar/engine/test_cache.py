"""Kernels are files named by their content: the same world compiles once, and an edited rule never runs stale."""

from __future__ import annotations

import numpy as np
import pytest

from segar.engine.compiler import kernel_cache as cache
from segar.engine.compiler.kernel import generate
from segar.engine.compiler.kernel_cache import cache_folder, load_module
from segar.engine.simulator import Simulator, StepResult
from segar.errors import SegarError
from segar.language.effects import SetFactor
from segar.language.factors import Mass
from segar.language.rule_definition import rule
from segar.levels.named_families import family
from segar.rules import DEFAULT_RULES, move
from segar.rules.world import World
from segar.tasks.puttputt_task import puttputt
from tests.segar.engine.worlds import start

LAYOUT = family("empty-hard").layout


def source(rules, layout=LAYOUT, **task):
    return generate(layout, World(rules), puttputt(**task).functions()).text


def shrink_by(rate):
    def shrink(m: Mass) -> SetFactor[Mass]:
        return SetFactor[Mass](m, m * rate)

    return rule(shrink)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty cache, of which this process remembers nothing."""
    monkeypatch.setenv("SEGAR_CACHE_DIR", str(tmp_path / "kernels"))
    monkeypatch.setattr(cache, "_loaded", {})
    return tmp_path / "kernels"


def test_equal_worlds_have_equal_sources():
    assert source([move, shrink_by(0.5)]) == source([move, shrink_by(0.5)])
    assert source(DEFAULT_RULES) == source(DEFAULT_RULES)


def test_an_edited_rule_gives_another_source():
    texts = [source([move, shrink_by(rate)]) for rate in (0.5, 0.25)]
    texts += [source([move]), source([move], impulse=3.0)]
    assert len(set(texts)) == 4


def test_all_difficulties_of_a_family_share_a_source():
    texts = {source(DEFAULT_RULES, family(f"objectsx2-{name}").layout) for name in ("easy", "medium", "hard")}
    assert len(texts) == 1


def test_a_second_level_set_or_another_batch_compiles_nothing(sampled, capsys):
    simulator, levels = sampled("empty-hard")
    simulator.act(start(levels), levels, np.zeros((len(levels), 2), np.float32), StepResult.empty(len(levels)))
    compiled = simulator._module.advance
    capsys.readouterr()
    before = len(compiled.signatures), sum(compiled.stats.cache_misses.values())
    others = family("empty-easy").sample(7, seed=99, split="test")
    again = Simulator(World(), others.layout)
    again.act(start(others, 3), others, np.zeros((21, 2), np.float32), StepResult.empty(21))
    again.step(start(others), others, 3)
    assert again._module is simulator._module
    assert (len(compiled.signatures), sum(compiled.stats.cache_misses.values())) == before
    assert capsys.readouterr().err == ""


def test_the_same_text_is_one_file_and_one_module(folder, capsys):
    module = load_module("answer = 42\n")
    assert load_module("answer = 42\n") is module and module.answer == 42
    assert load_module("answer = 43\n").answer == 43
    assert len(list(folder.glob("*.py"))) == 2
    assert {path.name for path in folder.iterdir() if path.suffix != ".py"} <= {"__pycache__"}
    assert capsys.readouterr().err.count("segar: compiling kernel") == 2


def test_an_edited_or_damaged_kernel_file_is_written_again(folder, monkeypatch):
    path = load_module("answer = 42\n").__file__
    with open(path, "w") as file:
        file.write("answer = 0\n")
    monkeypatch.setattr(cache, "_loaded", {})
    assert load_module("answer = 42\n").answer == 42


def test_a_cache_that_cannot_be_written_says_what_to_do(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("SEGAR_CACHE_DIR", str(tmp_path / "file" / "kernels"))
    with pytest.raises(SegarError, match=r"the kernel cannot be written to .*; set SEGAR_CACHE_DIR to a folder that"):
        load_module("answer = 44\n")


def test_the_cache_follows_the_user_s_folders(monkeypatch, tmp_path):
    monkeypatch.delenv("SEGAR_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "segar" / "kernels"
