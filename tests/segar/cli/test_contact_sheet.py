"""Contact sheets, and the commands that draw and play."""

import json

import imageio.v3 as imageio
import numpy as np
import pytest

import segar
from segar import cli
from segar.cli.gallery import PEOPLE, contact_sheet, default_renderers, draw_level, save_png
from segar.observations.pixels.solid_colours import Pixels
from segar.textures import shipped_sets

LEVELS = segar.family("objectsx3-hard").sample(2, seed=0)


WAYS = {"colours": Pixels(32)}


@pytest.fixture(scope="module")
def small_sheet():
    return contact_sheet(renderers=WAYS)


def test_the_sheet_shows_every_family_and_task(small_sheet):
    assert small_sheet.dtype == np.uint8
    # Eleven rows of three pictures: all hold more than floor and paper, and no two are the same.
    floor = (small_sheet == (72, 72, 72)).all(axis=2)
    rows, columns = (np.flatnonzero(floor.any(axis=axis)) for axis in (1, 0))
    assert (np.diff(rows) > 1).sum() == 10 and (np.diff(columns) > 1).sum() == 2


def test_the_same_seed_draws_the_same_sheet(small_sheet):
    assert (contact_sheet(0, WAYS) == small_sheet).all()
    assert (contact_sheet(1, WAYS) != small_sheet).any()


def test_pictures_of_observations_are_the_observations_enlarged():
    env = segar.envs.VectorEnv(LEVELS, 1, observation=Pixels(32), seed=0)
    observations, _ = env.reset(options={"levels": np.zeros(1, np.int64)})
    drawn = draw_level(LEVELS, Pixels(32))
    assert (drawn[::4, ::4] == observations[0]).all() and (drawn[3::4, 3::4] == observations[0]).all()


def test_every_kind_of_textures_that_is_shipped_is_shown():
    titles = list(default_renderers())
    assert titles[:2] == ["for people", "solid colours"]
    assert ("auto-encoder" in titles) == ("one" in shipped_sets())
    for renderer in default_renderers().values():
        assert draw_level(LEVELS, renderer).shape == (128, 128, 3)


def test_a_picture_is_written_as_it_is(tmp_path):
    picture = draw_level(LEVELS, PEOPLE)
    save_png(picture, tmp_path / "all.png")
    assert (imageio.imread(tmp_path / "all.png") == picture).all()


def test_the_command_draws_sheets(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("segar.cli.gallery.contact_sheet", lambda seed: draw_level(LEVELS[seed], PEOPLE))
    assert cli.main(["gallery", "-o", str(tmp_path / "sheet.png"), "--json", "--seed", "1"]) == 0
    assert json.loads(capsys.readouterr().out) == {"file": str(tmp_path / "sheet.png"), "width": 128, "height": 128}
    assert cli.main(["gallery", "-o", str(tmp_path / "signs.png"), "--signs"]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'signs.png'}: 768 x 816 pixels\n"


def test_the_command_plays_the_levels_that_were_asked_for(capsys, monkeypatch):
    from segar.cli.game import Game

    played = []

    def run(self):
        played.append((self.level, len(self.env.levels), self.env.task.max_steps, self.view.size, self.speed))

    monkeypatch.setattr(Game, "run", run)
    command = ["play", "empty-hard", "-n", "5", "--level", "3", "--steps", "70", "--size", "300", "--speed", "0.5"]
    assert cli.main(command) == 0
    assert played == [(3, 5, 70, 300, 0.5)] and capsys.readouterr().out == "0 episodes, 0 successes\n"
