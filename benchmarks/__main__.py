"""Print how fast SEGAR is on this machine, each number beside its bar; nothing is asserted. One thread, unless it says so."""

from __future__ import annotations

import os

from benchmarks.drawing import drawing
from benchmarks.environments import environments, resets, single, startup
from benchmarks.frameworks import frameworks
from benchmarks.gpu import gpu
from benchmarks.lab import lab
from benchmarks.mathematics import speed
from benchmarks.measure import print_parts
from benchmarks.networks import networks
from benchmarks.policies import policies
from benchmarks.rule_sets import rule_sets
from benchmarks.scaling import bodies, threads
from benchmarks.targets import targets
from benchmarks.yardsticks import against_pymunk, handwritten
from segar.experiments.commands.command_line import run_from_command_line
from segar.experiments.settings import require_known
from segar.support import PATIENCE

REPEATS = 7
PARTS = {
    "environments": environments,
    "drawing": drawing,
    "handwritten": handwritten,
    "pymunk": against_pymunk,
    "threads": threads,
    "bodies": bodies,
    "single": single,
    "frameworks": frameworks,
    "gpu": gpu,
    "resets": resets,
    "networks": networks,
    "policies": policies,
    "startup": startup,
    "targets": targets,
    "rule_sets": rule_sets,
    "lab": lab,
    "mathematics": speed,
}


def main(repeats: int = REPEATS, only: tuple[str, ...] = tuple(PARTS)) -> None:
    """Measure each number of some parts ``repeats`` times."""
    for part in only:
        require_known("only", part, list(PARTS))
    os.environ.setdefault(PATIENCE, "0")  # what is measured is machine code
    print_parts("M/s: million environment steps per core-second", [PARTS[part] for part in only], repeats)


if __name__ == "__main__":
    run_from_command_line(main)
