"""NVIDIA's assembler takes the kernels for GPUs: those of steps, of observations, and of what starts and ends episodes."""

from __future__ import annotations

import importlib.util
import subprocess
from pathlib import Path

import pytest

import segar
from segar.envs import VectorEnv, build_environment
from segar.observations import Pixels, Stack

pytestmark = pytest.mark.slow
ARCHITECTURES = ("sm_70", "sm_90")  # the oldest GPU that is named in the documentation, and one of today


@pytest.fixture(scope="module")
def ptxas() -> Path:
    """The assembler, of the wheel nvidia-cuda-nvcc-cu12 in the extra ``slow``."""
    found = importlib.util.find_spec("nvidia.cuda_nvcc") if importlib.util.find_spec("nvidia") else None
    if found is None:
        pytest.skip("nvidia-cuda-nvcc-cu12 is not installed; it has wheels for Linux and Windows")
    (folder,) = found.submodule_search_locations or ()
    return Path(folder) / "bin" / "ptxas"


@pytest.mark.parametrize("observation", ["state", Stack(Pixels(32), 2)], ids=["states", "stacked frames"])
@pytest.mark.parametrize("name", ["objectsx3-hard", "billiards"])
def test_the_kernels_of_an_environment_are_assembled(ptxas, tmp_path, name, observation):
    env = VectorEnv(segar.family(name).sample(3, seed=0), 2, seed=0, observation=observation)
    (tmp_path / "kernels.ptx").write_bytes(build_environment(env, "ptx").code)
    for architecture in ARCHITECTURES:
        made = tmp_path / f"{architecture}.cubin"
        command = [ptxas, "-arch", architecture, "-o", made, tmp_path / "kernels.ptx"]
        done = subprocess.run(command, capture_output=True, text=True)
        assert (done.returncode, done.stderr) == (0, "") and made.stat().st_size > 0
