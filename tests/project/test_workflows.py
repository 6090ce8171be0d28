"""The workflows ask for what there is: targets of the Makefile, Python versions that SEGAR supports, and its version."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

from tests.places import ROOT

WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


def jobs_of(path):
    return yaml.safe_load(path.read_text())["jobs"]


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_every_target_that_a_workflow_makes_exists(path):
    targets = set(re.search(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)[1].split())
    made = set()
    for job in jobs_of(path).values():
        matrix = job.get("strategy", {}).get("matrix", {})
        rows = [{"part": part} for part in matrix.get("part", [])] + matrix.get("include", []) or [{}]
        for step in job.get("steps", []):
            for name in re.findall(r"\bmake ([\w-]*(?:\$\{\{ matrix\.\w+ \}\})?)", step.get("run", "")):
                made |= {re.sub(r"\$\{\{ matrix\.(\w+) \}\}", lambda found: row[found[1]], name) for row in rows}  # noqa: B023
    assert made and made <= targets


def test_the_tests_run_on_every_python_that_the_package_names():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    named = {c.rpartition(" ")[2] for c in project["classifiers"] if re.search(r":: 3\.\d+$", c)}
    tested = set(jobs_of(ROOT / ".github/workflows/tests.yml")["tests"]["strategy"]["matrix"]["python"])
    assert named <= tested and project["requires-python"] == f">={min(tested, key=lambda v: int(v[2:]))}"


def test_a_tag_that_is_not_the_version_is_refused():
    dry = subprocess.run(["make", "-n", "dist", "TAG=v9.9"], cwd=ROOT, capture_output=True, text=True, check=True)
    assert '[ -e "dist/segar-9.9.tar.gz" ]' in dry.stdout


def test_the_program_that_tries_a_new_wheel_runs():
    tried = jobs_of(ROOT / ".github/workflows/release.yml")["wheel"]["steps"][-1]["run"]
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    subprocess.run(["bash", "-e", "-c", tried], env={**os.environ, "PATH": path}, capture_output=True, check=True)
