"""What a result was made with: Python, libraries, commit, the levels, and what decided the last bits."""

import platform
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import segar
from segar.support import counted, installed_version

LIBRARIES = (
    "segar", "torch", "torchrl", "tensordict", "numpy", "numba", "scipy", "gymnasium", "POT", "hydra-core", "mlflow-skinny",
)  # fmt: skip


def versions() -> dict[str, Any]:
    """Python, machine, libraries and the commit of the checkout."""
    return {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "libraries": {name: installed_version(name) for name in LIBRARIES},
        "git": git_commit(Path(segar.__file__).resolve().parent),
    }


def computed_with(versions: Mapping[str, Any]) -> str:
    """What decided the last bits of the run with these versions, e.g. ``AVX512, bf16, 1 thread, AMD EPYC``.

    Empty for runs of earlier releases, which did not record it. If a run was resumed elsewhere, all that it computed with.
    """
    parts = [*versions.get("arithmetic_before", ()), versions.get("arithmetic")]
    return ", then ".join(dict.fromkeys(in_words(part) for part in parts if part))


def in_words(arithmetic: Mapping[str, Any]) -> str:
    """One :func:`segar.experiments.networks.devices.arithmetic`, e.g. ``AVX2, fp32, 1 thread, portable, AMD EPYC``."""
    known = {"device": "cpu", "determinism": "machine", "limits": {}, **arithmetic}  # earlier releases said less
    threads = counted(known["threads"], "thread") if "threads" in known else ""
    words = [known.get("instruction_set"), known.get("precision"), threads]
    words += [known["device"]] * (known["device"] != "cpu")
    limits = [f"{name}={value}" for name, value in known["limits"].items()]
    words += limits if known["determinism"] == "machine" else [known["determinism"]]
    return ", ".join(filter(None, [*words, known.get("processor")]))


def git_commit(folder: Path) -> dict[str, Any] | None:
    """Commit and whether tracked files differ from it; None outside of a checkout or without git."""
    try:
        commit = _git(folder, "rev-parse", "HEAD")
        changes = _git(folder, "status", "--porcelain", "--untracked-files=no")
    except (FileNotFoundError, subprocess.CalledProcessError):
        return None
    return {"commit": commit, "changed": bool(changes)}


def _git(folder: Path, *arguments: str) -> str:
    done = subprocess.run(["git", "-C", str(folder), *arguments], capture_output=True, check=True, encoding="utf-8")
    return done.stdout.strip()
