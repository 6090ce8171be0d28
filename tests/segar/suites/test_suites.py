"""Suites: what is frozen stays what it was, and what is compared on it is fit for comparisons."""

import dataclasses
import pickle
import shutil

import numpy as np
import pytest

import segar
from segar import Mass, Position, suites
from segar.errors import SuiteError
from segar.levels import hash_of_levels
from segar.suites import AXES, Suite, admission, freeze, read_suite
from segar.suites.suite_file import ITERATIONS, SAMPLES, hash_of_plans
from segar.suites.suite_names import DATA
from tests.segar.suites.conftest import OWN


@pytest.fixture
def path(own, own_file, tmp_path):
    """A copy of the suite's files."""
    for one in own_file.parent.glob(f"{own_file.stem}.*"):
        shutil.copy(one, tmp_path)
    return tmp_path / own_file.name


@pytest.mark.parametrize("name", suites.suites())
def test_a_suite_is_what_was_frozen(name):
    suite = suites.suite(name)
    assert isinstance(suite, Suite) and suite.name == name and suite.axis == name.split("-")[0] in AXES
    assert name.rsplit("-", 1)[1].startswith("v")
    assert len(suite.test_levels) == 200 and suite.unsolved <= 20
    again = suite.test.sample(200 + suite.unsolved, seed=0, split="test")[suite.test_levels.provenance.indices]
    assert hash_of_levels(again) == hash_of_levels(suite.test_levels)
    assert suite.train.layout.slots == suite.test.layout.slots  # a state shows the same numbers in both


@pytest.mark.slow
@pytest.mark.parametrize("name", suites.suites())
def test_plans_solve_the_levels_and_chance_does_not(name):
    found = admission(suites.suite(name))
    assert found.is_fit, found


def test_plans_of_a_suite_of_ones_own_are_played_again(own):
    found = admission(own, plays=2)
    assert found.planner == 1 and 0 <= found.idle <= 1 and 0 <= found.random <= 1


def test_an_unfit_suite_is_told(own):
    plans = dataclasses.replace(own.plans, solved=np.zeros(6, np.bool_))
    hashes = {**own.hashes, "plans": hash_of_plans(plans)}
    unfit = dataclasses.replace(own, find_plans=lambda: plans, hashes=hashes)
    assert not admission(unfit, plays=1).is_fit and admission(unfit, plays=1).planner == 0


def test_a_suite_reads_as_it_was_written(own, path):
    read = read_suite(path)
    assert read.hash == own.hash and read.hidden == (Mass,) and read.task.max_steps == 50
    assert read.train.hash == segar.family("empty-medium").hash and read.test_levels == own.test_levels


@pytest.mark.parametrize(
    ("old", "new", "culprit"),
    [
        ("training_levels = 5", "training_levels = 6", "the description"),
        ("RandomTopLocation()", "RandomBottomLocation()", r"the training distribution, \[train\]"),
        ('rules = "default"', 'rules = "without friction"', "the description"),
    ],
)
def test_an_edited_description_is_refused_by_its_hash(path, old, new, culprit):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(SuiteError, match=f"{culprit}.* is not what was frozen: its hash is [0-9a-f]{{16}}"):
        read_suite(path)


def test_edited_levels_and_plans_are_refused_by_their_hashes(own, path):
    dataclasses.replace(own.plans, returns=own.plans.returns + 1).save(path.with_suffix(".plans.npz"))
    with pytest.raises(SuiteError, match="the file of plans beside it, is not what was frozen"):
        _ = read_suite(path).plans
    values = own.test_levels.values.copy()
    values[0, 0, own.test_levels.layout.columns[Position]] += 1e-9
    dataclasses.replace(own.test_levels, values=values).save(path.with_suffix(".levels.npz"))
    with pytest.raises(SuiteError, match="the file of test levels beside it is not what was frozen"):
        read_suite(path)


def test_plans_that_no_file_holds_are_found_again_to_the_bit(tmp_path):
    options = {**OWN, "samples": SAMPLES, "iterations": ITERATIONS}
    path = tmp_path / "mine-v1.toml"
    made = freeze(path, train=segar.family("empty-medium"), test=segar.family("empty-hard"), **options)
    before = made.plans
    path.with_suffix(".plans.npz").unlink()
    again = read_suite(path).plans
    assert (again.actions == before.actions).all() and len(again) == 6
    assert not [*DATA.glob("*.plans.npz")], "no plans are in the package"


def test_a_training_side_has_the_training_levels_and_nothing_of_the_test():
    of = suites.suite("look-far-v1")
    side = of.training_side(3)
    assert side.sample(3) == of.sample(3) and side.sample(4) == of.sample(4) and side.textures == of.textures[:1]
    assert suites.side_options(side, "train", 3, observation="rgb")["levels"] == of.sample(3)
    assert not {"test", "test_levels", "plans", "find_plans", "unsolved"} & {*vars(side)}
    with pytest.raises(SuiteError, match="side must be 'train', not 'test'"):
        suites.side_options(side, "test", 3)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('axis = "place"', 'axis = "plaice"', "axis: 'plaice' is not known here. Did you mean 'place'"),
        ('name = "mine-v1"', 'name = "yours-v1"', "name: 'yours-v1' is not known here. Known: mine-v1"),
        ('rules = "default"', 'rules = "os.system"', "train.rules: 'os.system' is not known here"),
        ('name = "puttputt"', 'name = "putt"', "task.name: 'putt' is not known here. Did you mean 'puttputt'"),
        ('hidden = ["Mass"]', 'hidden = ["Mess"]', "hidden: no factor is called 'Mess'. Did you mean 'Mass'"),
        ("training_levels = 5", "training_levels = 0", "training_levels must be 1 or more, not 0"),
        ("shift", "shyft", "'shift' is absent"),
        ("textures = []", 'textures = ["far"]', "textures must be none or two of baseline, close, far"),
        ("textures = []", 'textures = ["far", "away"]', "textures must be none or two of baseline, close, far"),
        ("format = 1", "format = 2", "format 2 is not the one that this version reads"),
        ("format = 1", "format 1", "is not a suite, or .*line 1"),
        ("LevelDistribution(", "open(", r"\[train\]: line 1: the text must be LevelDistribution"),
        ("RandomTopLocation()", "__import__('os')", r"\[train\]: line \d+: "),
    ],
)
def test_a_file_that_is_no_suite_is_told_with_its_place(path, old, new, message):
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(SuiteError, match=message) as caught:
        read_suite(path)
    assert str(path) in str(caught.value)


def test_a_missing_file_and_an_unknown_name_are_told(path, tmp_path):
    with pytest.raises(SuiteError, match=r"there is no suite .*none-v1\.toml"):
        read_suite(tmp_path / "none-v1.toml")
    path.with_suffix(".levels.npz").unlink()
    with pytest.raises(SuiteError, match=r"mine-v1\.levels\.npz"):
        read_suite(path)
    with pytest.raises(SuiteError, match=r"there is no suite 'place-fw-v1'\. Did you mean 'place-few-v1'"):
        suites.suite("place-fw-v1")


@pytest.mark.slow
def test_levels_that_the_planner_does_not_solve_are_left_out(tmp_path):
    far = {**OWN, "options": {"max_steps": 20}, "test_levels": 12, "iterations": 1, "samples": 8}
    made = freeze(
        tmp_path / "short-v1.toml", train=segar.family("empty-hard"), test=segar.family("objectsx3-hard"), **far
    )
    indices = made.test_levels.provenance.indices
    assert made.unsolved == indices[-1] + 1 - 12 > 0 and made.plans.solved.all()
    with pytest.raises(SuiteError, match=r"the planner solves only \d+ of 16 levels"):
        still = {**far, "options": {"max_steps": 1}}
        freeze(tmp_path / "none-v1.toml", train=segar.family("empty-hard"), test=segar.family("empty-hard"), **still)
    assert not (tmp_path / "none-v1.toml").exists()


def test_two_versions_stand_side_by_side(own, path, tmp_path):
    second = freeze(tmp_path / "mine-v2.toml", train=segar.family("empty-easy"), test=segar.family("empty-hard"), **OWN)
    assert read_suite(path).hash == own.hash != second.hash == read_suite(tmp_path / "mine-v2.toml").hash


def test_a_suite_is_written_whole_or_not_at_all_and_over_no_other(tmp_path):
    path, hard = tmp_path / "mine-v1.toml", segar.family("empty-hard")
    with pytest.raises(SuiteError, match=r"axis: 'plaice' is not known here\. Did you mean 'place'"):
        freeze(path, train=hard, test=hard, **{**OWN, "axis": "plaice"})
    assert not [*tmp_path.iterdir()]
    first = freeze(path, train=segar.family("empty-easy"), test=hard, **OWN)
    with pytest.raises(SuiteError, match=rf"another suite, {first.hash}.* another version in its name"):
        freeze(path, train=segar.family("empty-medium"), test=hard, **OWN)
    assert freeze(path, train=segar.family("empty-easy"), test=hard, **OWN).hash == read_suite(path).hash == first.hash
    assert len([*tmp_path.iterdir()]) == 3


def test_rules_that_have_no_name_cannot_be_frozen(tmp_path):
    bare = segar.family("empty-hard").with_rules([segar.move])
    with pytest.raises(SuiteError, match="the distribution of train is not the same when it is read from its text"):
        freeze(tmp_path / "bare-v1.toml", train=bare, test=segar.family("empty-hard"), **OWN)
    assert not (tmp_path / "bare-v1.toml").exists()


def test_slots_that_training_never_fills_have_no_say_in_exact_statistics():
    one = suites.suite("number-more-v1")
    there, back = (
        segar.metrics.ks(*pair, factors=[Position]) for pair in ((one.train, one.test), (one.test, one.train))
    )
    assert 0 < there < 1 and there == pytest.approx(back)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"task": "putputt"}, r"mine-v1\.toml: task: the task 'putputt' is not built in.* Did you mean 'puttputt'"),
        ({"options": {"max_stps": 5}}, r"mine-v1\.toml: task: 'puttputt' .*unexpected keyword argument 'max_stps'"),
    ],
)
def test_a_task_or_options_that_are_none_are_told_and_nothing_is_written(tmp_path, given, said):
    hard = segar.family("empty-hard")
    with pytest.raises(SuiteError, match=said):
        freeze(tmp_path / "mine-v1.toml", train=hard, test=hard, **{**OWN, **given})
    assert not any(tmp_path.iterdir())


def test_what_all_share_cannot_be_written():
    found = suites.suite("place-between-v1")
    layout = found.train.layout
    for shared in (found.hashes, found.task.results, layout.columns, layout.by_name, segar.GolfBall.declared):
        with pytest.raises(TypeError, match="does not support item assignment"):
            shared["mine"] = 0
    with pytest.raises(ValueError, match="read-only"):
        segar.Tile.declared[segar.Shape].vertices[0] = 0.0
    again = pickle.loads(pickle.dumps(found))
    assert (again.hashes, again.train.layout) == (found.hashes, layout)
