"""``segar playground`` makes the page that the library makes, and says in one line what it cannot use."""

import json
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import segar
from segar import cli
from segar.observations import StateVector
from segar.playground import make_playground, read_policy, read_row_policy
from segar.policies import Network
from tests.segar.playground.test_policies import perceptron

CONFIG = "observation:\n  name: state\n  options:\n    normalise: true\n"
FIELD = """
import dataclasses
import segar
from segar.observations import StateVector

class Uplift(segar.Parameter, default=0.0):
    "How much the air rises."

def height(ball: segar.GolfBall) -> float:
    return ball[segar.Position][1]

def landing(max_steps: int = 7) -> segar.Task:
    return dataclasses.replace(segar.puttputt(max_steps=max_steps), name="landing", reward=height)

field = dataclasses.replace(
    segar.family("empty-hard"), name="field", task="my_field:landing", parameters={Uplift: segar.UniformNoise(0.0, 2.0)}
).with_rules([segar.rules.move])
seeing = StateVector(parameters=["Uplift"], normalise=True)
"""
OWN = "observation:\n  name: my_lab.seeing:look\n"


def shown(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """What the command prints with these arguments."""
    assert cli.main(["playground", *map(str, arguments)]) == 0
    return capsys.readouterr().out


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """What the command says against these arguments."""
    assert cli.main(["playground", *map(str, arguments)]) == cli.USAGE_ERROR
    out, error = capsys.readouterr()
    error = "".join(line for line in error.splitlines(keepends=True) if not line.startswith("segar: compiling"))
    assert out == "" and error.count("\n") == 1 and not Path("page.html").exists()
    return error


def page(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The page that the command writes; it is taken away, so that a refusal is seen to write none."""
    shown(capsys, *arguments, "-o", "page.html")
    text = Path("page.html").read_text()
    Path("page.html").unlink()
    return text


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A run folder as training and a portable evaluation leave it, in the working folder."""
    monkeypatch.chdir(tmp_path)
    levels = segar.family("empty-hard").sample(5, seed=1)
    folder = tmp_path / "run"
    network = perceptron(StateVector(normalise=True), levels)
    for age, name in enumerate(("test-n5-portable", "train-n5-portable")):
        (folder / "evaluations" / name).mkdir(parents=True)
        place = folder / "evaluations" / name / "network.npz"
        replace(network, log_std_range=(-3.0, float(age))).save(place)
        os.utime(place, (age, age))
    (folder / "config.yaml").write_text(CONFIG)
    levels.save(folder / "levels_train.npz")
    return folder


@pytest.fixture
def flight(run: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[segar.LevelDistribution, StateVector]:
    """A distribution with a parameter, a task and rules of its own, which the run was trained on; and what the run observed."""
    monkeypatch.syspath_prepend(Path.cwd())
    monkeypatch.delitem(sys.modules, "my_field", raising=False)
    Path("my_field.py").write_text(FIELD)
    import my_field

    train = my_field.field.sample(5, seed=1)
    train.save(run / "levels_train.npz")
    seen = my_field.seeing.trained_on(train)
    for place in run.glob("evaluations/*/network.npz"):
        perceptron(seen, train).save(place)
    (run / "config.yaml").write_text(
        "observation: {name: state, options: {parameters: [Uplift], normalise: true}}\n"
        "task: {name: levels, options: {max_steps: 9}}\n"
    )
    return my_field.field, seen


def test_the_page_is_that_of_the_library(capsys, tmp_path):
    page = tmp_path / "page.html"
    said = json.loads(
        shown(capsys, "empty-easy", "-n", 3, "--seed", 2, "--test", "empty-hard", "--observation", "state",
              "-o", page, "--json")
    )  # fmt: skip
    easy, hard = segar.family("empty-easy"), segar.family("empty-hard")
    made = make_playground(easy.sample(3, seed=2), hard.sample(3, seed=2, split="test"), observations=("state",))
    assert page.read_text() == made.html
    assert (said["file"], said["bytes"], said["levels"]) == (str(page), page.stat().st_size, 3)
    assert said["test_levels"] == 3 and said["seconds"] > 0
    easy.sample(4, seed=2).save(tmp_path / "levels.npz")
    shown(capsys, tmp_path / "levels.npz", "-n", 3, "--observation", "state", "-o", page)
    expected = make_playground(segar.Levels.load(tmp_path / "levels.npz")[:3], observations=("state",))
    assert page.read_text() == expected.html


@pytest.mark.slow
def test_a_run_folder_gives_its_newest_network_and_what_it_observes(capsys, run):
    said = shown(capsys, "empty-easy", "-n", 3, "--policy", run, "-o", "page.html")
    newest = run / "evaluations" / "train-n5-portable" / "network.npz"
    assert f"the policy in {newest} (float32)" in said
    seen = StateVector(normalise=True).trained_on(segar.Levels.load(run / "levels_train.npz"))
    levels, options = segar.family("empty-easy").sample(3), {"observations": {"state": seen}}
    options["policy"] = Network.load(newest)
    assert Path("page.html").read_text() == make_playground(levels, **options).html
    found = page(capsys, "empty-easy", "-n", 3, "--policy", newest.parent, "--weights", "float16")
    assert found == make_playground(levels, **options, weights="float16").html


def test_a_page_plays_the_task_of_the_run_in_its_units(capsys, run, flight):
    """Also what the run names of its own: the levels bring it, and nothing is imported for the run."""
    field, seen = flight
    player, task = perceptron(seen, field.sample(5, seed=1)), sys.modules["my_field"].landing(max_steps=9)
    levels, base = field.sample(3), ("my_field:field", "-n", 3, "--policy", run)
    found = page(capsys, *base)
    assert found == make_playground(levels, policy=player, observations={"state": seen}, task=task).html
    (run / "config.yaml").write_text(
        "observation: {name: my_lab.seeing:look}\ntask: {name: 'my_field:landing', options: {max_steps: 9}}\n"
    )
    expected = make_playground(levels, policy=player, observations={"my_field:seeing": seen}, task=task).html
    for name in ("my_field:field", "my_field.py:field"):  # a file and a module may name the same thing
        assert page(capsys, name, *base[1:], "--observation", "my_field:seeing") == expected
    (run / "config.yaml").write_text("observation: {name: state}\ntask: {name: 'my_field:other'}\n")
    why = "the task 'my_field:other' is not built in, and a file imports no code; give it by task= or --task"
    assert why in refused(capsys, *base, "-o", "page.html")
    (run / "config.yaml").write_text("observation: {name: state}\ntask: {name: levels, options: {near: 3}}\n")
    why = "'my_field:landing' is called with near, and got an unexpected keyword argument 'near'"
    assert why in refused(capsys, *base, "-o", "page.html")


def test_probes_of_a_run_are_in_its_page(capsys, run, flight):
    import pandas as pd

    columns = ["levels", "representation", "probe", "quantity", "factor", "estimate", "low", "high"]
    rows = [
        ("test", "trained", "ridge", "r2", "goal.Position.x", 0.9, 0.8, 0.95),
        ("test", "trained", "ridge", "r2", "ball.Mass", np.nan, np.nan, np.nan),  # it is the same in all levels
        ("train", "trained", "ridge", "r2", "goal.Position.x", 1.0, 1.0, 1.0),
        ("test", "identity", "ridge", "r2", "goal.Position.x", 1.0, 1.0, 1.0),
        ("test", "trained", "ridge", "information", "goal.Position.x", 2.0, 1.9, 2.1),
    ]
    pd.DataFrame(rows, columns=columns).to_parquet(run / "probes.parquet")
    levels = flight[0].sample(3)
    found = read_policy(run, levels)
    assert found.probes == {"goal.Position.x": (0.9, 0.8, 0.95)}
    options = {"policy": found.network, "observations": found.observations, "task": found.task}
    base = ("my_field:field", "-n", 3, "--policy", run)
    made = page(capsys, *base)
    assert made == make_playground(levels, probes=found.probes, **options).html
    base += ("-o", "page.html")
    pd.DataFrame(rows, columns=columns).drop(columns="low").to_parquet(run / "probes.parquet")
    assert "cannot read the table of probes" in refused(capsys, *base)
    (run / "probes.parquet").write_bytes(b"PAR1")
    assert "cannot read the table of probes" in refused(capsys, *base)
    pd.DataFrame(rows * 30_000, columns=columns).to_parquet(run / "probes.parquet")
    assert "has 150,000 rows, and a table of probes 100,000 at most" in refused(capsys, *base)


def row_of(suite: segar.suites.Suite, folder: Path, player: Network, seed: int = 3) -> Path:
    """A row of the benchmark with a network for a suite."""
    folder.mkdir()
    piece = {"suite": suite.name, "suite_hash": suite.hash, "seed": seed, "file": "player.npz"}
    (folder / "row.json").write_text(
        json.dumps(
            {
                "kind": "networks",
                "settings": {"observation": {"name": "rgb" if suite.textures else "state"}},
                "pieces": [piece],
            }
        )
    )
    player.save(folder / "player.npz")
    return folder


@pytest.mark.slow
def test_a_row_on_its_suite_is_a_match_in_the_units_and_with_the_levels_of_its_training(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    of = segar.suites.suite("place-few-v1")
    train, seen = of.sample(3), StateVector()
    player = perceptron(seen, train)
    row = row_of(of, tmp_path / "row", player)
    options = {"task": of.task, "policy": player, "plans": True, "match": of.says}
    expected = make_playground(train[:2], of.test_levels[:2], observations={"state": seen.trained_on(train)}, **options)
    assert page(capsys, of.name, "--policy", row, "-n", 2) == expected.html
    far = segar.suites.suite("look-far-v1")
    found = read_row_policy(row_of(far, tmp_path / "far", player), far)
    sides = (found.observations, found.test_observations)
    assert [side["rgb"].textures for side in sides if side] == list(far.textures)
    base = ("place-few-v1", "-o", "page.html", "--policy")
    assert "has no network of place-few-v1, and has look-far-v1; take another row" in refused(capsys, *base, "far")
    assert "Did you mean 'ppo_fast-state-laptop'?" in refused(capsys, *base, "ppo_fast-state-lap")
    (row / "row.json").write_text((row / "row.json").read_text().replace(of.hash, far.hash))
    assert "was trained on another version of the suite" in refused(capsys, *base, row)
    (row / "row.json").write_text("[]")
    assert "row.json: 'all' must be a mapping" in refused(capsys, *base, row)


@pytest.mark.parametrize(("row", "has"), [("imitation", "actions"), ("tqc", "onnx"), ("planner", "player")])
def test_a_row_without_networks_makes_no_match_and_says_what_it_has(capsys, row, has, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = refused(capsys, "place-few-v1", "-o", "page.html", "--policy", row)
    assert f"{row}/row.json has no network of place-few-v1, and has '{has}' alone; take another row" in said


def test_what_cannot_be_used_is_said_in_one_line(capsys, run, tmp_path):
    base = ("empty-easy", "-n", 2, "-o", "page.html")
    network_file = run / "evaluations" / "train-n5-portable" / "network.npz"
    other = ("objectsx1-hard", *base[1:], "--policy", network_file, "--observation", "state")
    assert "reads float32 of shape" in refused(capsys, *other)
    assert "there is no nothing.npz" in refused(capsys, *base, "--policy", "nothing.npz")
    network_file.write_bytes(network_file.read_bytes()[:200])
    assert f"{network_file}" in refused(capsys, *base, "--policy", run)
    (run / "config.yaml").write_text(OWN)
    perceptron(StateVector()).save(network_file)
    assert "'my_lab.seeing:look'" in (said := refused(capsys, *base, "--policy", run))
    assert "a file imports no code" in said and "; say what the policy reads by --observation" in said
    (run / "config.yaml").write_text("- !!python/object:os.system x\n")
    assert "config.yaml is not a file of settings" in refused(capsys, *base, "--policy", run)
    (tmp_path / "bare").mkdir()
    assert "segar evaluate run=bare portable=true" in refused(capsys, *base, "--policy", "bare")
    assert "levels.npz" in refused(capsys, "levels.npz", "-o", "page.html")
    np.savez("levels.npz", x=np.zeros(3))
    assert "levels.npz" in refused(capsys, "levels.npz", "-o", "page.html")
    segar.family("empty-easy").sample(2).save("levels.npz")
    Path("windy.py").touch()
    assert "name the distribution in it, as windy.py:NAME" in refused(capsys, "windy.py", "-o", "page.html")
    assert "holds 2 levels, not 3" in refused(capsys, "levels.npz", "-n", 3, "-o", "page.html")
    assert "only level files need a world" in refused(capsys, *base, "--world", "x:y")
    assert "at most 2,000 levels" in refused(capsys, "empty-easy", "-n", 2001, "-o", "page.html")
    assert "no observation is called 'rgbb'" in refused(capsys, *base, "--observation", "rgbb")
