"""What is installed: the wheel ships segar alone, and an editable install finds experiments from any directory."""

import configparser
import importlib
import importlib.metadata
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
import yaml

import segar
from tests.places import ROOT


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel of this checkout, open."""
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(folder)]
    run = subprocess.run(build, cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 0, f"hatchling (extra 'dev') did not build the wheel:\n{run.stderr}"
    (path,) = folder.glob("*.whl")
    with zipfile.ZipFile(path) as archive:
        yield archive


def test_the_wheel_ships_segar_alone(wheel):
    top = {name.partition("/")[0] for name in wheel.namelist()}
    assert {name for name in top if not name.endswith(".dist-info")} == {"segar"}


def test_the_wheel_ships_every_module_of_segar(wheel):
    sources = {
        path.relative_to(ROOT).as_posix() for path in (ROOT / "segar").rglob("*.py*") if path.suffix in (".py", ".pyi")
    }
    assert sources <= set(wheel.namelist())


def test_the_entry_point_of_the_wheel_names_a_function(wheel):
    (name,) = (name for name in wheel.namelist() if name.endswith("entry_points.txt"))
    entry_points = configparser.ConfigParser()
    entry_points.read_string(wheel.read(name).decode())
    module, function = entry_points["gymnasium.envs"]["__root__"].split(":")
    assert callable(getattr(importlib.import_module(module), function))


@pytest.mark.parametrize("package", ["segar", "experiments", "analysis"])
def test_packages_are_found_from_any_directory(package, tmp_path):
    code = f"import importlib.util as u; print(u.find_spec({package!r}).submodule_search_locations[0])"
    run = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert Path(run.stdout.strip()) == ROOT / package


def test_every_pin_is_exact_or_a_closed_range():
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pins = [line for line in lines if line and not line.startswith("#")]
    loose = [pin for pin in pins if "==" not in pin and "<=" not in pin]
    assert not loose, f"constraints.txt leaves these open: {loose}"
    assert not [pin for pin in pins if "+" in pin or "@" in pin], "a pin must not name a local build or a file"


def test_one_file_says_the_version(wheel):
    (metadata,) = (name for name in wheel.namelist() if name.endswith("METADATA"))
    assert f"\nVersion: {segar.__version__}\n" in wheel.read(metadata).decode()
    assert "version" in tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dynamic"]


def test_the_citation_file_is_of_this_version_and_has_what_its_schema_demands():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert {"cff-version", "message", "title", "authors"} <= {*citation}
    assert citation["cff-version"] == "1.2.0" and citation["type"] == "software"
    assert citation["version"] == segar.__version__
    for cited in (citation, *citation["references"]):
        assert cited["title"] and all(
            {"name"} == {*a} or {"family-names", "given-names"} == {*a} for a in cited["authors"]
        )
    assert all({"type", "title", "authors"} <= {*reference} for reference in citation["references"])
