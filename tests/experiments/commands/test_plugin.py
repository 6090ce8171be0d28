"""Plug-ins are found by their entry points, run in processes of their own, and say what is wrong with them."""

from importlib.metadata import entry_points

import pytest

from segar.experiments.commands.config_store import CONF
from segar.experiments.commands.plugin import REPORTS, STUDIES, SUMMARIES, call_plugin, find_plugin, run_plugin
from segar.experiments.reproduce import experiment_files
from segar.experiments.settings import ConfigError

MODULE = """
import os
def run(output, levels=1):
    (output / "levels.txt").write_text(f"{levels} {os.getpid()}")
"""


def test_every_registered_plugin_can_be_loaded():
    """The entry points of pyproject.toml; after a change of theirs, make setup registers them anew."""
    names = {group: set(entry_points(group=group).names) for group in (STUDIES, REPORTS, SUMMARIES)}
    asked = {data["study"] for data in experiment_files().values() if "study" in data}
    assert asked <= names[STUDIES], f"studies of {CONF / 'experiment'}"
    assert {"tables", "report"} <= names[REPORTS]
    assert "default" in names[SUMMARIES]
    for group in names:
        assert all(callable(one.load()) for one in entry_points(group=group))


def test_a_plugin_runs_in_a_process_of_its_own(tmp_path, register):
    register(STUDIES, MODULE, mine="some_plugins:run")
    assert run_plugin(STUDIES, "mine", tmp_path, {"levels": 3})
    levels, process = (tmp_path / "levels.txt").read_text().split()
    call_plugin(STUDIES, "some_plugins:run", tmp_path, {})
    assert levels == "3" and (tmp_path / "levels.txt").read_text() != f"1 {process}"


def test_a_plugin_that_is_not_registered_names_the_fix(register):
    register(STUDIES, MODULE, mine="some_plugins:run")
    with pytest.raises(ConfigError, match=r"'mins' in the group segar.studies. Did you mean 'mine'\?.*make setup"):
        find_plugin(STUDIES, "mins")


def test_options_that_a_plugin_does_not_take_are_an_error(tmp_path, register, capfd):
    register(STUDIES, MODULE, mine="some_plugins:run")
    assert not run_plugin(STUDIES, "mine", tmp_path, {"level": 3})
    assert (
        "error: mine cannot be called with {'level': 3}: got an unexpected keyword argument" in capfd.readouterr().err
    )
