"""``segar families``, ``segar compile``, ``segar kernel``: names, kernels ahead of time and for other targets, and what they
are made of."""

import argparse
import os
import re
import time
from pathlib import Path
from typing import Any

import numpy as np

from segar import engine
from segar.cli.arguments import NAME_HELP, TASK_HELP, find_distribution, task_named
from segar.envs import REWARDS, VectorEnv, build_environment, world_of
from segar.language import Rule, Task
from segar.levels import TASK_LEVELS, Levels, families
from segar.observations import OBSERVATIONS
from segar.support import PATIENCE, cache_folder, counted, replacing
from segar.tasks import puttputt, task_of

NO_LINES = "  (matches nothing here)"


def add_commands(commands: Any) -> None:
    """Add ``families``, ``compile`` and ``kernel`` to the sub-commands of a parser."""
    listing = commands.add_parser("families", help="list the named level families")
    listing.set_defaults(run=lambda chosen: print("\n".join([*families(), *TASK_LEVELS])))

    warming = commands.add_parser("compile", help="compile kernels into the cache, so that no first step waits")
    warming.add_argument("names", nargs="*", metavar="family", help=f"{NAME_HELP}; all families by default")
    warming.add_argument("--task", help=TASK_HELP)
    warming.set_defaults(run=compile_kernels)

    kernel = commands.add_parser("kernel", help="look at the kernel of a world, or build it for another target")
    actions = kernel.add_subparsers(required=True, metavar="command")
    showing = actions.add_parser("show", help="print the generated source, and where the rules in it are written")
    building = actions.add_parser("build", help="write a module for another target, which plays with equal bits")
    for action, run in ((showing, show_kernel), (building, build_target)):
        action.add_argument("name", metavar="family", help=NAME_HELP)
        action.add_argument("--task", help=TASK_HELP)
        action.set_defaults(run=run)
    building.add_argument(
        "--target", required=True, choices=engine.TARGETS,
        help="wasm: a WebAssembly module that imports nothing; native: an object file for C; ptx: text for NVIDIA GPUs",
    )  # fmt: skip
    building.add_argument("-o", "--output", required=True, help="the file")
    building.add_argument(
        "--observation", default="state", choices=sorted(OBSERVATIONS), help="what agents see (default: state)"
    )


def compile_kernels(chosen: argparse.Namespace) -> None:
    """``segar compile``: compile the kernels of level distributions, and print a row for each.

    Distributions that differ in nothing but numbers share a kernel, and a row.
    """
    os.environ[PATIENCE] = "0"
    found: dict[Path, tuple[Levels, Task, list[str]]] = {}
    for name in chosen.names or (*families(), *TASK_LEVELS):
        levels = find_distribution(name).sample(1)
        of_ids = [puttputt(reward) for reward in REWARDS.values()] if name in families() else [task_of(levels)]
        for its_task in [task_named(chosen.task, levels)] if chosen.task else of_ids:
            path = engine.kernel_path(_generate(levels, its_task).text)
            found.setdefault(path, (levels, its_task, []))[2].append(name)
    start, compiled = time.perf_counter(), 0
    for path, (levels, its_task, sharing) in found.items():
        there, seconds = engine.is_compiled(path), _first_step(levels, its_task)
        compiled += not there
        what = "there already" if there else f"compiled in {seconds:.1f} s"
        print(f"{path.stem}  {what:<19}  {its_task.name:<16}  {', '.join(sharing)}", flush=True)
    first, its_task, _ = next(iter(found.values()))
    seconds = sum(_first_step(first, its_task, observation) for observation in OBSERVATIONS)
    print(f"{'observations':<18}  ready in {seconds:.1f} s")
    print(
        f"{cache_folder()}: {counted(len(found), 'kernel')}, {compiled} of them new, {time.perf_counter() - start:.0f} s"
    )


def build_target(chosen: argparse.Namespace) -> None:
    """``segar kernel build``: write the module of a target that plays levels, and print what it exports."""
    levels = find_distribution(chosen.name).sample(1)
    env = VectorEnv(levels, 1, observation=chosen.observation, task=task_named(chosen.task, levels), seed=0)
    kernel = build_environment(env, chosen.target)
    with replacing(Path(chosen.output), "the kernel") as beside:
        beside.write_bytes(kernel.code)
    exports = ", ".join(one["name"] for one in kernel.description["exports"])
    print(f"{chosen.output}: {len(kernel.code):,} bytes, exports {exports}")


def show_kernel(chosen: argparse.Namespace) -> None:
    """``segar kernel show``: print the generated source of a kernel, below a legend that names the file of each rule."""
    levels = find_distribution(chosen.name).sample(1)
    its_task = task_named(chosen.task, levels)
    source = _generate(levels, its_task)
    path = engine.kernel_path(source.text)
    solid = world_of(levels).solid
    rules = [*source.rules, *([solid] if solid is not None else []), *its_task.functions().of_state]
    named = {name for line in re.findall(r"^ +# ([\w, ]+)$", source.text, re.M) for name in line.split(", ")}
    width = max(len(rule.name) for rule in rules)
    legend = [
        f"The kernel of '{chosen.name}' with the task {its_task.name}.",
        f"It lies in {path} ({'compiled' if engine.is_compiled(path) else 'not compiled yet'}).",
        "",
        "A comment in the functions below names the rule that the lines after it come from:",
        *dict.fromkeys(
            f"  {rule.name:<{width}}  {_place(rule)}{'' if rule.name in named else NO_LINES}" for rule in rules
        ),
        "",
        "What stands before the first of them is geometry and contacts, the same in every kernel:",
        *(f"  {Path(engine.__path__[0], 'runtime', file)}" for file in ("geometry.py", "contacts.py")),
    ]
    print(*(f"# {line}".rstrip() for line in legend), "", source.text.rstrip("\n"), sep="\n")


def _place(rule: Rule) -> str:
    """``file:line`` of a rule's function."""
    return f"{rule.function.__code__.co_filename}:{rule.function.__code__.co_firstlineno}"


def _generate(levels: Levels, task: Task) -> engine.KernelSource:
    return engine.generate(levels.layout, world_of(levels), task.functions())


def _first_step(levels: Levels, task: Task, observation: str = "state") -> float:
    """Seconds until an environment has made a step; what observations compile serves every world."""
    start = time.perf_counter()
    env = VectorEnv(levels, 1, observation=observation, task=task, seed=0)
    env.reset()
    env.step(np.zeros((1, len(task.action_low)), np.float32))
    return time.perf_counter() - start
