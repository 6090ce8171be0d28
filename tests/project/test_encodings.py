"""Text is UTF-8 whatever the locale says: in files, in pipes, and where the terminal knows fewer characters."""

import ast
import os
import subprocess
import sys
from collections.abc import Iterator

import pytest

from tests.places import ROOT

ROOMS = ("segar", "experiments", "analysis", "docs", "benchmarks", "examples")
OF_OTHERS = ("os", "Image", "webbrowser", "sync", "self")  # their open() opens no text file
C_LOCALE = {**os.environ, "PYTHONUTF8": "0", "LC_ALL": "C", "PYTHONPATH": str(ROOT)}


def unspecified(text: str) -> Iterator[str]:
    """Calls that open a file or a pipe as text, and leave its encoding to the locale."""
    for call in ast.walk(ast.parse(text)):
        if not isinstance(call, ast.Call) or any(one.arg == "encoding" for one in call.keywords):
            continue
        owner, _, name = ast.unparse(call.func).rpartition(".")
        given = {one.arg: one.value for one in call.keywords}
        mode = given.get("mode") or next(iter(call.args[0 if owner else 1 :]), None)
        if name in ("read_text", "write_text"):
            opens = len(call.args) < 2 and (owner or name == "read_text")
        elif name in ("open", "fdopen"):
            opens = owner not in OF_OTHERS and "archive" not in owner and not (mode and "b" in ast.unparse(mode))
        else:
            opens = {"text", "universal_newlines"} & {*given} or name in ("FileHandler", "TextIOWrapper")
        if opens:
            yield ast.unparse(call)


def test_no_text_has_the_encoding_of_the_locale():
    found = {
        path.relative_to(ROOT).as_posix(): calls
        for room in ROOMS
        for path in (ROOT / room).rglob("*.py")
        if (calls := [*unspecified(path.read_text(encoding="utf-8"))])
    }
    assert found == {}


@pytest.mark.parametrize(
    "text",
    ["p.read_text()", "p.write_text(x)", "open(p)", "open(p, 'w')", "p.open()", "p.open('a')", "run(c, text=True)"],
)
def test_such_a_call_is_found(text):
    assert [*unspecified(text)] == [text]


RULE = """
import segar
from segar.language.factors import Mass

@segar.rule
def größe(m: Mass) -> segar.SetFactor[Mass]:
    \"\"\"Verändert die Größe, in µg.\"\"\"
    return segar.SetFactor[Mass](m, m)

family = segar.levels.family("empty-easy").with_rules([*segar.DEFAULT_RULES, größe])
"""


STUDY = """
title: Größe
settings: {algorithm: ppo_fast, observation: state, scale.frames: 2000}
grid: {families: [empty-easy], counts: [1], seeds: 1}
claims: {größe: {says: "Größer ist schlechter.", test: correlation, given: [panel], expected: negative}}
"""


def test_rules_kernels_captions_and_studies_are_shown_written_and_read_in_the_locale_c(tmp_path):
    (tmp_path / "study.yaml").write_text(STUDY, encoding="utf-8")
    (tmp_path / "eigene.py").write_text(RULE, encoding="utf-8")
    program = (
        "import pathlib, segar.cli, segar.analysis.report.captions, segar.analysis.report.claims.statements\n"
        "from segar.experiments.reproduction.study_file import read_study\n"
        "from segar.engine.compiler.kernel_cache import load_module\n"
        "load_module('gr\\xf6\\xdfe = 1\\n')\n"
        "assert read_study(pathlib.Path('study.yaml')).experiment['title'] == 'Gr\\xf6\\xdfe'\n"
        "assert segar.cli.main(['kernel', 'show', 'eigene:family']) == 0\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], env=C_LOCALE, cwd=tmp_path, capture_output=True, encoding="utf-8", check=False
    )
    assert done.returncode == 0 and "gr\\xf6\\xdfe" in done.stdout, done.stderr


OTHERS = """
from pathlib import Path

from segar.experiments.commands.plugin import STUDIES, run_plugin
from segar.experiments.reproduction.process_pool import Job, run_jobs


def study(folder, **options):
    print("Gr\\xf6\\xdfe der Studie")


if __name__ == "__main__":
    assert run_plugin(STUDIES, "others:study", Path())
    (outcome,) = run_jobs([Job("one", "Gr\\xf6\\xdfe", Path("log"))], print, 1)
    assert outcome.error is None, outcome.error
"""


def test_plugins_and_the_processes_of_a_pool_print_in_the_locale_c(tmp_path):
    (tmp_path / "others.py").write_text(OTHERS, encoding="utf-8")
    there = {**C_LOCALE, "PYTHONCOERCECLOCALE": "0", "PYTHONPATH": f"{ROOT}{os.pathsep}{tmp_path}"}
    done = subprocess.run(
        [sys.executable, "others.py"], env=there, cwd=tmp_path, capture_output=True, encoding="utf-8", check=False
    )
    assert done.returncode == 0, done.stderr
    assert "Gr\\xf6\\xdfe der Studie" in done.stdout and "Gr\\xf6\\xdfe" in (tmp_path / "log").read_text("utf-8")
