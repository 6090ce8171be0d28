"""What an agent observes in training is what it observes in the test, or the run does not begin."""

import pytest

from segar.analysis.probes.collection import collect_run
from segar.experiments.evaluation.evaluator import evaluate
from segar.experiments.evaluation.transfer_evaluation import evaluate_transfer
from segar.experiments.evaluation.transfers import Transfer
from segar.experiments.levels.builders import Prepared, check_observations, make_levels
from segar.experiments.runs.run_folder import read_metrics
from segar.experiments.settings import (
    ConfigError,
    EvaluateConfig,
    EvaluationConfig,
    LevelsConfig,
    ObservationConfig,
    RunConfig,
    add_module_path,
)
from segar.experiments.training.run import run
from segar.levels import source_moments
from segar.observations.state import places
from tests.experiments.short_runs import short_run

FEW = {"count": 2, "test_count": 2}


def check(train, test, observation="state", **options):
    levels = LevelsConfig(train=train, test=test, **FEW)
    config = RunConfig(levels=levels, observation=ObservationConfig(observation, options))
    check_observations(Prepared(config), *make_levels(levels))


@pytest.mark.parametrize(
    ("train", "test", "only"),
    [
        ("empty-easy", "objectsx1-easy", "object1.Position.x in the test"),
        ("tilesx1-easy", "empty-easy", "tile1.Position.x in training"),
    ],
)
def test_a_state_of_other_entities_is_refused_with_the_first_that_differs(train, test, only):
    with pytest.raises(ConfigError, match=f"levels.test: observation=state .* in levels of {test} .*{only}"):
        check(train, test)


def test_pixels_and_states_of_chosen_entities_fit_all_levels():
    check("empty-easy", "objectsx1-easy", "rgb")
    check("empty-easy", "objectsx1-easy", "state", entities=["golfball", "goal"])


def loud(gain=1.0):
    return float(gain)


def test_an_option_that_own_code_refuses_is_told_with_its_value():
    config = RunConfig(observation=ObservationConfig(f"{__name__}:loud", {"gain": "loud"}))
    with pytest.raises(ConfigError, match=r"^observation.options: .*:loud with gain='loud' raises ValueError: could"):
        Prepared(config).env_options()


def test_an_agent_is_tested_in_the_units_that_it_was_trained_in(tmp_path, monkeypatch):
    measured = []

    def noted(levels):
        measured.append(levels.provenance.name)
        return source_moments(levels)

    monkeypatch.setattr(places, "source_moments", noted)
    hard = LevelsConfig(train="empty-easy", test="empty-hard", count=2, test_count=3)
    seen = ObservationConfig("state_normalised")
    config = short_run(tmp_path / "run", levels=hard, observation=seen, evaluation=EvaluationConfig(2, interval=64))
    folder = run(config).folder
    evaluate(EvaluateConfig(str(folder), levels="empty-medium", n=2, scores=False, videos="none"))
    evaluate_transfer(config, Transfer("harder", "empty-hard", "", seen, test_count=2), lambda line: None)
    collect_run(folder, frames=10, num_envs=2)
    assert len(measured) > 10 and {*measured} == {"empty-easy"}
    last = read_metrics(folder).to_pandas()  # an evaluation within training falls on the last frame, too
    assert "evaluation/test/return/deterministic" in set(last["name"]) and not last.duplicated(["name", "frames"]).any()


def test_test_levels_without_what_the_task_needs_are_told_by_their_setting(tmp_path):
    (tmp_path / "goalless.py").write_text(
        "import segar\n"
        "places = [segar.Prior(segar.Position, segar.RandomUniformLocation())]\n"
        "balls = segar.LevelDistribution([(segar.GolfBall, 1)], places)\n"
    )
    add_module_path([str(tmp_path)])
    with pytest.raises(ConfigError, match=r"^levels\.test: the task puttputt .* cannot be played in levels"):
        check("empty-easy", "goalless:balls", "rgb")
