"""The record of the data files that a user's own modules read."""

import importlib
import linecache
import py_compile
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

import segar
from experiments.settings.files_read import data_read, data_to_read, file_digest, source_name

READER = "from pathlib import Path\nHERE = Path(__file__).parent\n\n\ndef read(name):\n    return (HERE / name).read_text()\n"
LEVELS = "from some_lab.reader import read\nWIDTH = read('width.json')\n\n\ndef late():\n    return read('late.json')\n"


@pytest.fixture
def lab(tmp_path_factory, monkeypatch):
    """The folder of a package whose module ``levels`` reads one file when it is imported and another one when it is called."""
    folder = tmp_path_factory.mktemp("lab") / "some_lab"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "reader.py").write_text(READER)
    (folder / "levels.py").write_text(LEVELS)
    for name in ("width", "late", "other"):
        (folder / f"{name}.json").write_text("1")
    monkeypatch.syspath_prepend(folder.parent)
    yield folder
    for name in [name for name in sys.modules if name.partition(".")[0] == "some_lab"]:
        del sys.modules[name]


def read_by(lab, *modules):
    return data_read([lab / f"{name}.py" for name in modules or ("levels", "reader")])


def called(function, *arguments):
    """Calls a function as a run does: with no own module beneath it that the run does not reach, such as this one."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(function, *arguments).result()


def test_what_modules_read_when_they_are_imported_and_called_is_recorded_with_its_content(lab):
    levels = importlib.import_module("some_lab.levels")
    assert read_by(lab) == {"some_lab/width.json": file_digest(lab / "width.json")}
    called(levels.late)
    assert read_by(lab) == {f"some_lab/{name}.json": file_digest(lab / "late.json") for name in ("width", "late")}


def test_files_belong_to_all_modules_that_had_them_read(lab):
    called(importlib.import_module("some_lab.levels").late)
    called(importlib.import_module("some_lab.reader").read, "other.json")
    all_data = {"some_lab/width.json", "some_lab/late.json", "some_lab/other.json"}
    assert {*read_by(lab)} == all_data
    assert {*read_by(lab, "reader")} == {"some_lab/other.json"}
    assert {*read_by(lab, "levels")} == {"some_lab/reader.py", *all_data}  # it loaded the reader


def test_what_begins_after_an_edit_reads_anew_what_functions_read_and_not_what_imports_read(lab):
    called(importlib.import_module("some_lab.levels").late)
    before = read_by(lab)
    for name in ("width", "late"):
        (lab / f"{name}.json").write_text("22")
    assert read_by(lab) == before
    assert data_to_read([lab / "levels.py", lab / "reader.py"]) == {
        **before,
        "some_lab/late.json": file_digest(lab / "late.json"),
    }


@pytest.mark.parametrize(
    "code",
    [
        "open(HERE / 'made.txt', 'w').close()",
        "(HERE / 'absent.txt').exists()",
        "(HERE / '.cache.json').write_text('1'), (HERE / '.cache.json').read_text()",
        "__import__('segar').family('empty-easy').sample(1)",
        "Path('/proc/self/status').read_text()",
        "import email.mime.text",
    ],
)
def test_what_is_written_hidden_a_librarys_or_the_systems_is_no_data(lab, code):
    (lab / "levels.py").write_text(f"from pathlib import Path\nHERE = Path(__file__).parent\n{code}\n")
    importlib.import_module("some_lab.levels")
    assert not read_by(lab)


def test_levels_that_own_code_loads_are_data(lab):
    segar.family("empty-easy").sample(2).save(lab / "kept.npz")
    (lab / "levels.py").write_text(
        "from pathlib import Path\nimport segar\nX = segar.Levels.load(Path(__file__).parent / 'kept.npz')\n"
    )
    importlib.import_module("some_lab.levels")
    assert read_by(lab) == {"some_lab/kept.npz": file_digest(lab / "kept.npz")}


def test_data_that_a_library_opens_for_own_code_count(lab):
    code = "import numpy as np\nfrom pathlib import Path\nPLACE = Path(__file__).parent / 'x.npy'\n"
    (lab / "levels.py").write_text(f"{code}np.save(PLACE, np.ones(3))\nX = np.load(PLACE)\n")
    importlib.import_module("some_lab.levels")
    assert {*read_by(lab)} == {"some_lab/x.npy"}


def test_data_far_from_the_module_have_the_working_directory_or_the_whole_path_in_their_name(
    lab, tmp_path, monkeypatch
):
    far, work = tmp_path / "far.json", tmp_path / "work"
    far.write_text("1")
    work.mkdir()
    (work / "near.json").write_text("1")
    monkeypatch.chdir(work)
    reader = importlib.import_module("some_lab.reader")
    for path in (far, work / "near.json"):
        called(reader.read, path)
    assert {*read_by(lab)} == {str(far), "./near.json"}


def test_source_files_are_named_from_the_folder_that_they_are_imported_from(lab):
    assert source_name("some_lab.levels", lab / "levels.py") == "some_lab/levels.py"
    assert source_name("some_lab", lab / "__init__.py") == "some_lab/__init__.py"
    assert source_name("alone", lab / "alone.py") == "./alone.py"


LOADS = "import importlib, importlib.util, runpy, sys\nfrom pathlib import Path\nHERE = Path(__file__).parent\nNAME = 'late'\n"
FROM_FILE = (
    "s = importlib.util.spec_from_file_location('odd', HERE / 'late.py'); it = importlib.util.module_from_spec(s); "
)
MEANS = {
    "import_module": "it = importlib.import_module(f'some_lab.{NAME}')",
    "__import__": "it = __import__(f'some_lab.{NAME}', fromlist=['WIDTH'])",
    "exec_module": FROM_FILE + "s.loader.exec_module(it)",
    "exec_module, registered": FROM_FILE + "sys.modules['odd'] = it; s.loader.exec_module(it)",
    "run_path": "runpy.run_path(str(HERE / 'late.py'))",
    "exec of text": "exec((HERE / 'late.py').read_text(), {})",
}


@pytest.mark.parametrize("is_compiled", [False, True], ids=["first time", "compiled before"])
@pytest.mark.parametrize("place", ["top", "function"])
@pytest.mark.parametrize("load", MEANS.values(), ids=MEANS)
def test_a_module_that_is_loaded_by_any_means_is_recorded_with_what_it_reads(
    lab, load, place, is_compiled, monkeypatch
):
    code = "from pathlib import Path\nWIDTH = (Path(__file__).parent / 'width.json').read_text()\n"
    code = "WIDTH = 1\n" if "exec((" in load else code  # such text has no file
    (lab / "late.py").write_text(code)
    (lab / "levels.py").write_text(f"{LOADS}{load}\n" if place == "top" else f"{LOADS}def late():\n    {load}\n")
    monkeypatch.setattr("sys.dont_write_bytecode", False)
    if is_compiled:
        py_compile.compile(str(lab / "late.py"))
    levels = importlib.import_module("some_lab.levels")
    if place == "function":
        called(levels.late)
    sys.modules.pop("odd", None)
    found = read_by(lab, "levels")
    assert found["some_lab/late.py"] == file_digest(lab / "late.py")
    assert ("some_lab/width.json" in found) == ("exec((" not in load)
    (lab / "late.py").write_text('"""Why."""\n' + code)
    assert found["some_lab/late.py"] == file_digest(lab / "late.py")
    (lab / "late.py").write_text(code + "DEPTH = 2\n")
    assert found["some_lab/late.py"] != file_digest(lab / "late.py")


def test_what_a_loaded_module_loads_is_recorded_for_those_who_loaded_it(lab):
    (lab / "late.py").write_text("from some_lab import deep\n")
    (lab / "deep.py").write_text("from some_lab.reader import read\nread('other.json')\n")
    (lab / "levels.py").write_text(f"{LOADS}{MEANS['import_module']}\n")
    importlib.import_module("some_lab.levels")
    expected = {f"some_lab/{name}" for name in ("late.py", "deep.py", "reader.py", "other.json")}
    assert {*read_by(lab, "levels")} == expected
    assert not read_by(lab, "other")


@pytest.mark.parametrize(
    "code",
    [
        "import warnings\nwarnings.formatwarning('odd', UserWarning, str(HERE / 'reader.py'), 1)",
        "import traceback\ntry:\n    exec(compile('1 / 0', str(HERE / 'reader.py'), 'exec'))\n"
        "except ZeroDivisionError:\n    traceback.format_exc()",
    ],
    ids=["warning", "traceback"],
)
def test_source_that_a_warning_or_a_traceback_shows_is_not_read(lab, code):
    linecache.clearcache()
    (lab / "levels.py").write_text(f"from pathlib import Path\nHERE = Path(__file__).parent\n{code}\n")
    importlib.import_module("some_lab.levels")
    assert not read_by(lab, "levels")


def test_a_line_that_own_code_reads_through_linecache_is_read_also_after_an_edit(lab):
    (lab / "levels.py").write_text(
        "import linecache\nfrom pathlib import Path\n\n\ndef line():\n"
        "    return linecache.getline(str(Path(__file__).parent / 'late.json'), 1)\n"
    )
    line = importlib.import_module("some_lab.levels").line
    assert called(line) == "1\n"
    assert read_by(lab) == {"some_lab/late.json": file_digest(lab / "late.json")}
    (lab / "late.json").write_text("22")
    assert data_to_read([lab / "levels.py"]) == {"some_lab/late.json": file_digest(lab / "late.json")}
    assert called(line) == "22\n"


def test_a_file_of_another_language_with_the_suffix_of_python_counts_as_it_is(lab):
    (lab / "late.py").write_text("{{ no python }}")
    (lab / "levels.py").write_text("from some_lab.reader import read\nX = read('late.py')\n")
    importlib.import_module("some_lab.levels")
    found = read_by(lab)["some_lab/late.py"]
    (lab / "late.py").write_text("{{ nothing }}")
    assert found != file_digest(lab / "late.py")
