"""The commands on levels: sample, distance, describe and hardness; for people, for programs, and refused."""

import importlib.util
import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import segar
from segar import cli
from segar.cli import figures
from segar.hardness import Plan, replay


def shown(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """What the command prints with these arguments."""
    assert cli.main(list(map(str, arguments))) == 0
    return capsys.readouterr().out


@pytest.fixture
def level_files(tmp_path: Path) -> tuple[Path, Path]:
    """Files of 12 levels each, of two families of one layout, in both formats."""
    paths = tmp_path / "empty-easy.json", tmp_path / "empty-hard.npz"
    for path in paths:
        segar.family(path.stem).sample(12, seed=1).save(path)
    return paths


@pytest.mark.parametrize("suffix", ["npz", "json"])
def test_sample_writes_the_levels_that_the_library_samples(capsys, tmp_path, suffix):
    path = tmp_path / f"levels.{suffix}"
    said = shown(capsys, "sample", "objectsx3-hard", "-n", 7, "--seed", 3, "--split", "test", "-o", path)
    assert said == f"{path}: 7 levels of 'objectsx3-hard', seed 3, split 'test'\n"
    assert path.read_bytes().startswith(b"{") == (suffix == "json")
    assert segar.Levels.load(path) == segar.family("objectsx3-hard").sample(7, seed=3, split="test")
    said = json.loads(shown(capsys, "sample", "objectsx3-hard", "-n", 2, "--split", "test", "-o", path, "--json"))
    assert said["levels"] == len(segar.Levels.load(path)) == 2 and said["split"] == "test"
    assert said["distribution"] == segar.family("objectsx3-hard").hash


def test_distance_says_what_the_library_measures(capsys, level_files):
    a, b = map(segar.Levels.load, level_files)
    said = json.loads(shown(capsys, "distance", *level_files, "--json"))
    assert said["w2"] == segar.metrics.w2(a, b) and said["ks"] == segar.metrics.ks(a, b)
    assert said["ks_by_factor"] == segar.metrics.ks_by_factor(a, b) and said["levels"] == [12, 12]
    assert list(said["ks_by_factor"].values()) == sorted(said["ks_by_factor"].values(), reverse=True)
    text = shown(capsys, "distance", *level_files)
    assert f"w2       {said['w2']:.4g}\n" in text and "GolfBall.Position.x" in text
    said = json.loads(shown(capsys, "distance", *level_files, "--mode", "reference", "--json"))
    assert said["w2"] == segar.metrics.w2(a, b, "reference")


def test_distance_tests_for_one_law_when_asked(capsys, level_files):
    said = json.loads(shown(capsys, "distance", *level_files, "--resamples", 19, "--json"))
    assert said["w2_95"][0] < said["w2"] < said["w2_95"][1] and said["w2_floor"] < said["w2"]
    assert said["w2_p_value"] == said["ks_p_value"] == 1 / 20


def test_describe_lists_every_marginal(capsys):
    said = json.loads(shown(capsys, "describe", "tilesx1-medium", "--json"))
    laws = segar.family("tilesx1-medium").marginals()
    expected = [(slot, factor.__name__, repr(law)) for slot in laws for factor, law in laws[slot].items()]
    rows = [(row["entity"], row["factor"], row["law"]) for row in said["marginals"]]
    assert [row for row in rows if row[1] != "Shape"] == expected
    shapes = [("golfball", "Circle(0.2)"), ("goal", "Circle(0.4)"), ("tile1", "RandomConvexHull(0.3)")]
    assert [(entity, law) for entity, factor, law in rows if factor == "Shape"] == shapes
    (heat,) = (row for row in said["marginals"] if (row["entity"], row["factor"]) == ("tile1", "Heat"))
    assert (heat["mean"], heat["low"], heat["high"]) == pytest.approx((0.525, 0.5, 0.55))
    assert heat["sd"] == pytest.approx(0.05 / 12**0.5)
    types = ["SandTile", "MagmaTile", "Hole", "FireTile"]
    equal = {"types": types, "probabilities": [0.25] * 4, "optional": False, "there": 1.0}
    assert said["entities"]["tile1"] == equal
    text = shown(capsys, "describe", "tilesx1-medium")
    shared = "\n\ntwo draws are the same level with probability 0 (+- 0); a level is one of 200 others with 0 (+- 0)\n"
    assert text.endswith(shared)
    assert text.count("\n") == len(rows) + 1 + 1 + len(said["entities"]) + 1 + 2
    assert "UniformNoise(0.5, 0.55)" in text and "SandTile 0.25 | MagmaTile 0.25 | Hole 0.25" in text


@pytest.mark.parametrize("width", [30, 80])
def test_a_narrow_terminal_gets_shorter_lines_of_the_same_words_and_numbers(capsys, monkeypatch, width):
    """Nothing is broken within a word; without a terminal, lines are as long as they are."""
    calls = (["describe", "tilesx1-hard"], ["suites"], ["describe", "empty-easy"])
    for call in calls:
        monkeypatch.delenv("COLUMNS", raising=False)
        whole = shown(capsys, *call)
        monkeypatch.setenv("COLUMNS", str(width))
        narrow = shown(capsys, *call)
        assert Counter(narrow.split()) == Counter(whole.split()) and max(map(len, whole.split("\n"))) > width
        assert all(len(line) <= width or not line.strip().count(" ") for line in narrow.split("\n"))


def test_describe_shows_numbers_types_shapes_and_what_depends_on_something_else(capsys, tmp_path, monkeypatch):
    (tmp_path / "crowd.py").write_text(
        "import segar\n"
        "def weight(size: segar.Size) -> float: return 25 * size**2\n"
        "numbers = [(segar.GolfBall, 1), (segar.ThingFactory({segar.Charger: 0.3, segar.Magnet: 0.7}), 1)]\n"
        "numbers += [(segar.Ball, segar.DiscreteRangeNoise(1, 4)), (segar.GoalTile, 1)]\n"
        "priors = [segar.Prior(segar.Position, segar.RandomUniformLocation())]\n"
        "priors += [segar.Prior(segar.Size, segar.UniformNoise(0.1, 0.2), entity_type=segar.Ball)]\n"
        "heavy = segar.levels.Dependent(segar.UniformNoise(0.9, 1.1), scale=weight)\n"
        "priors += [segar.Prior(segar.Mass, heavy, entity_type=segar.Ball)]\n"
        "priors += [segar.Prior(segar.Shape, segar.noise.Choice([segar.Circle(0.2), segar.language.Square(0.2)]), entity_type=segar.Magnet)]\n"  # noqa: E501
        "class Twice(segar.noise.Noise):\n"  # which says nothing but its draws
        "    def sample(self, rng, size=None): return 2 * rng.uniform(0.5, 1.0, size)\n"
        "priors += [segar.Prior(segar.Charge, Twice(), entity_type=segar.Ball)]\n"
        "dist = segar.LevelDistribution(numbers, priors)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    said = json.loads(shown(capsys, "describe", "crowd:dist", "-o", tmp_path / "figure.svg", "--json"))
    assert [said["entities"][f"ball{k}"]["there"] for k in (1, 2, 3, 4)] == [1.0, 0.75, 0.5, 0.25]
    assert said["entities"]["object1"]["probabilities"] == [0.3, 0.7]
    rows = {(row["entity"], row["factor"]): row for row in said["marginals"]}
    mass = rows["ball2", "Mass"]
    assert mass["law"].startswith("depends on Size; drawn: Empirical(<")
    assert mass["mean"] == pytest.approx(25 * (0.15**2 + 0.1**2 / 12), rel=0.02) and mass["low"] >= 0.9 * 25 * 0.1**2
    assert rows["object1", "Shape"]["law"] == "Choice((Circle(0.2), Square(0.2)), (0.5, 0.5))"
    assert (rows["ball1", "Charge"]["law"], rows["ball1", "Charge"]["mean"]) == ("Twice()", None)
    assert "svg" in (tmp_path / "figure.svg").read_text()


def test_names_in_a_row_that_count_on_are_said_by_their_ends():
    assert figures.together(["cueball", *(f"ball{k}" for k in range(1, 11))]) == "cueball, ball1 to ball10"
    assert figures.together(["ball1", "ball2", "ball4", "x9", "x10", "x11"]) == "ball1, ball2, ball4, x9 to x11"


def test_a_figure_without_matplotlib_names_the_extra(capsys, tmp_path, monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "matplotlib" else find(name))
    assert cli.main(["describe", "empty-hard", "-o", str(tmp_path / "figure.png")]) == 2
    out, err = capsys.readouterr()
    assert out == "" and "pip install 'segar[analysis]'" in err and not list(tmp_path.iterdir())


def test_hardness_says_who_solves_what_and_writes_a_plan_that_replays(capsys, level_files):
    path = level_files[1].with_name("plan.npz")
    arguments = ["hardness", level_files[1], "--plays", 5, "--samples", 16, "--iterations", 1]
    said = json.loads(shown(capsys, *arguments, "--factors", "-o", path, "--json"))
    assert said["oracle_success"] == said["scripted_success"] == 1.0 and len(said["per_level"]) == 12
    kinds = {(entry["entity"], entry["factor"]): entry["kind"] for entry in said["factors"]}
    assert kinds["golfball", "Velocity"] == "endogenous" and kinds["goal", "Position"] == "constant"
    levels, plan = segar.Levels.load(level_files[1]), Plan.load(path)
    assert replay(levels, plan).all()
    assert [row["oracle_steps"] for row in said["per_level"]] == plan.steps.tolist()
    text = shown(capsys, *arguments)
    assert "oracle_success       1\n" in text and text.splitlines()[0].startswith("level  random_success")
    assert json.loads(shown(capsys, *arguments, "--json"))["oracle_return"] == np.mean(plan.returns)


def test_rules_that_a_level_file_only_names_are_asked_for(capsys, tmp_path):
    free = segar.family("empty-hard").with_rules([segar.move])
    free.sample(2).save(tmp_path / "free.npz")
    assert cli.main(["hardness", str(tmp_path / "free.npz")]) == 2
    said = capsys.readouterr().err
    assert "these levels have rules of their own" in said and "give them by --world" in said
    assert cli.main(["hardness", str(tmp_path / "free.npz"), "--world", "segar:GolfBall"]) == 2
    assert "'segar:GolfBall' is no World, LevelDistribution, RuleSpace or list of rules" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["sample", "distance", "describe", "hardness", "compile", "families", "kernel"])
def test_every_command_explains_itself(capsys, command):
    with pytest.raises(SystemExit) as left:
        cli.main([command, "--help"])
    assert left.value.code == 0 and f"usage: segar {command}" in capsys.readouterr().out
