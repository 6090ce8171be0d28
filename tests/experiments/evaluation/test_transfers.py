"""An agent is tested where it was not trained: other levels, other physics, another look."""

import dataclasses
import importlib
import json
import shutil
import sys

import pytest

from segar import World
from segar.envs import world_of
from segar.experiments.evaluation.transfer_evaluation import evaluate_transfer
from segar.experiments.evaluation.transfers import FactorSwap, RunTask, Transfer
from segar.experiments.levels.builders import distribution_of
from segar.experiments.reproduce import carry_out
from segar.experiments.runs.run_folder import CHECKPOINT, folder_path, read_evaluation, read_summary
from segar.experiments.settings import ObservationConfig, PPOConfig
from segar.experiments.training.run import run
from tests.experiments.short_runs import short_run

STATE = ObservationConfig("state")


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    config = short_run(tmp_path_factory.mktemp("runs") / "run")
    levels = dataclasses.replace(config.levels, test_count=2 * config.levels.count)
    # As many episodes on training levels as on test levels: in batches of another size, matrix products round otherwise.
    evaluation = dataclasses.replace(config.evaluation, episodes=levels.test_count)
    algorithm = PPOConfig(num_envs=8, num_steps=8, widths=(8,))
    config = dataclasses.replace(config, levels=levels, evaluation=evaluation, algorithm=algorithm)
    run(config, say=lambda line: None)
    return config


def test_what_comes_of_it_lies_in_the_run_folder(trained):
    transfer = Transfer("empty-medium", "empty-medium", "", STATE, test_count=5)
    assert not RunTask(trained, (transfer,)).is_done()
    summary = evaluate_transfer(trained, transfer, say=lambda line: None)
    assert RunTask(trained, (transfer,)).is_done()
    assert summary["transfer"]["panel"] == "empty-medium" and summary["frames"] == 256
    assert {"w2/exact", "ks", "evaluation/test/return/sampled", "evaluation/test/success/deterministic"} <= {*summary}
    assert transfer.folder(trained).parent.parent == folder_path(trained)
    assert (transfer.folder(trained) / "episodes.parquet").exists()


def test_a_transfer_of_other_weights_than_the_runs_is_to_be_made_anew(trained):
    transfer = Transfer("other weights", "empty-medium", "", STATE, test_count=2)
    evaluate_transfer(trained, transfer, say=lambda line: None)
    path = transfer.folder(trained) / "summary.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "frames": 64}))
    assert not transfer.is_done(trained)
    assert RunTask(trained, (transfer,)).transfers_left() == [transfer]


def test_the_same_levels_give_what_the_run_itself_gave(trained):
    own = Transfer("own", "empty-easy", "", STATE, test_count=trained.levels.test_count)
    summary, of_run = evaluate_transfer(trained, own, say=lambda line: None), read_summary(folder_path(trained))
    shared = [key for key in summary if key.startswith(("evaluation/", "w2/", "ks"))]
    assert len(shared) > 10
    assert {key: summary[key] for key in shared} == {key: of_run[key] for key in shared}


def test_another_physics_is_another_result_at_the_same_distance_in_positions(trained):
    plain = Transfer("own", "empty-easy", "", STATE, test_count=5)
    heavy = Transfer("friction", "empty-easy", "friction_0.8", STATE, test_count=5)
    a, b = (evaluate_transfer(trained, one, say=lambda line: None) for one in (plain, heavy))
    assert a["evaluation/test/return/deterministic"] != b["evaluation/test/return/deterministic"]
    assert b["w2/exact"] > a["w2/exact"]


@pytest.mark.parametrize(("changed", "levels"), [(("position", "rest"), "test"), ((), "train")])
def test_levels_in_between_end_in_those_of_training_and_of_the_test(trained, changed, levels):
    mixture = FactorSwap({"position": ["Position"]}, changed)
    between = Transfer("between", "empty-easy", "", STATE, test_count=trained.levels.test_count, mixture=mixture)
    summary, of_run = evaluate_transfer(trained, between, say=lambda line: None), read_summary(folder_path(trained))
    name = "evaluation/{}/return/deterministic"
    assert summary[name.format("test")] == pytest.approx(of_run[name.format(levels)], abs=1e-9)


def test_levels_in_between_have_the_rules_of_training_or_of_the_test_as_their_group_says(trained):
    config = dataclasses.replace(
        trained,
        levels=dataclasses.replace(trained.levels, test_variation="frictionless"),
        folder=trained.folder + "-rules",
    )
    run(config, say=lambda line: None)
    worlds = [distribution_of(config.levels, which).world for which in ("train", "test")]
    for changed, world in (((), worlds[0]), (("rest",), worlds[0]), (("rules",), worlds[1])):
        between = Transfer("x", "empty-easy", "", STATE, mixture=FactorSwap({"rules": ["World"]}, changed))
        rules = [rule.where for rule in world_of(between.levels(config)).rules]
        assert rules == [rule.where for rule in (world or World()).rules]


def test_the_folder_is_named_by_what_is_tested_and_not_by_who_asks():
    a, b = (Transfer(label, "empty-easy", "", STATE) for label in ("a", "b"))
    assert a.folder_name().split("-")[-1] == b.folder_name().split("-")[-1]
    mixtures = [FactorSwap({"a": [factor]}, ("a",)) for factor in ("Position", "Size")]
    others = [dataclasses.replace(a, test_count=7), *(dataclasses.replace(a, mixture=one) for one in mixtures)]
    assert len({one.folder_name() for one in (a, *others)}) == 4


STORM = """import json
from pathlib import Path
import segar

LOW = json.loads((Path(__file__).parent / "low.json").read_text())


def storm():
    return segar.LevelDistribution(
        numbers=[(segar.GolfBall, 1), (segar.GoalTile, 1)],
        priors=[
            segar.Prior(segar.Position, segar.RandomUniformLocation()),
            segar.Prior(segar.Mass, segar.UniformNoise(LOW, 2.0), entity_type=segar.GolfBall),
        ],
    )
"""


@pytest.fixture
def storms(tmp_path, monkeypatch):
    """The folder of a module ``storms`` of the user's own, and of the data that it reads."""
    (tmp_path / "storms.py").write_text(STORM)
    (tmp_path / "low.json").write_text("1.0")
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    sys.modules.pop("storms", None)


def edited(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    sys.modules.pop("storms", None)
    importlib.invalidate_caches()
    shutil.rmtree(path.parent / "__pycache__", ignore_errors=True)


@pytest.mark.parametrize(
    ("file", "old", "new", "parts"),
    [
        ("storms.py", "2.0", "3.0", ["levels", "./storms.py"]),
        ("low.json", "1.0", "1.5", ["levels", "./low.json"]),
        ("storms.py", "def storm", "# Strong.\ndef storm", []),
    ],
    ids=["code", "data", "comment"],
)
def test_a_transfer_to_levels_of_edited_code_is_known_as_one_of_other_code(trained, storms, file, old, new, parts):
    transfer = Transfer("storm", "storms:storm", "", STATE, test_count=5)
    summary = evaluate_transfer(trained, transfer, say=lambda line: None)
    assert not transfer.changed_parts(trained, transfer.code(trained))
    edited(storms / file, old, new)
    assert transfer.changed_parts(trained, transfer.code(trained)) == parts
    anew = RunTask(
        dataclasses.replace(trained, stale="anew"), (transfer,), retested=frozenset([transfer.folder_name()])
    )
    weights = (folder_path(trained) / CHECKPOINT).stat()
    carry_out(anew)
    assert (folder_path(trained) / CHECKPOINT).stat() == weights
    assert not transfer.changed_parts(trained, transfer.code(trained))
    if parts:
        assert (read_evaluation(transfer.folder(trained)) or {})["w2/exact"] != summary["w2/exact"]
