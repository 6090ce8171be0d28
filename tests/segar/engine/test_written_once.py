"""A kernel's source is written once for what is alike, and anew for whatever differs."""

from dataclasses import replace

import pytest

import segar
from segar.engine.compiler.kernel import generate
from segar.language import Mass, SetFactor

LAYOUT = segar.family("empty-easy").sample(1, seed=0).layout
FACTOR = 2.0


def grow(mass: Mass) -> SetFactor[Mass]:
    return SetFactor[Mass](mass, FACTOR * mass)


def weight(ball: segar.GolfBall) -> float:
    return FACTOR * ball[Mass] if ball[Mass] > 1.0 else 0.0


def test_the_same_world_and_task_have_one_source_whoever_makes_them():
    one = generate(LAYOUT, segar.World(), segar.puttputt().functions())
    assert generate(LAYOUT, segar.World(), segar.puttputt().functions()) is one
    assert generate(LAYOUT, segar.World(), segar.puttputt(impulse=3.0).functions()).text != one.text
    assert generate(LAYOUT, segar.World(walls=2.0), segar.puttputt().functions()).text != one.text


@pytest.mark.parametrize("name", ["grow", "weight"])
def test_a_function_that_reads_another_number_since_has_another_source(monkeypatch, name):
    def source() -> str:
        world = segar.World([grow] if name == "grow" else [segar.move])
        task = replace(segar.puttputt(), reward=weight) if name == "weight" else segar.puttputt()
        return generate(LAYOUT, world, task.functions()).text

    before = source()
    monkeypatch.setitem(globals(), "FACTOR", 3.0)
    assert "3.0" in source() and source() != before
    monkeypatch.setitem(globals(), "FACTOR", 2.0)
    assert source() == before
