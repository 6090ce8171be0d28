"""`make setup` installs once, again when the requirements change, and trusts no broken installation.

A shell script stands in for Python, so that nothing is installed here.
"""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.places import ROOT

STAMP = Path(".venv/.installed")

FAKE_PYTHON = """#!/bin/sh
case "$*" in
    --version) echo "Python $FAKE_VERSION" ;;
    -c*) test "$FAKE_VERSION" != 3.9.2 ;;
    "-m venv"*) mkdir -p .venv/bin && cp "$0" .venv/bin/python ;;
    "-m pip --version") ;;
    "-m pip install"*) echo "$*" >> installs.log; test "$FAKE_INSTALL" != fails ;;
    *) echo "unexpected: $*" >&2; exit 2 ;;
esac
"""


@pytest.fixture
def checkout(tmp_path):
    for name in ("Makefile", "pyproject.toml", "constraints.txt"):
        shutil.copy(ROOT / name, tmp_path)
    python = tmp_path / "fake-python"
    python.write_text(FAKE_PYTHON)
    python.chmod(0o755)
    return tmp_path


def setup(checkout, version="3.11.7", install="works"):
    """The result of `make setup` in `checkout`; `.stdout` holds what it said on both streams."""
    ours = ("MFLAGS", "VENV", "PYTHON")  # of the make that runs these tests
    outer = {name: value for name, value in os.environ.items() if not name.startswith("MAKE") and name not in ours}
    environment = outer | {"FAKE_VERSION": version, "FAKE_INSTALL": install}
    command = ["make", "setup", "PYTHON=./fake-python"]
    return subprocess.run(
        command, cwd=checkout, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )


def installs(checkout):
    log = checkout / "installs.log"
    return len(log.read_text().splitlines()) if log.exists() else 0


def touch(path):
    """Make a file newer than the installation."""
    later = (path.parent / STAMP).stat().st_mtime + 1
    os.utime(path, (later, later))


@pytest.mark.parametrize("changed", ["pyproject.toml", "constraints.txt"])
def test_a_second_setup_installs_nothing_and_new_requirements_install_again(checkout, changed):
    assert setup(checkout).returncode == 0
    assert setup(checkout).returncode == 0
    assert installs(checkout) == 1
    touch(checkout / changed)
    setup(checkout)
    assert installs(checkout) == 2


def test_a_failed_installation_leaves_no_stamp_and_takes_the_old_one_away(checkout):
    for _ in range(2):
        assert setup(checkout, install="fails").returncode != 0
        assert not (checkout / STAMP).exists()
        assert setup(checkout).returncode == 0
        assert (checkout / STAMP).exists()
        touch(checkout / "constraints.txt")


def test_an_old_python_is_named_with_the_way_out(checkout):
    result = setup(checkout, version="3.9.2")
    assert result.returncode != 0
    assert "SEGAR needs Python 3.11 or newer; './fake-python' is: Python 3.9.2." in result.stdout
    assert "make setup PYTHON=python3.11" in result.stdout
    assert not (checkout / ".venv").exists()


@pytest.mark.parametrize("target", ["test-docs", "check-results", "test-slow"])
def test_targets_of_a_mark_also_run_tests_of_training(target):
    """pytest's own paths are those of `make test`, which leaves tests of training to a target of theirs."""
    printed = subprocess.run(
        ["make", "-n", target, "ARGS="], cwd=ROOT, text=True, capture_output=True, check=True
    ).stdout
    (line,) = (one for one in printed.splitlines() if "-m pytest" in one)
    assert line.split()[-1] == "tests"
