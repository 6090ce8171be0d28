"""What a run may be resumed under: the code that it executes, whoever wrote that code, and nothing else."""

import dataclasses
import hashlib
import importlib
import shutil
import sys
from functools import cache
from pathlib import Path

import pytest

import segar
from segar.experiments.levels.builders import Prepared
from segar.experiments.runs import executed_code as module
from segar.experiments.runs.executed_code import code_after, combined, differing_parts, executed_code, fingerprint
from segar.experiments.runs.own_files import file_digest, own_files
from segar.experiments.runs.own_modules import modules_reached
from segar.experiments.runs.source_text import normalised
from segar.experiments.settings import LevelsConfig, ObservationConfig, PPOConfig, RunConfig, SACConfig

CONFIG = RunConfig(levels=LevelsConfig(train="empty-easy", count=2, test_count=2))


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package of the user's: an algorithm that imports a neighbour, and something that it does not import."""
    folder = tmp_path / "my_lab"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "mine.py").write_text(
        "from segar.experiments.algorithms.ppo import PPO\nfrom . import parts\nfrom .sums import add as plus\n"
    )
    for name in ("parts", "sums", "other"):
        (folder / f"{name}.py").write_text("add = max\n")
    monkeypatch.syspath_prepend(tmp_path)
    yield folder
    for name in [name for name in sys.modules if name.partition(".")[0] == "my_lab"]:
        del sys.modules[name]


@pytest.fixture
def library(tmp_path, monkeypatch):
    """A copy of segar's source that may be edited."""
    folder = tmp_path / "library" / "segar"
    shutil.copytree(Path(segar.__file__).parent, folder, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr("segar.__file__", str(folder / "__init__.py"))
    monkeypatch.setattr(module, "normalised", bytes)  # of 150 files, whose syntax trees are not the point
    monkeypatch.setattr(module, "_of_ours", cache(module._of_modules))  # what other tests find is not that of this one
    monkeypatch.setattr(module, "executed", Path.read_bytes)  # nobody imports the copy
    module._library.cache_clear()
    yield folder
    module._library.cache_clear()


def edited(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    module._library.cache_clear()


def test_all_that_a_learner_imports_of_its_package_and_of_ours_counts(package):
    found = modules_reached("my_lab.mine")
    ours = {name for name in found if name.startswith("segar.experiments.")}
    assert {*found} - ours == {"my_lab", "my_lab.mine", "my_lab.parts", "my_lab.sums"}
    assert {
        "segar.experiments.algorithms.ppo",
        "segar.experiments.networks.encoders",
        "segar.experiments.networks.policies",
    } <= ours
    assert not [name for name in ours if name.startswith(("segar.experiments.settings", "segar.experiments.commands"))]


@pytest.mark.parametrize(("file", "counts"), [("mine", True), ("sums", True), ("other", False)])
def test_an_edit_changes_the_fingerprint_if_the_learner_imports_it(package, file, counts):
    before = fingerprint("my_lab.mine")
    path = package / f"{file}.py"
    path.write_text(f'"""What it is for."""\n{path.read_text()}  # why\n')
    assert fingerprint("my_lab.mine") == before
    path.write_text(f"{path.read_text()}more = 1\n")
    assert (fingerprint("my_lab.mine") != before) == counts


def test_an_imported_learner_is_recorded_as_it_is_executed_whatever_its_file_says_now(package):
    importlib.import_module("my_lab.sums")
    before = fingerprint("my_lab.sums")
    edited(package / "sums.py", "max", "min")
    assert fingerprint("my_lab.sums") == before
    del sys.modules["my_lab.sums"]
    assert fingerprint("my_lab.sums") != before


def test_files_that_changed_while_a_run_went_on_count_as_other_code_ever_after(package):
    importlib.import_module("my_lab.sums")
    (package / "data.json").write_text("1")
    code = {"kernel": "k", **dict.fromkeys(("my_lab/sums.py", "my_lab/parts.py", "my_lab/data.json"), "")}
    code = {name: file_digest(package.parent / name) if "/" in name else was for name, was in code.items()}
    lines = []
    assert code_after(code, lines.append) == code and not lines
    edited(package / "sums.py", "max", "min")  # which was imported before, and so the run executed what is recorded
    assert code_after(code, lines.append) == code and not lines
    edited(package / "data.json", "1", "2")
    edited(package / "parts.py", "max", "min")
    importlib.import_module("my_lab.parts")  # late: the run executed the edited one
    after = code_after(code, lines.append)
    assert [name for name in code if after[name] != code[name]] == ["my_lab/parts.py", "my_lab/data.json"]
    assert "my_lab/parts.py, my_lab/data.json changed while" in lines[0]
    edited(package / "data.json", "2", "1")
    assert "my_lab/data.json" in differing_parts(after, {"kernel": "k"})


def test_files_that_are_read_only_now_are_other_code(package):
    for name in ("a", "b", "c"):
        (package / f"{name}.csv").write_text(name)
    (package / "used.csv").symlink_to("a.csv")
    (package / "sums.py").write_text("import os\nX = 'used.csv'\nY = os.path.exists('my_lab/more.csv')\n")
    before = own_files("my_lab.sums")
    assert not differing_parts(before, own_files("my_lab.sums"))
    (package / "used.csv").unlink()
    (package / "used.csv").symlink_to("b.csv")
    (package / "more.csv").write_text("1")
    assert differing_parts(before, own_files("my_lab.sums")) == ["my_lab/b.csv", "my_lab/more.csv"]


def test_the_files_of_a_task_that_the_levels_name_count(package):
    (package / "tasks.py").write_text("import segar\n\n\ndef calm():\n    return segar.puttputt()\n")
    (package / "levels.py").write_text(
        "import dataclasses\nimport segar\n\n\ndef calm():\n"
        "    return dataclasses.replace(segar.family('empty-easy'), task='my_lab.tasks:calm')\n"
    )
    named = dataclasses.replace(CONFIG, levels=dataclasses.replace(CONFIG.levels, train="my_lab.levels:calm"))
    assert "my_lab/tasks.py" in executed_code(Prepared(named))


def test_the_order_of_imports_is_no_code_and_their_names_are(package):
    (package / "mine.py").write_text(
        "import os\nfrom .sums import add, more\nfrom . import parts\n\nsize = add(1, 2)\n"
    )
    before = fingerprint("my_lab.mine")
    (package / "mine.py").write_text(
        "from . import parts\nfrom .sums import more, add\nimport os\n\nsize = add(1, 2)\n"
    )
    assert fingerprint("my_lab.mine") == before
    (package / "mine.py").write_text(
        "from . import parts\nfrom .sums import more as add\nimport os\n\nsize = add(1, 2)\n"
    )
    assert fingerprint("my_lab.mine") != before


@pytest.mark.parametrize(
    "lines",
    [
        ("from .sums import add", "from .parts import add"),
        ("from .sums import *", "from .parts import *"),
        ("add = 1", "from .sums import add"),
    ],
)
def test_the_order_counts_of_imports_that_give_one_name(lines):
    forth, back = (normalised("\n".join(["import os", *some]).encode()) for some in (lines, lines[::-1]))
    assert forth != back


def test_a_source_is_the_same_code_on_every_version_of_python():
    source = b"import b, a\n\nclass A(list):\n    def f(self, *args: int) -> None:\n        print(A(), [], end='')\n"
    assert hashlib.sha256(normalised(source)).hexdigest()[:16] == "132f90aa4bd51624"


@pytest.fixture(scope="module")
def plain():
    """The code of a run that names nothing of anybody's own."""
    return executed_code(Prepared(CONFIG))


def test_every_module_that_a_setting_names_counts(package, plain):
    (package / "nets.py").write_text("def tiny(height, width, depth):\n    return None\n")
    named = dataclasses.replace(CONFIG, algorithm=PPOConfig(encoder="my_lab.nets:tiny"))
    before = executed_code(Prepared(named))
    assert set(before) - set(plain) == {"my_lab/__init__.py", "my_lab/nets.py"}
    edited(package / "nets.py", "None", "1")
    assert differing_parts(before, executed_code(Prepared(named))) == ["my_lab/nets.py"]


def test_the_text_of_an_error_is_no_code_that_a_run_executes(package):
    path = package / "mine.py"
    path.write_text('def check(x):\n    if x < 0:\n        raise ValueError(f"{x} is wrong")\n')
    before = fingerprint("my_lab.mine")
    edited(path, "{x} is wrong", "{x} is less than 0; give another")
    assert fingerprint("my_lab.mine") == before
    edited(path, "x < 0", "x <= 0")
    assert fingerprint("my_lab.mine") != before


def test_an_edit_of_the_library_changes_the_parts_that_execute_it_and_textures_where_they_are_shown(library):
    config = Prepared(dataclasses.replace(CONFIG, observation=ObservationConfig("textures")))

    def edit(*paths: Path) -> dict[str, str]:
        for path in paths:
            path.write_bytes(path.read_bytes() + b"\nmore = 1\n")
        module._library.cache_clear()
        return executed_code(config)

    before = executed_code(config)
    after = edit(*(library / file for file in ("cli/play.py", "rendering/scene.py", "errors.py")))
    assert after == before
    texture = next((library / "textures" / "data").glob("*.npz"))
    for part, path in [
        ("environment", library / "envs/vector.py"), ("environment", library / "observations/protocol.py"),
        ("sampler", library / "levels/distribution.py"), ("textures", texture),
    ]:  # fmt: skip
        before, after = after, edit(path)
        assert differing_parts(before, after) == [part]
    assert "textures" not in executed_code(Prepared(CONFIG))


def test_other_rules_are_another_kernel_and_another_algorithm_is_another_learner(package, plain):
    (package / "levels.py").write_text(
        "import segar\n\n\ndef frictionless():\n    return segar.family('empty-easy').with_rules([segar.move])\n"
    )
    other = dataclasses.replace(CONFIG, levels=dataclasses.replace(CONFIG.levels, train="my_lab.levels:frictionless"))
    changed = ["kernel", "my_lab/__init__.py", "my_lab/levels.py"]
    assert differing_parts(plain, executed_code(Prepared(other))) == changed
    sac = dataclasses.replace(CONFIG, algorithm=SACConfig())
    assert differing_parts(plain, executed_code(Prepared(sac))) == ["learner"]


def test_parts_are_combined_in_any_order():
    assert combined({"a": "1", "b": "2"}) == combined({"b": "2", "a": "1"}) != combined({"a": "2", "b": "1"})
