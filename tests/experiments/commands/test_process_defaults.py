"""What a process is told before it computes: sleeping threads, as many as asked for, and a heap that keeps its memory."""

import json
import subprocess
import sys

from tests.places import ROOT

NO_RUNS = ("__init__",)
COMMANDS = sorted({path.stem for path in (ROOT / "experiments").glob("*.py")} - {*NO_RUNS})
SCRIPT = """
import json, resource
from segar.experiments.commands.process_defaults import set_process_defaults
set_process_defaults(2)
import torch
def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(20):
        torch.ones(8 << 20)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before
faults()  # the heap grows to what is needed
print(json.dumps({"faults": faults(), "threads": torch.get_num_threads()}))
"""


def test_a_process_keeps_its_memory_and_has_the_threads_that_were_asked_for():
    """A tensor of 32 MB is 8192 pages; returned to the system after each use, all of them would fault again."""
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True)
    said = json.loads(done.stdout.splitlines()[-1])
    assert said["threads"] == 2
    assert said["faults"] < 1000


def test_threads_of_openmp_sleep_unless_the_user_says_otherwise():
    ask = "import os; import segar.experiments.commands.process_defaults; print(os.environ['OMP_WAIT_POLICY'])"

    def policy(**environment):
        done = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True, env=environment)
        return done.stdout.strip()

    assert policy() == "passive"
    assert policy(OMP_WAIT_POLICY="active") == "active"


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


def test_what_one_run_leaves_behind_is_found_before_the_next():
    """Objects that are loaded are passed over by later searches; those of a run are not, however many runs there are."""
    script = (
        "import gc, weakref; from segar.experiments.commands.process_defaults import set_process_defaults\n"
        "class Ring: pass\n"
        "set_process_defaults(); ring = Ring(); ring.itself = ring; left = weakref.ref(ring); del ring\n"
        "set_process_defaults(); gc.collect(); print(left())"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "None"
