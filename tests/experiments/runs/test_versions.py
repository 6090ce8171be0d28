"""What a checkpoint's code is: the learner and all that it imports, wherever that is written."""

import sys

import pytest

from experiments.runs.versions import code_fingerprint, learning_modules


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package of the user's: an algorithm that imports a neighbour, and something that it does not import."""
    folder = tmp_path / "my_lab"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "mine.py").write_text(
        "from experiments.algorithms.ppo import PPO\nfrom . import parts\nfrom .sums import add as plus\n"
    )
    for name in ("parts", "sums", "other"):
        (folder / f"{name}.py").write_text("add = max\n")
    monkeypatch.syspath_prepend(tmp_path)
    yield folder
    for name in [name for name in sys.modules if name.partition(".")[0] == "my_lab"]:
        del sys.modules[name]


def fingerprint():
    code_fingerprint.cache_clear()
    return code_fingerprint("my_lab.mine:Mine")


def test_all_that_a_learner_imports_of_its_package_and_of_ours_counts(package):
    found = learning_modules("my_lab.mine")
    ours = {name for name in found if name.startswith("experiments.")}
    assert {*found} - ours == {"my_lab", "my_lab.mine", "my_lab.parts", "my_lab.sums"}
    assert {"experiments.algorithms.ppo", "experiments.networks.encoders", "experiments.networks.policies"} <= ours
    assert "experiments.settings" not in ours and "experiments.settings.algorithms" not in ours


@pytest.mark.parametrize(("file", "counts"), [("mine", True), ("sums", True), ("other", False)])
def test_an_edit_changes_the_fingerprint_if_the_learner_imports_it(package, file, counts):
    before = fingerprint()
    path = package / f"{file}.py"
    path.write_text(f'"""What it is for."""\n{path.read_text()}  # why\n')
    assert fingerprint() == before
    path.write_text(f"{path.read_text()}more = 1\n")
    assert (fingerprint() != before) == counts


def test_other_textures_are_other_code(package, monkeypatch, tmp_path):
    library = tmp_path / "library"
    (library / "textures").mkdir(parents=True)
    (library / "__init__.py").write_text("")
    (library / "textures" / "one.npz").write_bytes(b"a texture")
    monkeypatch.setattr("segar.__file__", str(library / "__init__.py"))
    before = fingerprint()
    (library / "textures" / "one.npz").write_bytes(b"another one")
    assert fingerprint() != before
    monkeypatch.undo()
    code_fingerprint.cache_clear()
