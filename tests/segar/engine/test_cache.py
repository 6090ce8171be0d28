"""Kernels are files named by their content: the same world compiles once, and an edited rule never runs stale."""

import importlib
import os
import re
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from segar import DEFAULT_RULES, SegarError, World, family, puttputt
from segar.engine import Simulator, StepResult, generate
from segar.engine.compiler import kernel_cache as cache
from segar.engine.compiler.kernel_cache import expected_seconds, load_module
from segar.support import cache_folder, compiled, is_trusted
from tests.places import ROOT
from tests.segar.engine.worlds import start

LAYOUT = family("empty-hard").layout


def source(rules, layout=LAYOUT, **task):
    return generate(layout, World(rules), puttputt(**task).functions()).text


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty cache, of which this process remembers nothing."""
    monkeypatch.setenv("SEGAR_CACHE_DIR", str(tmp_path / "kernels"))
    monkeypatch.setattr(cache, "_loaded", {})
    return tmp_path / "kernels"


def test_all_difficulties_of_a_family_share_a_source():
    texts = {source(DEFAULT_RULES, family(f"objectsx2-{name}").layout) for name in ("easy", "medium", "hard")}
    assert len(texts) == 1


def test_a_second_level_set_or_another_batch_compiles_nothing(sampled, capsys):
    simulator, levels = sampled("objectsx3-hard")
    simulator.act(start(levels), levels, np.zeros((len(levels), 2), np.float32), StepResult.empty(len(levels)))
    compiled = simulator.kernel.module.advance
    capsys.readouterr()
    before = len(compiled.signatures), sum(compiled.stats.cache_misses.values())
    others = family("objectsx3-easy").sample(7, seed=99, split="test")
    again = Simulator(World(), others.layout)
    again.act(start(others, 3), others, np.zeros((21, 2), np.float32), StepResult.empty(21))
    again.step(start(others), others, 3)
    assert again.kernel is simulator.kernel
    assert (len(compiled.signatures), sum(compiled.stats.cache_misses.values())) == before
    assert capsys.readouterr().err == ""


def test_the_same_text_is_one_file_and_one_module(folder, capsys):
    module = load_module("answer = 42\n")
    assert load_module("answer = 42\n") is module and module.answer == 42
    assert load_module("answer = 43\n").answer == 43
    assert len(list(folder.glob("*.py"))) == 2
    assert {path.name for path in folder.iterdir() if path.suffix != ".py"} <= {"__pycache__"}
    assert capsys.readouterr().err == ""  # what is compiled is told, and only an entry is
    load_module(KERNEL)
    assert re.fullmatch(r"segar: compiling kernel \w{4} \(first time, about \d+ s\)\n", capsys.readouterr().err)


def test_longer_kernels_are_expected_to_take_longer():
    short, long = ("".join(f"x{k} = {k}\n" for k in range(n)) for n in (200, 4000))
    assert 0 < expected_seconds(short) < expected_seconds(long)


def test_an_edited_or_damaged_kernel_file_is_written_again(folder, monkeypatch):
    path = load_module("answer = 42\n").__file__
    with open(path, "w") as file:
        file.write("answer = 0\n")
    monkeypatch.setattr(cache, "_loaded", {})
    assert load_module("answer = 42\n").answer == 42


def test_a_cache_that_cannot_be_written_says_what_to_do(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("SEGAR_CACHE_DIR", str(tmp_path / "file" / "kernels"))
    with pytest.raises(SegarError, match=r"kernels cannot be kept in .*; set SEGAR_CACHE_DIR to a folder that can"):
        load_module("answer = 44\n")


def test_the_cache_follows_the_user_s_folders(monkeypatch, tmp_path):
    monkeypatch.delenv("SEGAR_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "segar" / "kernels"
    monkeypatch.setenv("SEGAR_CACHE_DIR", "")
    assert cache_folder() == tmp_path / "segar" / "kernels"


KERNEL = """
from numba import njit

@njit(cache=True)
def advance(x):
    return x + 1
"""
OTHER = KERNEL.replace("1", "2")
OF_A_PACKAGE = "from segar.support import cached\n\n@cached(nogil=True)\ndef double(x):\n    return 2 * x\n"


@pytest.fixture
def anew(folder, monkeypatch):
    """Loads a kernel as a new process does, calls it, and tells how often its machine code was found."""

    def load():
        monkeypatch.setattr(cache, "_loaded", {})
        compiled._say_once.cache_clear()
        module = load_module(KERNEL)
        assert module.advance(41) == 42
        return sum(module.advance.stats.cache_hits.values())

    assert load() == 0 and load() == 1
    return load


def machine_code(folder, suffix, text=KERNEL) -> Path:
    """The only file with that suffix of a kernel."""
    (path,) = (folder / "__pycache__").glob(f"{cache.kernel_path(text).stem}.advance*{suffix}")
    return path


def flip(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def become_folder(path):
    path.unlink()
    (path / "below").mkdir(parents=True)


def become_loop(path):
    path.unlink()
    path.symlink_to(path.name)


def become_another_kernel_s(path):
    load_module(OTHER).advance(41)
    shutil.copy(machine_code(path.parent.parent, path.suffix, OTHER), path)


DAMAGE = {
    "empty": lambda path: path.write_bytes(b""),
    "truncated": lambda path: path.write_bytes(path.read_bytes()[:-40]),
    "one bit": flip,
    "a class that is no more": lambda path: path.write_bytes(b"cno_module\nno_class\n."),
    "another kernel's": become_another_kernel_s,
    "unreadable": lambda path: path.chmod(0),
    "a folder": become_folder,
    "a link in a circle": become_loop,
}


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize("damage", DAMAGE)
def test_damaged_machine_code_is_compiled_again_and_replaced(anew, folder, capfd, damage, suffix):
    path = machine_code(folder, suffix)
    DAMAGE[damage](path)
    capfd.readouterr()
    hits, said = anew(), capfd.readouterr().err.splitlines()
    if damage == "unreadable" and not os.geteuid():
        assert hits == 1 and not said  # root reads everything
        return
    said = [line for line in said if "compiling kernel" not in line]
    assert hits == 0 and said == [f"segar: machine code in {path.parent} is damaged; it is compiled again"]
    assert anew() == 1 and not capfd.readouterr().err


def test_machine_code_that_is_whole_and_cannot_be_used_is_compiled_again(anew, capfd, monkeypatch):
    def other_libraries(*_):
        raise ImportError("no module named as it was")

    capfd.readouterr()
    with monkeypatch.context() as patch:
        patch.setattr(compiled._Kept, "rebuild", other_libraries)
        assert anew() == 0 and capfd.readouterr().err.count("is damaged") == 1
    assert anew() == 1


def test_a_missing_data_file_is_written_again_and_the_compilation_is_said(anew, folder, capfd):
    machine_code(folder, ".nbc").unlink()
    capfd.readouterr()
    assert anew() == 0 and anew() == 1
    assert capfd.readouterr().err.count("compiling kernel") == 1


def test_functions_of_the_package_are_mended_as_well(folder, tmp_path, monkeypatch, capfd):
    (tmp_path / "of_a_package.py").write_text(OF_A_PACKAGE)
    monkeypatch.syspath_prepend(tmp_path)

    def hits():
        sys.modules.pop("of_a_package", None)
        compiled._say_once.cache_clear()
        module = importlib.import_module("of_a_package")
        assert module.double(21) == 42
        return sum(module.double.stats.cache_hits.values())

    assert [hits(), hits()] == [0, 1]
    for path in (folder / "__pycache__").glob("*.nb[ic]"):
        flip(path)
    capfd.readouterr()
    assert hits() == 0 and capfd.readouterr().err.count("\n") == 1 and hits() == 1


def test_a_full_disk_while_compiling_is_told(folder, monkeypatch):
    def full(path, flags, *rest):
        if flags & os.O_CREAT and os.path.splitext(path)[1] in (".nbi", ".nbc"):
            raise OSError(28, "No space left on device")
        return really_open(path, flags, *rest)

    really_open = os.open
    module = load_module(KERNEL)
    with monkeypatch.context() as patch:
        patch.setattr("segar.support.files.os.open", full)
        with pytest.raises(SegarError, match=r"machine code cannot be written to .*: No space left on device"):
            module.advance(1)
    assert load_module(OTHER).advance(1) == 3
    assert not [path for path in folder.rglob("*") if path.name.startswith(".writing-")]


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_the_folder_belongs_to_the_user_alone(folder):
    before = os.umask(0)
    try:
        load_module(KERNEL).advance(1)
    finally:
        os.umask(before)
    assert mode(folder) == 0o700 and mode(folder / "__pycache__") == 0o700


@pytest.mark.parametrize("usual", [False, True])
@pytest.mark.parametrize(("part", "bits"), [("", 0o775), ("", 0o757), ("", 0o1777), ("__pycache__", 0o777)])
def test_a_folder_to_which_others_write_is_refused_and_left_alone(folder, monkeypatch, tmp_path, part, bits, usual):
    if usual:
        monkeypatch.delenv("SEGAR_CACHE_DIR", raising=False)
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
        folder = tmp_path / "segar" / "kernels"
    (folder / part).mkdir(parents=True)
    (folder / part).chmod(bits)
    with pytest.raises(SegarError, match=r"others can write to .*chmod go-w .*, or set SEGAR_CACHE_DIR"):
        load_module(KERNEL)
    assert mode(folder / part) == bits


@pytest.mark.parametrize("part", ["", "__pycache__"])
def test_ready_kernels_are_trusted_where_nobody_else_can_write(folder, part):
    load_module(KERNEL)
    assert is_trusted(folder)
    (folder / part).chmod(0o770)
    assert not is_trusted(folder)


@pytest.mark.parametrize("part", ["", "__pycache__"])
def test_the_folder_of_another_user_is_refused(folder, monkeypatch, part):
    load_module(KERNEL)
    if os.geteuid():
        me = os.geteuid()
        monkeypatch.setattr(os, "geteuid", lambda: me + 1)
    else:
        os.chown(folder / part, 65534, -1)
    monkeypatch.setattr(cache, "_loaded", {})
    with pytest.raises(SegarError, match=r"belongs to .*, whose kernels would run as you; set SEGAR_CACHE_DIR"):
        load_module(KERNEL)


def test_numba_s_own_setting_does_not_lead_kernels_elsewhere(folder, tmp_path, monkeypatch):
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path / "shared"))
    load_module(KERNEL).advance(1)
    assert machine_code(folder, ".nbi").is_file() and not list((tmp_path / "shared").rglob("*.nb[ic]"))


NOBODY = 12345  # no user of this machine
AS_NOBODY = (
    *("setpriv", "--reuid", str(NOBODY), "--regid", str(NOBODY), "--clear-groups"),
    # What the interpreter needs may lie in root's home: everything can be read, and nothing can be written.
    *("--inh-caps", "+dac_read_search", "--ambient-caps", "+dac_read_search", "env", "-i", "PATH=/usr/bin:/bin"),
)


@pytest.fixture
def as_nobody(tmp_path):
    """Runs a program as a user whom the machine does not know, without a home; returns what it printed on both streams."""
    if os.geteuid() or subprocess.run([*AS_NOBODY, "true"], check=False, capture_output=True).returncode:
        pytest.skip("only root, with setpriv, can run programs as other users")
    (tmp_path / "package.py").write_text(OF_A_PACKAGE)
    program = (
        "import segar, segar.support, package\n"
        "from segar.engine.compiler.kernel_cache import load_module\n"
        f"module = load_module({KERNEL.replace('cache=True', 'nogil=True, cache=True')!r})\n"
        "assert (module.advance(41), package.double(21)) == (42, 42)\n"
        "print([sum(one.stats.cache_hits.values()) for one in (module.advance, package.double)])\n"
    )
    # The package lies in a folder of root's, and so does its machine code.
    shared = {"PYTHONPATH": f"{ROOT}:{tmp_path}", "PYTHONDONTWRITEBYTECODE": "1", "SEGAR_CACHE_DIR": ""}

    def run(user=AS_NOBODY, program=program, **variables):
        values = [f"{name}={value}" for name, value in {**shared, "TMPDIR": tmp_path / "tmp", **variables}.items()]
        done = subprocess.run(
            [*user, *values, sys.executable, "-c", program], check=True, capture_output=True, text=True
        )
        return done.stdout.strip(), done.stderr

    for name, its_mode in {"": 0o755, "tmp": 0o1777, "mine": 0o755, "ready": 0o755}.items():
        (tmp_path / name).mkdir(exist_ok=True)
        (tmp_path / name).chmod(its_mode)
    os.chown(tmp_path / "mine", NOBODY, -1)
    return run


def test_a_user_without_a_home_keeps_kernels_in_the_temporary_folder_and_is_told(as_nobody, tmp_path):
    hits, said = as_nobody()
    assert hits == "[0, 0]" and f"machine code is kept in {tmp_path}/tmp/segar-{NOBODY}" in said
    assert mode(tmp_path / "tmp" / f"segar-{NOBODY}") == 0o700
    assert as_nobody(HOME="/") == ("[1, 1]", "")  # a home that cannot be written is none


def test_a_user_s_own_folder_holds_what_is_compiled(as_nobody, tmp_path):
    assert as_nobody(SEGAR_CACHE_DIR=tmp_path / "mine")[0] == "[0, 0]"
    assert len(list((tmp_path / "mine" / "__pycache__").glob("*.nbi"))) == 2 and not list((tmp_path / "tmp").iterdir())


def test_kernels_that_root_made_ready_are_read(as_nobody, tmp_path):
    assert as_nobody(("env",), SEGAR_CACHE_DIR=tmp_path / "ready")[0] == "[0, 0]"
    assert as_nobody(SEGAR_CACHE_DIR=tmp_path / "ready", TMPDIR=tmp_path / "package.py") == ("[1, 1]", "")
    for damaged in (tmp_path / "ready").rglob("*.nbi"):
        flip(damaged)
    found, said = as_nobody(SEGAR_CACHE_DIR=tmp_path / "ready")
    assert found == "[0, 0]" and f"machine code in {tmp_path}/ready/__pycache__ is damaged" in said
    assert as_nobody(SEGAR_CACHE_DIR=tmp_path / "ready")[0] == "[1, 1]"  # kept in the user's folder


def test_ready_kernels_to_which_others_can_write_are_refused(as_nobody, tmp_path):
    """All in one process, since each takes a second to start."""
    for part in ("", "__pycache__"):
        for name, owner, bits in ((f"open{part}", 0, 0o757), (f"strange{part}", 4321, 0o755)):
            (tmp_path / name / "__pycache__").mkdir(parents=True)
            os.chown(tmp_path / name / part, owner, -1)
            (tmp_path / name / part).chmod(bits)
    program = (
        "import os, sys\nfrom segar.errors import SegarError\nfrom segar.engine.compiler.kernel_cache import load_module\n"
        "for name in ('open', 'strange', 'open__pycache__', 'strange__pycache__'):\n"
        f"    os.environ['SEGAR_CACHE_DIR'] = '{tmp_path}/' + name\n"
        "    try:\n        load_module('answer = 42')\n    except SegarError as error:\n        print(error)\n"
    )
    said = as_nobody(program=program)[0].splitlines()
    assert ["others can write to" in line for line in said] == [True, False] * 2
    assert ["belongs to user 4321, whose kernels would run as you" in line for line in said] == [False, True] * 2


def test_no_function_of_the_package_is_kept_by_numba_s_own_cache():
    found = [path for path in (ROOT / "segar").rglob("*.py") if '"cache": True' in path.read_text(encoding="utf-8")]
    assert found == []
