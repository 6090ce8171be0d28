"""Which files of the user's own a run is made by: each case is a module, a file that is edited, and whether that counts."""

import importlib.util
import os
import sys

import pytest

from segar.experiments.runs import own_files as module
from segar.experiments.runs import source_text
from segar.experiments.runs.own_files import own_files
from segar.experiments.runs.own_modules import find_file
from segar.experiments.settings import ConfigError
from segar.support import named_object

HERE = (
    "import json, importlib, importlib.util, os, pkgutil, runpy, sys\n"
    "from pathlib import Path\nHERE = Path(__file__).parent\n"
)
SPEC = (
    "spec = importlib.util.spec_from_file_location('odd', HERE / 'late.py'); it = importlib.util.module_from_spec(spec)"
)
# What lab/levels.py says, and the file that is edited.
COUNTS = {
    "module itself": ("", "lab/levels.py"),
    "package": ("", "lab/__init__.py"),
    "import": ("from lab import late", "lab/late.py"),
    "relative import": ("from .late import WIDTH", "lab/late.py"),
    "import in a function": ("def late():\n    import lab.late", "lab/late.py"),
    "import of an import": ("from lab import late", "lab/deep.py"),
    "module beside the package": ("import beside", "beside.py"),
    "import_module": ("it = importlib.import_module(f'lab.{NAME}')", "lab/late.py"),
    "what import_module's module reads": ("it = importlib.import_module(f'lab.{NAME}')", "lab/deep.json"),
    "__import__": ("it = __import__(f'lab.{NAME}', fromlist=['WIDTH'])", "lab/late.py"),
    "exec_module": (f"{SPEC}; spec.loader.exec_module(it)", "lab/late.py"),
    "run_path": ("runpy.run_path(str(HERE / 'late.py'))", "lab/late.py"),
    "exec of a text": ("exec((HERE / 'late.py').read_text(), {})", "lab/late.py"),
    "all modules of the package": ("for one in pkgutil.iter_modules([str(HERE)]): it = one", "lab/late.py"),
    "data read at import": ("WIDTH = json.loads((HERE / 'width.json').read_text())", "lab/width.json"),
    "data in a folder above": ("NAME = HERE.parent / 'top.json'", "top.json"),
    "data whose name is made": ("def late(name):\n    return (HERE / f'{name}.json').read_text()", "lab/width.json"),
    "data whose suffix is added": ("def late(name):\n    return HERE / (name + '.json')", "lab/width.json"),
    "data whose name is formatted": ("def late(k):\n    return HERE / 'wi{}.json'.format(k)", "lab/width.json"),
    "data of a list of the folder": ("FOUND = [one.read_bytes() for one in HERE.iterdir()]", "lab/width.json"),
    "data in the working directory": ("def late():\n    return open('near.json').read()", "../work/near.json"),
    "data in a place of its own": ("def late():\n    return open('{else}/far.json').read()", "../else/far.json"),
    "data without a suffix": ("X = (HERE / 'table').read_text()", "lab/table"),
    "data in a folder of a folder": ("X = HERE / 'data' / 'raw' / 'old.csv'", "lab/data/raw/old.csv"),
    "data in a folder of another module": ("from lab.late import DATA\nX = DATA / 'far.json'", "lab/data/far.json"),
    "data of an imported package": (
        "from importlib.resources import files\nX = files('lab.data') / 'far.json'",
        "lab/data/far.json",
    ),
    "data of a number with zeros": ("def late(k):\n    return HERE / ('wi%03dth.json' % k)", "lab/width.json"),
    "all that a package exports": ("from lab.data import *", "lab/data/kinds.py"),
    "import_module by another name": (
        "from importlib import import_module as load\nit = load('lab.' + NAME)",
        "lab/late.py",
    ),
    "list by another name": ("from os import listdir as ls\nFOUND = ls(HERE)", "lab/width.json"),
    "data beside the folder of sources": ("X = HERE.parents[1] / 'else' / 'far.json'", "../else/far.json"),
    "no Python with the suffix of Python": ("TEXT = (HERE / 'template.py').read_text()", "lab/template.py"),
}
NAMES = {  # of files that are not in the package
    "beside.py": "./beside.py", "top.json": "./top.json", "../work/near.json": "./near.json",
    "../else/far.json": "{else}/far.json",
}  # fmt: skip
COUNTS_NOT = {
    "module that nobody imports": ("", "lab/late.py"),
    "data that nobody reads": ("X = 1", "lab/width.json"),
    "hidden data": ("X = HERE / '.cache.json'", "lab/.cache.json"),
    "results in the package": ("X = HERE / 'lab' / 'played.json'", "lab/run/played.json"),
    "installed module": ("import pytest", "lab/width.json"),
    "file of the system": ("X = open('/proc/self/status').read()", "lab/width.json"),
}  # fmt: skip


@pytest.fixture
def lab(tmp_path_factory, monkeypatch):
    """A folder with the package ``lab``, some data, and a module beside it."""
    folder = tmp_path_factory.mktemp("place") / "src"
    for name in ("lab/data/raw", "lab/run", "../work", "../else"):
        (folder / name).mkdir(parents=True)
    (folder / "lab" / "__init__.py").touch()
    (folder / "lab" / "late.py").write_text(f"{HERE}from lab.deep import DEPTH\nWIDTH = 1\nDATA = HERE / 'data'\n")
    (folder / "lab" / "deep.py").write_text(f"{HERE}DEPTH = json.loads((HERE / 'deep.json').read_text())\n")
    (folder / "lab" / "data" / "__init__.py").write_text("__all__ = ['kinds']\n")
    (folder / "lab" / "data" / "kinds.py").write_text("FAR = 1\n")
    (folder / "beside.py").write_text("GAIN = 1\n")
    (folder / "lab" / "template.py").write_text("{{ no python }}")
    data = ("lab/width.json", "lab/deep.json", "lab/data/far.json", "top.json", "../work/near.json", "../else/far.json")
    more = (
        "lab/table",
        "lab/data/raw/old.csv",
        *(f"lab/run/{n}" for n in ("config.yaml", "journal.jsonl", "played.json")),
    )
    for name in (*data, *more, "lab/.cache.json"):
        (folder / name).write_text("1")
    monkeypatch.syspath_prepend(folder)
    monkeypatch.chdir(folder.parent / "work")
    yield folder
    for name in [name for name in sys.modules if name.partition(".")[0] in ("lab", "beside")]:
        del sys.modules[name]


def written(lab, code):
    (lab / "lab" / "levels.py").write_text(f"{HERE}NAME = 'late'\n{code.replace('{else}', str(lab.parent / 'else'))}\n")


def edit(path):
    """Adds something that counts."""
    path.write_bytes(path.read_bytes() + (b"\nMORE = 1\n" if path.suffix == ".py" else b" "))


@pytest.mark.parametrize(("code", "file"), COUNTS.values(), ids=COUNTS)
def test_a_file_that_the_code_reaches_counts(lab, code, file, monkeypatch):
    for one in (module, source_text):  # nothing of it is imported, and to look for that takes most of the time
        monkeypatch.setattr(one, "imported_from", lambda path: None)
    written(lab, code)
    before = own_files("lab.levels")
    edit(lab / file)
    after = own_files("lab.levels")
    assert len({find_file(name) for name in before}) == len(before)
    changed = [name for name in before if before[name] != after.get(name)]
    assert [find_file(name) for name in changed] == [(lab / file).resolve()]
    assert changed == [(NAMES.get(file) or file).replace("{else}", str(lab.parent / "else"))]


@pytest.mark.parametrize(("code", "file"), COUNTS_NOT.values(), ids=COUNTS_NOT)
def test_a_file_that_the_code_does_not_reach_does_not_count(lab, code, file):
    written(lab, code)
    before = own_files("lab.levels")
    edit(lab / file)
    assert own_files("lab.levels") == before
    assert {*before} == {"lab/__init__.py", "lab/levels.py"}


def test_results_do_not_count_in_a_package_that_lists_folders(lab):
    written(lab, "X = [*HERE.iterdir()]")
    (lab / "lab" / "mlflow.db").touch()
    assert {name for name in own_files("lab.levels") if "run/" in name or "mlflow" in name} == set()


def test_modules_without_a_package_and_the_data_beside_them_count(lab):
    (lab / "alone.py").write_text(f"{HERE}import beside\nX = HERE / 'top.json'\n")
    assert {*own_files("alone")} == {"./alone.py", "./beside.py", "./top.json"}


def test_what_an_option_names_counts(lab):
    written(lab, "def task(file):\n    return (HERE / file).read_text()")
    assert "lab/width.json" not in own_files("lab.levels")
    assert "lab/width.json" in own_files("lab.levels", ["width.json", "no file", ""])


@pytest.mark.parametrize("installed", [False, True])
def test_modules_beside_count_and_installed_ones_do_not(lab, installed, monkeypatch):
    written(lab, "import beside")
    if installed:
        monkeypatch.setattr("sysconfig.get_path", lambda kind: str(lab))
    assert ("./beside.py" in own_files("lab.levels")) != installed


@pytest.mark.parametrize("file", ["lab/late.py", "lab/width.json"])
def test_an_edit_after_the_import_is_refused_until_a_new_process_imports_it(lab, file):
    written(lab, "from lab import late\nWIDTH = (HERE / 'width.json').read_text()")
    importlib.import_module("lab.levels")
    before = own_files("lab.levels")
    assert own_files("lab.levels") == before
    os.utime(lab / file)
    assert own_files("lab.levels") == before
    edit(lab / file)
    with pytest.raises(ConfigError, match=f"{file} has changed since this process imported lab.levels"):
        own_files("lab.levels")
    for name in ("lab.levels", "lab.late"):
        del sys.modules[name]
    importlib.import_module("lab.levels")
    assert own_files("lab.levels") != before


@pytest.mark.parametrize("file", ["lab/levels.py", "lab/deep.py", "beside.py"])
def test_an_edit_between_the_import_and_the_first_look_is_refused(lab, file):
    written(lab, "from lab import late\nimport beside")
    importlib.import_module("lab.levels")
    edit(lab / file)
    with pytest.raises(ConfigError, match=f"{NAMES.get(file, file)} has changed since .* imported lab.levels"):
        own_files("lab.levels")


@pytest.mark.parametrize("file", ["lab/late.py", "lab/width.json"])
def test_an_edit_of_what_two_modules_share_is_refused_for_the_second(lab, file):
    (lab / "lab" / "late.py").write_text(f"{HERE}WIDTH = json.loads((HERE / 'width.json').read_text())\n")
    for name in ("levels", "tasks"):
        (lab / "lab" / f"{name}.py").write_text("from lab import late\n")
        importlib.import_module(f"lab.{name}")
    own_files("lab.levels")
    edit(lab / file)
    with pytest.raises(ConfigError, match=f"{file} has changed since this process imported lab.tasks"):
        own_files("lab.tasks")


def test_an_edit_of_a_module_that_was_imported_by_another_name_is_refused(lab, monkeypatch):
    written(lab, "WIDTH = 1")
    monkeypatch.syspath_prepend(lab / "lab")
    named_object("levels:WIDTH")
    assert named_object("lab.levels:WIDTH") == 1 and "lab.levels" not in sys.modules
    edit(lab / "lab" / "levels.py")
    with pytest.raises(ConfigError, match=r"lab/levels\.py has changed"):
        own_files("lab.levels")
    del sys.modules["levels"]


class Editable:
    """Finds ``lab`` as the finders of some editable installations do, outside of Python's path."""

    def __init__(self, folder):
        self.folder = folder

    def find_spec(self, name, path=None, target=None):
        file = self.folder / "lab" / "__init__.py"
        if name == "lab":
            return importlib.util.spec_from_file_location(name, file, submodule_search_locations=[str(file.parent)])
        return None


@pytest.mark.parametrize("file", ["lab/levels.py", "lab/width.json"])
def test_an_edit_of_a_package_that_another_finder_imported_is_refused(lab, file, monkeypatch):
    written(lab, "WIDTH = (HERE / 'width.json').read_text()")
    monkeypatch.setattr("sys.path", [one for one in sys.path if one != str(lab)])
    monkeypatch.setattr("sys.meta_path", [*sys.meta_path, Editable(lab)])
    importlib.import_module("lab.levels")
    own_files("lab.levels")
    edit(lab / file)
    with pytest.raises(ConfigError, match=f"{file} has changed since this process imported lab.levels"):
        own_files("lab.levels")


def test_data_that_are_gone_after_the_import_are_refused(lab):
    written(lab, "WIDTH = (HERE / 'width.json').read_text()")
    importlib.import_module("lab.levels")
    own_files("lab.levels")
    (lab / "lab" / "width.json").unlink()
    with pytest.raises(ConfigError, match=r"lab/width\.json has changed"):
        own_files("lab.levels")


def test_an_edit_of_equal_length_that_keeps_the_time_of_the_file_counts(lab):
    written(lab, "WIDTH = (HERE / 'width.json').read_text()")
    file = lab / "lab" / "width.json"
    before, about = own_files("lab.levels"), file.stat()
    file.write_text("2")
    os.utime(file, ns=(about.st_atime_ns, about.st_mtime_ns))
    assert own_files("lab.levels") != before
