"""Plug-ins that tests register, a pool of processes without processes, and a run that many tests read."""

import os
import shutil
from concurrent.futures import Executor, Future
from contextlib import contextmanager

import pytest

from segar.experiments.training.run import run
from tests.experiments.short_runs import short_run


class Here(Executor):
    """Does work at once, in this process."""

    def submit(self, fn, /, *args, **kwargs):
        future = Future()
        future.set_result(fn(*args, **kwargs))
        return future


@pytest.fixture
def one_process():
    """The work of a pool is done in this process: where processes are not the point, none is started."""
    with working_here():
        yield


@contextmanager
def working_here():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("segar.experiments.reproduction.process_pool._pool", contextmanager(lambda _: (yield Here())))
        yield


@pytest.fixture(scope="session")
def trained_and_said(tmp_path_factory):
    """The folder of a finished run with the settings of ``short_run``, which is read and never changed, and what it said."""
    said = []
    return run(short_run(tmp_path_factory.mktemp("trained") / "run"), said.append).folder, said


@pytest.fixture(scope="session")
def trained_once(trained_and_said):
    return trained_and_said[0]


@pytest.fixture
def finished(trained_once, tmp_path):
    """The settings of a finished run whose folder, ``run``, is a test's own."""
    shutil.copytree(trained_once, tmp_path / "run")
    return short_run(tmp_path / "run")


@pytest.fixture
def register(tmp_path, monkeypatch):
    """Registers functions by group and name, for this process and for those that it starts."""
    folder = tmp_path / "plugins"
    info = folder / "some_plugins-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: some-plugins\nVersion: 1.0\n")
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setenv(
        "PYTHONPATH", os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
    )

    def registered(group, module="", **functions):
        (folder / "some_plugins.py").write_text(module)
        with (info / "entry_points.txt").open("a") as stream:
            stream.writelines([f"[{group}]\n", *(f"{name} = {value}\n" for name, value in functions.items())])

    return registered
