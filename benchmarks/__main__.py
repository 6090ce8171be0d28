"""Print how fast SEGAR is on this machine, each number beside its bar; nothing is asserted. One thread, unless it says so."""

from __future__ import annotations

import argparse

from benchmarks.drawing import drawing
from benchmarks.environments import environments, resets, single, startup
from benchmarks.frameworks import frameworks
from benchmarks.mathematics import speed
from benchmarks.measure import print_parts
from benchmarks.networks import networks
from benchmarks.rule_sets import rule_sets
from benchmarks.scaling import bodies, threads
from benchmarks.targets import targets
from benchmarks.yardsticks import against_pymunk, handwritten

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
    "resets": resets,
    "networks": networks,
    "startup": startup,
    "targets": targets,
    "rule_sets": rule_sets,
    "mathematics": speed,
}


def main() -> None:
    parser = argparse.ArgumentParser("python -m benchmarks", description=__doc__)
    parser.add_argument("--repeats", type=int, default=REPEATS, help="measure each number this often")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), metavar="part", help=", ".join(PARTS))
    chosen = parser.parse_args()
    legend = "M/s: million environment steps per core-second"
    print_parts(legend, [PARTS[part] for part in chosen.only], chosen.repeats)


if __name__ == "__main__":
    main()
