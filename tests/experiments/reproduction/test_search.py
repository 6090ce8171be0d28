"""The search over hyper-parameters: it goes on where it stopped, survives runs that fail, and names mistakes."""

import dataclasses
import json
import re
from pathlib import Path

import hydra
import pytest
from optuna.trial import TrialState

import segar
from segar.experiments.commands.config_store import CONF, register_settings
from segar.experiments.search import (
    SETTINGS,
    Search,
    SearchConfig,
    build,
    distributions,
    example_of,
    search,
    with_values,
)
from segar.experiments.settings import ConfigError, PPOConfig, RunConfig, RunFolderError, TrainingError, without_files
from tests.experiments.conftest import working_here

SPACE = {
    "algorithm": {
        "learning_rate": {"low": 1e-4, "high": 1e-2, "log": True},
        "epochs": {"low": 1, "high": 8, "whole": True},
        "widths": {"choices": [[8], [16, 16]]},
    },
    "seed": {"choices": [3]},
}


def pretend_to_train(config):
    """Stands for training: the best learning rate is 1e-3; a trial of one epoch goes wrong."""
    if config.algorithm.epochs == 1:
        raise TrainingError("loss/value became nan")
    with open(f"{config.root}/trained", "a") as stream:
        stream.write(json.dumps([config.algorithm.learning_rate, config.algorithm.epochs, config.seed]) + "\n")
    return {"score": -abs(config.algorithm.learning_rate - 1e-3) - config.seed, "loss": 0.5}


def asked(root, space=SPACE, **changes):
    settings = {"space": space, "trials": 3, "metric": "score", "sampler_seed": 1, **changes}
    return Search(RunConfig(algorithm=PPOConfig(), root=str(root)), SearchConfig(**settings), pretend_to_train)


@pytest.fixture(scope="module")
def searched(tmp_path_factory):
    """A search of six trials, begun with three of them and cut off in a fourth; its folder and both studies."""
    root = tmp_path_factory.mktemp("searched")
    with working_here():
        first = search(asked(root))
        cut_off = first.ask(distributions(SPACE))
        return root, cut_off.params, search(asked(root, trials=6))


def test_a_search_goes_on_where_it_stopped_and_tries_again_what_was_cut_off(searched):
    root, cut_off, study = searched
    trials = study.get_trials()
    assert len(trials) == 7
    assert trials[3].state is TrialState.FAIL and "error" not in trials[3].user_attrs
    assert trials[4].params == cut_off
    rates = [trial.params["algorithm.learning_rate"] for trial in trials]
    assert len({*rates}) == 6, "but for what was cut off, no trial comes again"
    (folder,) = (root / "searches").iterdir()
    assert len(list((folder / "logs").iterdir())) == 6


def test_a_trial_whose_run_fails_is_told_and_the_others_go_on(searched):
    _, _, study = searched
    for trial in study.get_trials():
        if trial.params["algorithm.epochs"] == 1:
            assert trial.state is TrialState.FAIL
        elif "error" not in trial.user_attrs and trial.number != 3:
            assert trial.value == pytest.approx(-abs(trial.params["algorithm.learning_rate"] - 1e-3) - 3)


def test_values_lie_in_the_space_and_reach_the_runs(searched):
    root, _, study = searched
    ran = [json.loads(line) for line in (root / "trained").read_text().splitlines()]
    told = [trial.params for trial in study.get_trials() if trial.state is TrialState.COMPLETE]
    assert ran == [[one["algorithm.learning_rate"], one["algorithm.epochs"], 3] for one in told]
    assert all(1e-4 <= rate <= 1e-2 and epochs in range(1, 9) for rate, epochs, _ in ran)


def test_a_finished_search_prints_the_best_and_the_command_that_trains_with_it(searched, capsys):
    root, _, study = searched
    search(asked(root, trials=6))
    said = capsys.readouterr().out
    assert "0 of 6 trials to do" in said
    best = study.best_trial.params["algorithm.learning_rate"]
    command = said.splitlines()[-1]
    assert "segar train levels=empty-hard observation=state algorithm=ppo " in command
    assert f"algorithm.learning_rate={best} " in command, "all digits, or it trains another run"
    assert "algorithm.widths=[" in command


def untrainable(config):
    """Stands for runs whose figure is no number."""
    return {"score": float("nan"), "loss": None}


@pytest.mark.parametrize("metric", ["score", "loss"])
def test_trials_without_a_number_or_with_settings_that_are_not_allowed_have_failed(tmp_path, metric, capsys):
    space = {"algorithm": {"gamma": {"choices": [0.9, 1.5]}}}
    spec = dataclasses.replace(asked(tmp_path, space, metric=metric, trials=4), work=untrainable)
    for left in (4, 0):  # they are not tried again
        with pytest.raises(TrainingError, match="no trial of the search went through"):
            search(spec)
        said = capsys.readouterr().out
        assert f"{left} of 4 trials to do" in said
        assert not left or (f"{metric} is no number" in said and "algorithm.gamma: 1.5 is not allowed" in said)


def test_a_search_lies_under_its_root_or_says_why_it_cannot(tmp_path):
    segar.family("empty-easy").sample(1, 0).save(tmp_path / "levels.npz")
    levels = dataclasses.replace(RunConfig().levels, train=without_files(f"{tmp_path}/levels.npz"), test="empty-hard")
    name = Search(RunConfig(levels=levels, algorithm=PPOConfig()), SearchConfig(space=SPACE)).name
    assert re.match(r"levels\.npz_[0-9a-f]+-ppo-", name)
    search(asked(tmp_path, trials=1))
    (database,) = tmp_path.glob("searches/*/trials.db")
    database.write_bytes(b"damaged" * 1000)
    for root in (tmp_path, database):
        with pytest.raises(RunFolderError, match=r"trials\.db"):
            search(asked(root))


def edit_what_is_imported(config):
    """Stands for a user who edits her file while its run trains."""
    (file,) = Path(config.root).glob("searched*.py")
    with file.open("a") as stream:
        stream.write("far = segar.family('objectsx1-easy')\n")
    return {"score": 1.0}


@pytest.mark.parametrize("first", [[], ["empty-easy"]], ids=["imported by the search", "by its runs alone"])
def test_trials_of_code_that_was_edited_are_not_compared_with_those_before(tmp_path, monkeypatch, first):
    module = f"searched{len(first)}"
    (tmp_path / f"{module}.py").write_text("import segar\nfar = segar.family('empty-easy')\n")
    monkeypatch.syspath_prepend(tmp_path)
    spec = asked(tmp_path, {"levels": {"train": {"choices": [*first, f"{module}:far"]}}})
    said = "a file of the code changed while trials ran; give" if first else "has changed since this process imported"
    with pytest.raises(ConfigError, match=said):
        search(dataclasses.replace(spec, work=edit_what_is_imported))


@pytest.mark.parametrize(
    ("space", "says"),
    [
        ({}, "search.space: {} is not allowed; it must be one setting or more; search=ppo_fast has some"),
        ({"algorithm": {"lr": {"low": 0.1, "high": 1}}}, "no setting is called 'algorithm.lr'."),
        ({"algorithm": {"gamma": 3}}, "search.space.algorithm.gamma: 3 must say low and high, or choices"),
        ({"algorithm": {"gamma": {"low": 1.0, "high": 0.5}}}, "search.space.algorithm.gamma: "),
        ({"algorithm": {"gamma": {"low": 0.0, "high": 0.5, "log": True}}}, "must be above 0, where log is true"),
        ({"algorithm": {"gamma": {"low": 0.0, "hihg": 0.5}}}, "Did you mean 'search.space.algorithm.gamma.high'?"),
        ({"algorithm": {"gamma": {"low": 2.0, "high": 3.0}}}, "algorithm.gamma: 2.0 is not allowed"),
        ({"algorithm": {"epochs": {"low": 0.5, "high": 8, "whole": True}}}, "must be whole numbers low and high"),
        ({"algorithm": {"gamma": {"low": 0.5, "high": float("inf")}}}, "must be low and high, low < high"),
    ],
)
def test_a_wrong_space_is_named_before_anything_is_trained(tmp_path, space, says):
    with pytest.raises(ConfigError, match=re.escape(says)):
        search(asked(tmp_path, space=space))
    assert list(tmp_path.iterdir()) == []


def test_every_shipped_space_names_settings_of_its_algorithm():
    names = sorted(path.stem for path in (CONF / "search").glob("*.yaml"))
    assert {"ppo", "ppo_fast", "sac", "drq", "curl", "spr"} <= {*names}
    for name in names:
        register_settings("search", SETTINGS)
        with hydra.initialize_config_dir(str(CONF), version_base="1.3"):
            made = build(hydra.compose("search", [f"search={name}"]))
        assert made.space
        assert made.run.levels.test_seed != RunConfig().levels.test_seed
        with_values(made.run, {key: example_of(one) for key, one in made.space.items()})
