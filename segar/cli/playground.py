"""``segar playground``: levels as one file that a browser plays, with the policy of a run and the planner where asked."""

import argparse
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from segar.cli import arguments
from segar.errors import LevelError, SegarError
from segar.levels import Levels
from segar.observations import OBSERVATIONS, Observation, make_observation, trained_on
from segar.playground import WEIGHTS, make_playground
from segar.policies import Network
from segar.support import named_or_made, need

NUMBER = 100  # of levels of a distribution, where none is given
NETWORK, CONFIG, LEVELS_TRAIN = "network.npz", "config.yaml", "levels_train.npz"  # files of a run folder
IN_EVALUATIONS = f"evaluations/*/{NETWORK}"


def add_commands(commands: Any) -> None:
    """Add ``playground`` to the sub-commands of a parser."""
    making = arguments.command(commands, "playground", playground, "make a page that plays levels in a browser")
    making.add_argument("what", metavar="WHAT", help=f"{arguments.NAME_HELP}; or a level file")
    arguments.add_output(making, "the page (html), one file that needs no network", required=True)
    making.add_argument("--test", metavar="WHAT", help="test levels, beside which WHAT are training levels")
    making.add_argument(
        "-n", "--number", type=arguments.at_least(1),
        help=f"of levels of each set (default: {NUMBER} of a distribution, all of a file)",
    )  # fmt: skip
    arguments.add_number(making, "--seed", "of the levels", least=0, default=0)
    making.add_argument("--split", default="train", help="of WHAT (default: train); that of --test is test")
    making.add_argument("--task", help=arguments.TASK_HELP)
    making.add_argument(
        "--observation", nargs="+", metavar="NAME",
        help=f"what agents see: {', '.join(sorted(OBSERVATIONS))}, or 'module:attribute'; a policy reads the first one"
        " (default: what the run observes, otherwise rgb)",
    )  # fmt: skip
    making.add_argument(
        "--policy", metavar="FILE_OR_FOLDER",
        help="plays in the page: a file of segar.policies.Network.save, or the folder of a run or of an evaluation with"
        " portable=true",
    )  # fmt: skip
    making.add_argument(
        "--weights", choices=WEIGHTS, default=WEIGHTS[0],
        help="of the policy; float16 makes a smaller page, which plays the network with rounded weights (default: %(default)s)",
    )  # fmt: skip
    making.add_argument(
        "--plans", action="store_true",
        help="also find the planner's episodes and the baselines of scores, in about 0.1 s per level",
    )  # fmt: skip
    making.add_argument("--world", help=arguments.WORLD_HELP)
    making.add_argument("--title", help="of the page (default: the name of the levels)")


def playground(chosen: argparse.Namespace) -> None:
    """``segar playground``."""
    start = time.perf_counter()
    network, observations = None, {name: named_observation(name) for name in chosen.observation or ()}
    if chosen.policy is not None:
        network, place, run = find_network(Path(chosen.policy))
        if run is not None:
            observations = observations or observation_of(run)
    levels = named_levels(chosen, chosen.what, chosen.split)
    test = None if chosen.test is None else named_levels(chosen, chosen.test, "test")
    task = None if chosen.task is None else arguments.task_named(chosen.task, levels)
    if chosen.plans:
        count = len(levels) + (0 if test is None else len(test))
        print(f"segar: finding plans of {count} levels, in about 0.1 s each", file=sys.stderr, flush=True)
    page = make_playground(
        levels,
        test,
        task=task,
        observations=observations or ("rgb",),
        policy=network,
        weights=chosen.weights,
        plans=chosen.plans,
        title=chosen.title,
    )
    page.save(chosen.output)
    size, seconds = len(page.html.encode()), time.perf_counter() - start
    answer: dict[str, Any] = {"file": chosen.output, "bytes": size, "levels": len(levels), "seconds": seconds}
    answer |= {"test_levels": len(test)} if test is not None else {}
    answer |= {"policy": str(place), "weights": chosen.weights} if network is not None else {}
    sets = f"{len(levels)} levels" + ("" if test is None else f" and {len(test)} test levels")
    plays = "" if network is None else f", the policy in {place} ({chosen.weights})"
    text = f"{chosen.output}: {sets}{plays}; {size / 1000:.0f} kB in {seconds:.1f} s. Open it in a browser"
    arguments.print_answer(chosen, answer, text)


def find_network(path: Path) -> tuple[Network, Path, Path | None]:
    """The network in a file, or the newest one of a run folder; its file; and the folder of its run, if there is one.

    Nothing of a run is imported.

    Raises:
        SegarError: there is none, which says how to write it; or it cannot be read.
    """
    if path.is_dir():
        is_evaluation = (path / NETWORK).exists()
        found = [path / NETWORK] if is_evaluation else sorted(path.glob(IN_EVALUATIONS), key=_written)
        if not found:
            raise SegarError(
                f"{path}: there is no {NETWORK}, neither here nor in {IN_EVALUATIONS}, which plays without torch; write it"
                f" by: python -m experiments.evaluate run={path} portable=true"
            )
        run = path.parent.parent if is_evaluation and not (path / CONFIG).exists() else path
        return Network.load(found[-1]), found[-1], run if (run / CONFIG).exists() else None
    if not path.exists():
        raise SegarError(f"there is no {path}; name a network's file, or the folder of a run")
    return Network.load(path), path, None


def observation_of(run: Path) -> dict[str, Observation]:
    """What the agent of a run observes, in the units of its training levels, by its name in the settings.

    The settings are read as plain data, and nothing that they name is imported.

    Raises:
        SegarError: the settings cannot be read, or name an observation of the user's own.
    """
    advice = "say what the policy reads by --observation"
    need("reading the settings of a run", "yaml")
    import yaml

    path = run / CONFIG
    try:
        settings = yaml.safe_load(path.read_text(encoding="utf-8"))
        name, options = settings["observation"]["name"], settings["observation"].get("options") or {}
    except (yaml.YAMLError, UnicodeDecodeError, TypeError, KeyError, AttributeError) as error:
        raise SegarError(f"{path} holds no settings of a run ({type(error).__name__}); {advice}") from error
    if name not in OBSERVATIONS or not isinstance(options, Mapping):
        raise SegarError(f"{path}: the observation {name!r} is not one of SEGAR, and is not imported; {advice}")
    try:
        made = OBSERVATIONS[name](**options)
    except (TypeError, SegarError) as error:
        raise SegarError(f"{path}: the observation {name!r} cannot be made: {error}; {advice}") from error
    train = run / LEVELS_TRAIN
    is_known = not hasattr(made, "trained_on") or not train.exists()
    return {name: made if is_known else trained_on(made, Levels.load(train))}


def _written(path: Path) -> float:
    return path.stat().st_mtime


def named_observation(name: str) -> Observation:
    """The observation of SEGAR, or the one that ``module:attribute`` names."""
    return make_observation(named_or_made(name) if ":" in name else name)


def named_levels(chosen: argparse.Namespace, what: str, split: str) -> Levels:
    """The levels of a distribution or in a file."""
    is_file = Path(what).suffix in (".npz", ".json") or (":" not in what and Path(what).is_file())
    if not is_file:
        if chosen.world is not None and chosen.test is None:
            raise LevelError(f"--world: '{what}' brings its own rules; only level files need a world")
        return arguments.find_distribution(what).sample(chosen.number or NUMBER, chosen.seed, split)
    levels = arguments.load_playable(what, chosen.world)
    if chosen.number is not None and chosen.number > len(levels):
        raise LevelError(f"-n: {what} holds {len(levels)} levels, not {chosen.number}")
    return levels if chosen.number is None else levels[: chosen.number]
