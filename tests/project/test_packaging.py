"""What is installed: one wheel with one top-level name, and an editable install that finds it from any directory."""

import configparser
import importlib
import importlib.metadata
import os
import subprocess
import sys
import tomllib
import zipfile

import pytest
import yaml

import segar
from tests.places import LINKED, ROOT

SHIPPED = (".py", ".pyi", ".yaml", ".html", ".jinja", ".mplstyle", ".ll")


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


def test_the_wheel_ships_every_module_and_every_configuration(wheel):
    places = [ROOT / "segar", *(ROOT / "segar" / name for name in LINKED)]
    sources = {file for place in places for file in place.resolve().rglob("*") if file.suffix in SHIPPED}
    names = [file.relative_to(ROOT).as_posix() for file in sources]
    assert {name if name.startswith("segar/") else f"segar/{name}" for name in names} <= set(wheel.namelist())


@pytest.mark.parametrize("name", LINKED)
def test_links_lead_to_the_folders_at_the_top_and_archives_have_copies(name):
    here, there = ROOT / "segar" / name, ROOT / name
    is_archive = (ROOT / "PKG-INFO").exists()
    assert here.is_symlink() != is_archive and here.resolve() == (here if is_archive else there)
    assert {p.relative_to(here) for p in here.glob("*.*")} == {p.relative_to(there) for p in there.glob("*.*")}


def test_the_entry_points_of_the_wheel_name_functions(wheel):
    (name,) = (name for name in wheel.namelist() if name.endswith("entry_points.txt"))
    entry_points = configparser.ConfigParser()
    entry_points.read_string(wheel.read(name).decode())
    assert dict(entry_points["console_scripts"]) == {"segar": "segar.cli:main"}
    named = [value for group in entry_points.values() for value in group.values()]
    for module, function in (name.split(":") for name in named):
        assert callable(getattr(importlib.import_module(module), function))


def test_a_folder_of_ones_own_called_experiments_is_ones_own(tmp_path):
    for name in ("experiments", "analysis"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("mine = 'mine'")
    code = "import experiments, analysis, segar.experiments.train; print(experiments.mine, analysis.mine)"
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    run = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, env=environment)
    assert (run.stdout.strip(), run.stderr) == ("mine mine", "")


def test_an_installed_package_finds_the_results_of_the_clone_in_which_it_is_called(wheel, tmp_path):
    wheel.extractall(tmp_path)
    code = "import segar, segar.support; print(segar.__file__, segar.support.ROWS, sep='|')"
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    run = subprocess.run([sys.executable, "-P", "-c", code], cwd=ROOT, capture_output=True, text=True, env=environment)
    found = f"{tmp_path / 'segar' / '__init__.py'}|{ROOT / 'docs' / 'results' / 'benchmark'}"
    assert run.stdout.strip() == found, run.stderr


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
        assert cited["title"] and all({*a} in ({"name"}, {"family-names", "given-names"}) for a in cited["authors"])
    assert all({"type", "title", "authors"} <= {*reference} for reference in citation["references"])
