"""Command lines that are not Hydra's: what they state, and how they refuse."""

import re
import runpy
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from segar.experiments.commands.command_line import read_value, run_from_command_line
from segar.experiments.settings import ConfigError, EvaluateConfig


@pytest.fixture
def call(monkeypatch):
    """Calls a function with the arguments of a command line."""

    def call(function, *arguments, settings=None):
        monkeypatch.setattr(sys, "argv", ["command", *arguments])
        run_from_command_line(function, settings)

    return call


def recorder():
    """A function with arguments of several kinds, and the list of its calls."""
    calls = []

    def run(
        *runs: str,
        output: Path = Path("here"),
        levels: int = 100,
        only: tuple[str, ...] = ("a", "b"),
        cells: bool = False,
    ) -> None:
        calls.append((runs, output, levels, only, cells))

    return run, calls


@pytest.mark.parametrize(
    ("arguments", "called"),
    [
        ([], ((), Path("here"), 100, ("a", "b"), False)),
        (["x", "-o", "there", "y", "--levels", "3"], (("x", "y"), Path("there"), 3, ("a", "b"), False)),
        (["output=there", "levels=1e3", "x"], (("x",), Path("there"), 1000, ("a", "b"), False)),
        (["x", "--cells"], (("x",), Path("here"), 100, ("a", "b"), True)),
        (["cells=true", "only=[c]"], ((), Path("here"), 100, ("c",), True)),
        (["--only", "c", "d", "--levels=3"], ((), Path("here"), 3, ("c", "d"), False)),
        (["only=c"], ((), Path("here"), 100, ("c",), False)),
    ],
)
def test_each_argument_of_a_function_is_an_option(call, arguments, called):
    run, calls = recorder()
    call(run, *arguments)
    assert calls == [called]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--level", "3"], "no setting is called 'level'. Did you mean 'levels'?"),
        (["levels=many"], "levels: 'many' is not a whole number"),
        (["cells=3"], "cells: 3 is not true or false"),
    ],
)
def test_mistakes_are_told_in_one_message(call, arguments, says):
    with pytest.raises(SystemExit) as told:
        call(recorder()[0], *arguments)
    assert told.value.code == f"error: {says}"


def test_mistakes_in_settings_of_a_class_are_told_alike(call):
    with pytest.raises(SystemExit, match=r"^error: run: it has no default; give one as run=\.\.\."):
        call(pytest.fail, settings=EvaluateConfig)
    with pytest.raises(SystemExit, match=r"^error: modes\[0\]: 'sample' is unknown. Did you mean 'sampled'\?"):
        call(pytest.fail, "run=here", "modes=[sample]", settings=EvaluateConfig)


def test_a_function_without_further_arguments_takes_none(call):
    def run(levels: int = 3) -> None:
        pytest.fail(str(levels))

    with pytest.raises(SystemExit, match="'here' is no setting; settings are given as name=value"):
        call(run, "here")


def test_help_names_the_command_and_its_options(monkeypatch, capsys):
    monkeypatch.delitem(sys.modules, "segar.analysis.studies.w2", raising=False)
    monkeypatch.setattr(sys, "argv", ["w2", "--help"])
    with suppress(SystemExit):
        runpy.run_module("segar.analysis.studies.w2", run_name="__main__", alter_sys=True)
    said = capsys.readouterr().out
    assert "usage: python -m segar.analysis.studies.w2" in said and "W2 of n training levels to 100 test levels" in said
    assert "--seeds VALUE" in said and "default: 5" in said
    assert re.search("-o( VALUE)?, --output VALUE", said)  # Python 3.13 names the value once


def test_values_are_read_as_yaml():
    read = [read_value("one", text) for text in ("1e3", "[a,b]", "null", "false")]
    assert read == [1000.0, ["a", "b"], None, False]


def test_what_cannot_be_read_is_named():
    with pytest.raises(ConfigError, match=r"n: settings cannot be read: .*\[1"):
        read_value("n", "[1")
