"""A run folder from somebody else brings no code in, unless the user says so; one's own does."""

import os
import stat
import sys

import pytest
import yaml

from segar.errors import SegarError
from segar.experiments.runs.own_modules import modules_named
from segar.experiments.runs.run_folder import CONFIG, read_config, use_run_folder
from segar.experiments.runs.trust import TRUSTED
from segar.experiments.settings import LevelsConfig, RunConfig, RunFolderError, TrackingConfig, as_data
from segar.support import named_object

OWN = RunConfig(levels=LevelsConfig(train="bad_code:levels"), tracking=TrackingConfig(name="none"))


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """A cache folder of this test's own, so that it has a key of its own."""
    monkeypatch.setenv("SEGAR_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def bad_code(tmp_path, monkeypatch):
    """A module that leaves a file when it is imported."""
    (tmp_path / "bad_code.py").write_text(f"open({str(tmp_path / 'imported')!r}, 'w').close()\nConfig = 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path / "imported"
    sys.modules.pop("bad_code", None)


def folder_of(tmp_path, **changes):
    """A run folder of somebody else's, which is not signed."""
    folder = tmp_path / "theirs"
    folder.mkdir()
    (folder / CONFIG).write_text(yaml.safe_dump({**as_data(RunConfig()), **changes}))
    return folder


@pytest.mark.parametrize(
    ("changes", "module", "place"),
    [
        ({"algorithm": {"_target_": "bad_code.Config"}}, "bad_code", "algorithm._target_"),
        ({"levels": {"train": "bad_code:levels"}}, "bad_code", "levels.train"),
    ],
)
def test_settings_of_others_import_nothing(tmp_path, cache, bad_code, changes, module, place):
    with pytest.raises(RunFolderError, match=f"would be imported: {module}.*{place}.*set {TRUSTED}={module} "):
        read_config(folder_of(tmp_path, **changes))
    assert not bad_code.exists()


def test_a_file_is_not_imported_either_and_its_folder_is_not_searched(tmp_path, cache, bad_code):
    (tmp_path / "lab").mkdir()
    (tmp_path / "bad_code.py").rename(tmp_path / "lab" / "bad_code.py")
    folder = folder_of(
        tmp_path, levels={"design": f"{tmp_path}/lab/bad_code.py:levels"}, module_path=[str(tmp_path / "lab")]
    )
    with pytest.raises(RunFolderError, match=r"bad_code.py:levels \(levels.design\)"):
        read_config(folder)
    with pytest.raises(RunFolderError, match=r"bad_code.py:levels"):
        read_config(folder, {"bad_code"})
    (folder / CONFIG).write_text(
        yaml.safe_dump({"levels": {"design": "bad_code:levels"}, "module_path": [f"{tmp_path}/lab"]})
    )
    read_config(folder, {"bad_code"})
    assert str(tmp_path / "lab") not in sys.path and not bad_code.exists()


def test_a_package_that_is_trusted_is_no_way_to_what_it_imports(tmp_path, monkeypatch):
    (tmp_path / "good_code.py").write_text("import subprocess\nfrom os import system\nimport os.path as place\n")
    monkeypatch.syspath_prepend(tmp_path)
    for attribute in ("subprocess.run", "system", "place.join", "subprocess"):
        with pytest.raises(SegarError, match="which good_code only imports"):
            named_object(f"good_code:{attribute}")
    sys.modules.pop("good_code")


def test_settings_of_others_that_name_no_code_are_read(tmp_path, cache):
    assert read_config(folder_of(tmp_path)) == RunConfig()


@pytest.mark.parametrize("trusted", ["bad_code", "other,bad_code", "*"])
def test_packages_are_trusted_by_a_variable(tmp_path, cache, monkeypatch, trusted):
    monkeypatch.setenv(TRUSTED, trusted)
    assert read_config(folder_of(tmp_path, levels={"train": "bad_code:levels"}))


def test_one_s_own_run_is_read_and_not_after_somebody_changed_its_settings(tmp_path, cache):
    config = RunConfig(**{**vars(OWN), "folder": str(tmp_path / "mine")})
    with use_run_folder(config) as folder:
        assert read_config(folder) == config.resolved()
    path = folder / CONFIG
    path.write_text(path.read_text().replace("bad_code:levels", "worse_code:levels"))
    with pytest.raises(RunFolderError, match="names code that would be imported: worse_code"):
        read_config(folder)


def test_another_user_s_signature_is_none(tmp_path, cache, monkeypatch):
    config = RunConfig(**{**vars(OWN), "folder": str(tmp_path / "mine")})
    with use_run_folder(config) as folder:
        pass
    monkeypatch.setenv("SEGAR_CACHE_DIR", str(tmp_path / "other"))
    with pytest.raises(RunFolderError, match="was not written by you"):
        read_config(folder)
    with use_run_folder(config):  # the command itself names the module
        pass


def test_nobody_else_can_read_the_key(tmp_path, cache):
    with use_run_folder(RunConfig(folder=str(tmp_path / "mine"))):
        pass
    assert stat.S_IMODE(os.stat(cache / "key").st_mode) == 0o600


def test_addresses_and_tags_are_no_modules():
    config = RunConfig(tracking=TrackingConfig(uri="http://host:5000", sweep="wind:first"), root="a:b")
    assert not set(modules_named(as_data(config)))
