"""Which task a run plays where none is chosen: that of its training levels, and what is said where that is not clear."""

import dataclasses
import sys

import pytest

import segar
from segar.experiments.commands.hydra_app import compose
from segar.experiments.evaluation.evaluator import find_levels
from segar.experiments.levels.builders import Prepared, distribution_of
from segar.experiments.reproduction.checks import check_objects
from segar.experiments.runs.executed_code import executed_code
from segar.experiments.settings import (
    ConfigError,
    EvaluateConfig,
    LevelsConfig,
    ObservationConfig,
    RunConfig,
    TaskConfig,
)
from segar.experiments.settings.grid import GridPoint, config_at
from segar.levels.named_families import TASK_LEVELS

LEVELS = """
import dataclasses
import segar

class Draught(segar.Parameter, default=0.0): ...

field = dataclasses.replace(segar.family("empty-easy"), name="field", task="landing_tasks:landing")
plain = dataclasses.replace(field, task=None)
wrong = dataclasses.replace(field, task="landing_tasks:landng")
draughty = dataclasses.replace(field, parameters={Draught: 1.0})

def for_landing(distribution):
    return dataclasses.replace(distribution, task="landing_tasks:landing")
"""
TASKS = """
import dataclasses
import segar
from segar.observations import StateVector

def height(ball: segar.GolfBall) -> float:
    return ball[segar.Position][1]

def landing(max_steps: int = 7) -> segar.Task:
    return dataclasses.replace(segar.puttputt(max_steps=max_steps), name="landing", reward=height)

def limits(enough: float = 0.4, most: float = float("inf"), weights=(1.0,), **more) -> segar.Task:
    return landing()

landed = landing()
looks = StateVector()
"""
# The names that runs of named families had when PuttPutt was the default of all levels.
LABELS = {
    "empty-hard": "empty-hard-n10-state-ppo_fast-s0-069a7f10",
    "objectsx2-medium": "objectsx2-medium-n10-state-ppo_fast-s0-46703b0d",
    "puttputt": "puttputt-n10-state-ppo_fast-s0-ca5b38c6",
    "puttputt-random-middle": "puttputt-random-middle-n10-state-ppo_fast-s0-b69c831f",
    "billiards": "billiards-n10-state-ppo_fast-s0-fb108d82",
    "invisiball": "invisiball-n10-state-ppo_fast-s0-f505fe1d",
}


@pytest.fixture
def lab(tmp_path, monkeypatch):
    """A folder with levels that name a task, and with that task; what is imported from it is forgotten afterwards."""
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    (tmp_path / "landing_levels.py").write_text(LEVELS)
    (tmp_path / "landing_tasks.py").write_text(TASKS)
    yield tmp_path
    for module in ("landing_levels", "landing_tasks"):
        sys.modules.pop(module, None)


def on(train, **more):
    return RunConfig(levels=LevelsConfig(train, count=2, test_count=3), **more)


@pytest.mark.parametrize("levels", LABELS)
def test_names_of_runs_of_named_families_are_those_of_the_task_that_they_are_for(levels):
    settings = [f"levels={levels}", "algorithm=ppo_fast", "algorithm.precision=fp32"]
    assert compose(settings).label() == LABELS[levels]
    task = segar.family(levels).task or "puttputt"
    assert compose([*settings, f"task={task}"]).label() == LABELS[levels]


@pytest.mark.parametrize("levels", [*segar.families(), *TASK_LEVELS])
def test_named_levels_are_a_choice_and_are_played_in_their_own_task(levels):
    config = compose([f"levels={levels}"])
    assert config.levels.train == levels
    assert (
        Prepared(config).task_name == Prepared(config.resolved()).task_name == (segar.family(levels).task or "puttputt")
    )


def test_options_are_those_of_the_levels_task(lab):
    config = on("landing_levels:field", task=TaskConfig(options={"max_steps": 3}))
    assert Prepared(config).env_options()["task"].max_steps == 3


def test_a_chosen_task_is_played_whatever_the_levels_name(lab):
    config = on("landing_levels:field", task=TaskConfig("puttputt"))
    assert Prepared(config).env_options()["task"].name.startswith("puttputt")
    assert config.label() != on("landing_levels:field").label()


def test_each_cell_of_a_grid_has_the_task_of_its_levels(lab):
    tasks = [
        Prepared(config_at(RunConfig(), GridPoint(name, "", 1, 0))).task_name
        for name in ("invisiball", "landing_levels:field")
    ]
    assert tasks == ["invisiball", "landing_tasks:landing"]


def test_the_code_of_the_levels_task_counts_as_executed(lab):
    before = executed_code(Prepared(on("landing_levels:field")))
    file = lab / "landing_tasks.py"
    # Of another size: Python takes compiled code for current where neither the second nor the size of its source changed.
    file.write_text(file.read_text().replace("[1]", "[ 0]"))
    sys.modules.pop("landing_tasks")
    after = executed_code(Prepared(on("landing_levels:field")))
    assert {name for name in after if after[name] != before[name]} == {"kernel", "./landing_tasks.py"}


def test_a_level_file_without_its_own_task_s_code_says_which_setting_names_it(lab):
    distribution_of(LevelsConfig("landing_levels:field"), "train").sample(3).save(lab / "field.npz")
    with pytest.raises(ConfigError, match=r"field.npz were saved for the task .*; give task=landing_tasks:landing"):
        _ = Prepared(RunConfig(levels=LevelsConfig(str(lab / "field.npz"), test=str(lab / "field.npz")))).task_name
    segar.family("invisiball").sample(3).save(lab / "balls.npz")
    assert (
        Prepared(RunConfig(levels=LevelsConfig(str(lab / "balls.npz"), test=str(lab / "balls.npz")))).task_name
        == "invisiball"
    )


@pytest.mark.parametrize("which", ["train", "test"])
def test_rules_that_a_level_file_only_names_are_asked_for_by_the_setting_that_names_them(lab, which):
    segar.family("empty-easy").with_rules([segar.move]).sample(3).save(lab / "free.npz")
    levels = LevelsConfig("empty-easy", test="empty-easy")
    with pytest.raises(ConfigError, match=rf"levels.{which}: .* rules of their own \(move.*levels.world=module:"):
        distribution_of(dataclasses.replace(levels, **{which: str(lab / "free.npz")}), which)
    with pytest.raises(ConfigError, match=r"levels: .* rules of their own \(move.* world=module:attribute"):
        find_levels(EvaluateConfig("run", levels=str(lab / "free.npz")), lab, RunConfig())


def test_a_wrong_task_of_the_levels_is_told_with_the_levels_that_name_it(lab):
    with pytest.raises(ConfigError, match=r"levels.train: .*'landing_tasks' has no 'landng'. Did you mean 'landing'"):
        Prepared(on("landing_levels:wrong")).env_options()


def test_a_plan_ends_with_a_wrong_task_of_any_of_its_levels(lab):
    check_objects([on("landing_levels:field"), on("landing_levels:plain")])
    with pytest.raises(ConfigError, match="'landing_tasks' has no 'landng'"):
        check_objects([on("landing_levels:field"), on("landing_levels:wrong")])


def test_a_variation_that_gives_named_levels_another_task_asks_for_a_choice(lab):
    levels = LevelsConfig("empty-easy", variation="landing_levels:for_landing")
    with pytest.raises(ConfigError, match=r"levels.variation: .* task=landing_tasks:landing or task=puttputt"):
        Prepared(RunConfig(levels=levels)).env_options()
    chosen = RunConfig(levels=levels, task=TaskConfig("landing_tasks:landing"))
    assert Prepared(chosen).env_options()["task"].name == "landing"


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"task": TaskConfig("landing_tasks:landed", {"max_steps": 0})}, r"task.options: .* made already, .*max_steps"),
        ({"observation": ObservationConfig("landing_tasks:looks", {"hidden": []})}, r"observation.options: .*hidden"),
    ],
)
def test_options_of_what_is_made_already_end_a_plan(lab, settings, says):
    with pytest.raises(ConfigError, match=says + r".* Name a function"):
        check_objects([on("landing_levels:field", **settings)])


NAN, INFINITE = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("name", "options", "place", "number"),
    [
        ("landing_tasks:limits", {"enough": NAN}, "enough", "nan"),
        ("landing_tasks:limits", {"weights": [1.0, NAN]}, "weights.1", "nan"),
        ("landing_tasks:limits", {"weights": {"of": {"bees": INFINITE}}}, "weights.of.bees", "inf"),
        ("landing_tasks:limits", {"other": NAN}, "other", "nan"),
        ("puttputt", {"goal_distance": NAN}, "goal_distance", "nan"),
    ],
)
def test_numbers_of_task_options_that_are_not_finite_end_a_plan(lab, name, options, place, number):
    with pytest.raises(ConfigError, match=rf"task\.options\.{place}: .* finite, not {number},.* {name} "):
        check_objects([on("landing_levels:field", task=TaskConfig(name, options))])


def test_a_task_function_allows_infinite_options_by_its_default(lab):
    for most in (INFINITE, -INFINITE, 3.0):
        task = TaskConfig("landing_tasks:limits", {"most": most, "enough": 1, "weights": [0.5]})
        check_objects([on("landing_levels:field", task=task)])


def test_an_observation_may_name_what_the_levels_module_defines_wherever_options_are_made_first(lab):
    state = ObservationConfig(options={"parameters": ["Draught"]})
    config = on("landing_levels:draughty", task=TaskConfig("puttputt"), observation=state)
    assert "landing_levels" not in sys.modules
    assert Prepared(config).env_options()["observation"].parameters == ["Draught"]
