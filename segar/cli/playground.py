"""``segar playground``: levels as one file that a browser plays, with the policy of a run and the planner where asked; and
``segar studio``: that page with the library behind it, for the browser of this machine."""

import argparse
import sys
import threading
import time
import webbrowser
from pathlib import Path
from typing import Any

from segar.cli import arguments
from segar.errors import LevelError, SegarError, did_you_mean
from segar.language import Task
from segar.levels import Levels
from segar.observations import OBSERVATIONS, Observation, make_observation
from segar.playground import WEIGHTS, Studio, make_playground, read_policy, read_row_policy
from segar.suites import suite, suites
from segar.support import ROWS, counted, named_or_made, need

NUMBER, OF_A_MATCH = 100, 5  # of levels of a set, where none is given
LARGEST_PORT = 65_535


def add_commands(commands: Any) -> None:
    """Add ``playground`` and ``studio`` to the sub-commands of a parser."""
    making = arguments.command(commands, "playground", playground, "make a page that plays levels in a browser")
    making.add_argument(
        "what", metavar="WHAT", help=f"{arguments.NAME_HELP}; a level file; or a suite, with its test levels beside it"
    )
    arguments.add_output(making, "the page, one file that needs no network", required=True, endings=(".html", ".htm"))
    add_level_sets(making)
    making.add_argument(
        "--observation", nargs="+", metavar="NAME",
        help=f"what agents see: {', '.join(sorted(OBSERVATIONS))}, or 'module:attribute'; a policy reads the first one"
        " (default: what the run observes, otherwise rgb)",
    )  # fmt: skip
    making.add_argument(
        "--policy", metavar="FILE_OR_FOLDER",
        help="plays in the page: a file of segar.policies.Network.save, or the folder of a run or of an evaluation with"
        " portable=true; on a suite also a row of the benchmark, its folder or its name. The page of a suite with a policy is"
        " a match: you play against it",
    )  # fmt: skip
    making.add_argument(
        "--weights", choices=WEIGHTS,
        help="of the policy; float16 and float8 make smaller pages, which play the network with rounded weights (default:"
        " float32; float8 of a network that sees frames, in a match)",
    )  # fmt: skip
    making.add_argument(
        "--plans", action="store_true",
        help="also find the planner's episodes and the baselines of scores, in about 0.1 s per level",
    )  # fmt: skip
    making.add_argument(
        "--title", help="of the page (default: the name of the levels, or what stands behind the colon)"
    )

    purpose = "design levels in a browser: edit priors, draw, measure distances and hardness, plan"
    opening = arguments.command(commands, "studio", studio, purpose, answers=False)
    opening.add_argument(
        "what", metavar="WHAT", nargs="?", default="objectsx3-hard",
        help=f"{arguments.NAME_HELP}; a level file; or a suite (default: %(default)s)",
    )  # fmt: skip
    add_level_sets(opening)
    opening.add_argument("--runs", metavar="FOLDER", type=Path, help="below which runs have networks that play")
    opening.add_argument(
        "--observation", nargs="+", metavar="NAME", default=["rgb"],
        help=f"what agents see: {', '.join(sorted(OBSERVATIONS))}, or 'module:attribute' (default: rgb)",
    )  # fmt: skip
    arguments.add_number(opening, "--port", "of the server; 0 takes a free one", least=0, default=0)
    opening.add_argument("--no-browser", action="store_true", help="print the address, and open nothing")


def add_level_sets(parser: argparse.ArgumentParser) -> None:
    """Add how WHAT, which is there, becomes one or two level sets."""
    parser.add_argument("--test", metavar="WHAT", help="test levels, beside which WHAT are training levels")
    parser.add_argument(
        "-n", "--number", type=arguments.at_least(1),
        help=f"of levels of each set (default: {NUMBER} of a distribution, all of a file)",
    )  # fmt: skip
    arguments.add_number(parser, "--seed", "of the levels", least=0, default=0)
    parser.add_argument("--split", default="train", help="of WHAT (default: train); that of --test is test")
    parser.add_argument("--task", help=arguments.TASK_HELP)
    parser.add_argument("--world", help=arguments.WORLD_HELP)


def playground(chosen: argparse.Namespace) -> None:
    """``segar playground``."""
    start = time.perf_counter()
    policy: str | None = chosen.policy
    is_match = policy is not None and chosen.what in suites() and chosen.test is None
    row = row_folder(policy) if policy is not None and is_match else None
    player = None
    if is_match:
        chosen.number, chosen.plans = chosen.number or OF_A_MATCH, True
    if row is not None:
        player = read_row_policy(row, suite(chosen.what))
        chosen.seed = player.seed
    levels, test = named_sets(chosen)
    given = {name: named_observation(name) for name in chosen.observation or ()}
    if chosen.policy is not None and player is None:
        player = read_policy(Path(chosen.policy), levels, observations=given, task=chosen.task)
    weights = chosen.weights or ("float8" if is_match and player and player.network.dtype == "uint8" else WEIGHTS[0])
    if chosen.plans:
        count = len(levels) + (0 if test is None else len(test))
        print(f"segar: finding plans of {counted(count, 'level')}, in about 0.1 s each", file=sys.stderr, flush=True)
    page = make_playground(
        levels,
        test,
        task=(player and player.task) or named_task(chosen, levels),
        observations=given or (player and player.observations) or ("rgb",),
        test_observations=player.test_observations if player and not given else None,
        policy=player and player.network,
        weights=weights,
        probes=player.probes if player else {},
        plans=chosen.plans,
        title=chosen.title or (chosen.what.rpartition(":")[2] if ":" in chosen.what else None),
        match=suite(chosen.what).says if is_match else None,
    )
    page.save(chosen.output)
    size, seconds = len(page.html.encode()), time.perf_counter() - start
    answer: dict[str, Any] = {"file": chosen.output, "bytes": size, "levels": len(levels), "seconds": seconds}
    answer |= {"test_levels": len(test)} if test is not None else {}
    answer |= {} if player is None else {"policy": str(player.place), "weights": weights}
    sets = counted(len(levels), "level") + ("" if test is None else f" and {counted(len(test), 'test level')}")
    plays = "" if player is None else f", the policy in {player.place} ({weights})"
    text = f"{chosen.output}: {sets}{plays}; {size / 1000:.0f} kB in {seconds:.1f} s. Open it in a browser"
    arguments.print_answer(chosen, answer, text)


def studio(chosen: argparse.Namespace) -> None:
    """``segar studio``; it ends with Ctrl-C."""
    need("the studio", "starlette", "uvicorn")
    from segar.playground.server import StudioServer

    if chosen.port > LARGEST_PORT:
        raise SegarError(f"--port: there are ports up to {LARGEST_PORT}, and no {chosen.port}")
    if chosen.runs is not None and not chosen.runs.is_dir():
        raise SegarError(f"--runs: there is no folder {chosen.runs}")
    levels, test = named_sets(chosen)
    made = Studio(
        levels,
        test,
        task=named_task(chosen, levels),
        observations={name: named_observation(name) for name in chosen.observation},
        runs=chosen.runs,
    )
    server = StudioServer(made, chosen.port)
    print(f"segar studio: {server.address}\nThe address is a secret of yours. Ctrl-C ends the studio.", flush=True)
    if not chosen.no_browser:
        threading.Thread(target=webbrowser.open, args=(server.address,), daemon=True).start()
    try:
        server.run()
    except KeyboardInterrupt:
        print("segar studio: ended")


def row_folder(policy: str) -> Path | None:
    """The folder of a row of the benchmark that this names, or a shipped row of this name; None where it is something else.

    Raises:
        SegarError: there is neither a file, nor a folder, nor a row of this name.
    """
    found = [folder for folder in (Path(policy), ROWS / policy) if (folder / "row.json").is_file()]
    if not found and not Path(policy).exists():
        known = [path.parent.name for path in ROWS.glob("*/row.json")]
        raise SegarError(
            f"there is no {policy}; name a network's file, the folder of a run, or a row.{did_you_mean(policy, known)}"
        )
    return found[0] if found else None


def named_task(chosen: argparse.Namespace, levels: Levels) -> Task | None:
    """The task that is asked for, or that of the suite; None for the one that the levels name."""
    if chosen.task is not None:
        return arguments.task_named(chosen.task, levels)
    return suite(chosen.what).task if chosen.what in suites() else None


def named_observation(name: str) -> Observation:
    """The observation of SEGAR, or the one that ``module:attribute`` names."""
    return make_observation(named_or_made(name) if ":" in name else name)


def named_sets(chosen: argparse.Namespace) -> tuple[Levels, Levels | None]:
    """The levels of WHAT, and those of ``--test``; a suite has both."""
    levels = named_levels(chosen, chosen.what, chosen.split)
    test = chosen.test or (chosen.what if chosen.what in suites() else None)
    return levels, None if test is None else named_levels(chosen, test, "test")


def named_levels(chosen: argparse.Namespace, what: str, split: str) -> Levels:
    """The levels of a distribution or in a file."""
    if Path(what).suffix == ".py" and Path(what).is_file():
        raise LevelError(f"{what} is a program; name the distribution in it, as {what}:NAME")
    is_file = Path(what).suffix in (".npz", ".json") or (":" not in what and Path(what).is_file())
    if what in suites():
        of_suite, number = suite(what), chosen.number or NUMBER
        return of_suite.test_levels[:number] if split == "test" else of_suite.sample(chosen.seed, number)
    if not is_file:
        if chosen.world is not None and chosen.test is None:
            raise LevelError(f"--world: '{what}' brings its own rules; only level files need a world")
        return arguments.find_distribution(what).sample(chosen.number or NUMBER, chosen.seed, split)
    levels = arguments.load_playable(what, chosen.world)
    if chosen.number is not None and chosen.number > len(levels):
        raise LevelError(f"-n: {what} holds {len(levels)} levels, not {chosen.number}")
    return levels if chosen.number is None else levels[: chosen.number]
