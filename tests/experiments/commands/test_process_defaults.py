"""What a process is told before it computes: sleeping threads, as many as asked for, and a heap that keeps its memory."""

import json
import os
import subprocess
import sys

import pytest

from tests.places import ROOT

NO_RUNS = ("__init__",)
COMMANDS = sorted({path.stem for path in (ROOT / "experiments").glob("*.py")} - {*NO_RUNS})
SCRIPT = """
import json, os, resource, weakref
from segar.experiments.commands.process_defaults import set_process_defaults
set_process_defaults(2)
import torch
class Ring:
    pass
def left_behind():
    ring = Ring()
    ring.itself = ring
    return weakref.ref(ring)
def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(20):
        torch.ones(8 << 20)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before
faults()  # the heap grows to what is needed
said = {"faults": faults(), "threads": torch.get_num_threads(), "policy": os.environ["OMP_WAIT_POLICY"]}
left = left_behind()
set_process_defaults(2)  # as the next run does
print(json.dumps({**said, "left": left() is not None}))
"""


@pytest.fixture(scope="module")
def said():
    """What a process that runs two trainings in turn finds, whose user has chosen how threads of OpenMP wait."""
    environment = {**os.environ, "OMP_WAIT_POLICY": "active"}
    done = subprocess.run([sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def test_a_process_keeps_its_memory_and_has_the_threads_that_were_asked_for(said):
    """A tensor of 32 MB is 8192 pages; returned to the system after each use, all of them would fault again."""
    assert said["threads"] == 2
    assert said["faults"] < 1000


def test_how_threads_of_openmp_wait_is_for_the_user_to_say(said):
    assert said["policy"] == "active"


def test_every_command_sets_them_before_torch_is_imported():
    script = (
        "import importlib, os, sys\n"
        "for command in sys.argv[1:]:\n"
        "    os.environ.pop('OMP_WAIT_POLICY', None)\n"
        "    for name in [name for name in sys.modules if name.startswith('segar.experiments')]: del sys.modules[name]\n"
        "    importlib.import_module(f'segar.experiments.{command}')\n"
        "    print(command, os.environ.get('OMP_WAIT_POLICY'), 'torch' in sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", script, *COMMANDS], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [f"{command} passive False" for command in COMMANDS]


def test_what_one_run_leaves_behind_is_found_before_the_next(said):
    """Objects that are loaded are passed over by later searches; those of a run are not, however many runs there are."""
    assert not said["left"]
