"""``segar record`` writes datasets and videos."""

import json

import minari

from segar import cli
from segar.datasets import Dataset
from tests.segar.datasets.folders import names_in


def test_the_command_records_checks_and_exports(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "minari"))
    command = ["record", "objectsx1-hard", "-o", str(tmp_path / "data"), "-n", "3", "--episodes", "5", "--shard", "2"]
    command += ["--policy", "script", "--observation", "state", "--check", "--minari", "hard-v0", "--json"]
    assert cli.main(command) == 0
    answer = json.loads(capsys.readouterr().out)
    dataset = Dataset.load(tmp_path / "data")
    assert answer == {
        "folder": str(tmp_path / "data"),
        "episodes": 5,
        "steps": dataset.steps,
        "frames": dataset.steps + 5,
        "shards": 3,
        "steps_replayed": dataset.steps,
        "minari": "hard-v0",
    }
    assert dataset.manifest.settings.policy == "script" and list(minari.list_local_datasets()) == ["hard-v0"]


def test_going_on_with_another_policy_is_one_line_and_exit_status_2(tmp_path, capsys):
    command = ["record", "objectsx1-hard", "-o", str(tmp_path / "data"), "-n", "2", "--episodes", "2"]
    assert cli.main(command) == 0
    assert capsys.readouterr().out.startswith(f"folder {tmp_path / 'data'}, episodes 2, steps ")
    assert cli.main([*command, "--policy", "script"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "policy ('uniform' there, 'script' asked for)" in said


def test_the_command_films_an_episode(tmp_path, capsys):
    film = tmp_path / "film.gif"
    command = ["record", "objectsx1-hard", "-o", str(film), "--policy", "script", "--level", "2", "--size", "128"]
    assert cli.main(command) == 0
    assert capsys.readouterr().out.endswith("frames of level 2\n") and names_in(tmp_path) == ["film.gif"]
