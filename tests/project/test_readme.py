"""The programs in README.md and CONTRIBUTING.md run as they are printed."""

import os
import re
import subprocess
import sys

import pytest

from tests.places import ROOT

pytestmark = pytest.mark.docs

PROGRAMS = [
    pytest.param(program, id=f"{page}-{number}")
    for page in ("README.md", "CONTRIBUTING.md")
    for number, program in enumerate(re.findall(r"^```python\n(.*?)^```", (ROOT / page).read_text(), re.M | re.S))
]


@pytest.mark.parametrize("program", PROGRAMS)
def test_the_program_runs(program, tmp_path):
    script = tmp_path / "program.py"  # a file, since rules are read from their source
    script.write_text(program)
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    run = subprocess.run([sys.executable, str(script)], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
