"""What a task says of its own is tried before a run begins, and told where it is no number."""

import numpy as np
import pytest

import segar
from segar.experiments.results import results
from segar.experiments.runs.run_folder import read_episodes
from segar.experiments.settings import ConfigError, LevelsConfig, TaskConfig
from segar.experiments.settings.own_code import file_fingerprint
from segar.experiments.training.run import run
from tests.experiments.short_runs import short_run

HERE = "tests.experiments.training.own_results"


@pytest.mark.parametrize(
    ("task", "message"),
    [
        ("raising", r"the task own: its result 'mine', wrong \(own_results.py:\d+\), raises KeyError: 'Fuel'."),
        ("misshapen", r"its result 'mine', <lambda> \(own_results.py:\d+\), has the shape \(3,\) for 7 environments"),
        ("text", r"its result 'mine', <lambda> \(own_results.py:\d+\), is made of str_?, not of numbers or truths"),
        ("random_result", r"its result 'mine', drawn \(own_results.py:\d+\), differs when it is computed again"),
    ],
)
def test_a_result_that_cannot_be_computed_ends_the_run_before_anything_is_written(tmp_path, task, message):
    with pytest.raises(ConfigError, match=message):
        run(short_run(tmp_path / "run", task=TaskConfig(f"{HERE}:{task}")), lambda line: None)
    assert list(tmp_path.iterdir()) == []


def test_a_result_that_is_no_number_in_some_episodes_is_told_with_its_share_and_the_run_ends_well(tmp_path):
    said = []
    run(short_run(tmp_path / "run", task=TaskConfig(f"{HERE}:partial")), said.append)
    values = read_episodes(tmp_path / "run").to_pandas()["results/mine"]
    wrong, share = np.isnan(values).sum(), np.isnan(values).mean()
    assert 0 < share <= 1
    (line,) = (line for line in said if "no finite number" in line)
    assert line.startswith(
        f"warning: the task's result 'mine' is no finite number in {wrong} of {len(values)} episodes ({share:.0%})"
    )


def test_a_result_of_several_numbers_is_told_to_have_no_column(tmp_path, trained_and_said):
    said = []
    run(short_run(tmp_path / "run", task=TaskConfig(f"{HERE}:place")), said.append)
    (line,) = (line for line in said if "several numbers per environment" in line)
    assert line.startswith("warning: the task's result 'mine' is several numbers")
    assert len(read_episodes(tmp_path / "run").to_pandas()["results/mine"][0]) == 2
    _, of_puttputt = trained_and_said  # among whose results is a velocity
    assert not any("several numbers per environment" in line for line in of_puttputt)


def test_test_levels_that_are_training_levels_are_told_before_training_and_in_the_table(tmp_path, capsys):
    path, said = tmp_path / "few.npz", []
    segar.family("empty-easy").sample(4, seed=0).save(path)
    name = f"{path}#{file_fingerprint(path, '')}"
    for folder, test, count in (("same", name, 4), ("other", "empty-easy", 2)):
        levels = LevelsConfig(name, count=2, test=test, test_count=count)
        run(short_run(tmp_path / "runs" / folder, levels=levels), said.append)
    assert sum("warning: 50% of the test levels are training levels, too, so" in line for line in said) == 1
    capsys.readouterr()
    results(root=str(tmp_path / "runs"))
    (warning,) = (line for line in capsys.readouterr().out.splitlines() if "training levels, too" in line)
    assert warning.startswith("warning: 50% of the test levels are training levels, too, in same. ")
