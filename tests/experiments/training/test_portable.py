"""determinism=portable: the same weights whatever instruction set the libraries are held to; and where it is refused."""

import json
import os
import subprocess
import sys

import pytest

from segar.experiments.commands.kernels import LIMITS, PORTABLE
from segar.experiments.settings.processor import lacks_for_portable
from segar.support import WORKSPACE
from tests.experiments.training.portable_runs import ALGORITHMS

pytestmark = pytest.mark.skipif(bool(lacks_for_portable()), reason="this processor lacks the portable kernels")
# What a processor without AVX would choose, of all libraries that have a choice. Torch's are three of them, and the numbers
# of numpy and of the kernels that numba compiles go into the weights, too.
OLD = {
    "ATEN_CPU_CAPABILITY": "default",
    "ONEDNN_MAX_CPU_ISA": "SSE41",
    "MKL_CBWR": "AUTO",
    "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR",
}
OLD_AND_COMPILED = {**OLD, "NUMBA_CPU_NAME": "nehalem"}  # compiles all kernels again


def python(*arguments, limits=None):
    """Calls Python from the checkout with these limits alone."""
    environment = {name: value for name, value in os.environ.items() if name not in LIMITS}
    environment |= {**(limits or {}), "PYTHONPATH": str(WORKSPACE)}
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, env=environment, cwd=WORKSPACE)


def hashes(determinism, *names, limits=None):
    done = python("-m", "tests.experiments.training.portable_runs", determinism, *names, limits=limits)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_a_portable_run_has_the_same_weights_under_two_limits():
    assert hashes("portable", "ppo") == hashes("portable", "ppo", limits=OLD)


@pytest.mark.slow
def test_a_portable_run_of_each_algorithm_has_the_same_weights_under_two_limits():
    assert hashes("portable", *ALGORITHMS) == hashes("portable", *ALGORITHMS, limits=OLD_AND_COMPILED)


@pytest.mark.slow
def test_without_it_the_limits_change_the_weights_of_each_algorithm():
    here, there = hashes("machine", *ALGORITHMS), hashes("machine", *ALGORITHMS, limits=OLD_AND_COMPILED)
    assert [name for name in ALGORITHMS if here[name] == there[name]] == []


CHOOSE = "from segar.experiments.commands.kernels import choose_kernels; choose_kernels('{}')"


@pytest.mark.slow
def test_where_torch_has_its_kernels_already_portable_is_refused_with_what_to_do():
    done = python("-c", f"import torch; {CHOOSE.format('portable')}")
    variables = " ".join(f"{name}={value}" for name, value in PORTABLE.items())
    assert done.stderr.strip().endswith(f"set the variables before Python starts: {variables}")
    assert "determinism: torch was imported before" in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(("limits", "runs"), [(PORTABLE, ("portable", "machine")), ({}, ("portable", "portable"))])
def test_a_run_can_follow_a_portable_one_that_is_portable_or_whose_variables_were_set_before(limits, runs):
    first, second = map(CHOOSE.format, runs)
    done = python("-c", f"{'import torch; ' if limits else ''}{first}; import torch; {second}", limits=limits)
    assert done.returncode == 0, done.stderr


def test_a_run_that_wants_the_kernels_of_the_machine_is_refused_after_a_portable_one():
    done = python("-c", f"{CHOOSE.format('portable')}; {CHOOSE.format('machine')}")
    assert "Start the run with machine in a process of its own" in done.stderr


def test_a_processor_without_the_instructions_is_told():
    done = python("-c", f"import segar.experiments.commands.kernels as k; k.lacks_for_portable = lambda: ['avx2', 'fma']; "
                        f"{CHOOSE.format('portable')}")  # fmt: skip
    assert "determinism: portable needs a processor with avx2, fma, which this one lacks" in done.stderr
