"""``segar lab``: serves a lab to an agent, grades baselines, and draws their grades. No model is called."""

import argparse
import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from segar.cli import arguments
from segar.cli.figures import draw_grades
from segar.evaluation import mean_of_levels
from segar.lab import BASELINES, Lab, Session, grade_baselines, read_grades
from segar.support import need

ACTIVE, PASSIVE = "sequential", "evolution, passive"


def add_commands(commands: Any) -> None:
    """Add ``lab`` to the sub-commands of a parser."""
    lab = commands.add_parser("lab", help="let an agent find the rules of a hidden world, and grade its answer")
    actions = lab.add_subparsers(required=True, metavar="command")

    purpose = "answer requests of an agent, a line of JSON each, over standard input and output"
    serving = arguments.command(actions, "serve", serve, purpose, answers=False)
    _add_lab(serving)
    arguments.add_number(serving, "--hidden", "which of the worlds is the hidden one", least=0, default=0)
    arguments.add_number(serving, "--budget", "steps of experiments", least=1, default=Lab.budget)
    arguments.add_number(serving, "--questions", "of each kind", least=0, default=Lab.questions)
    serving.add_argument("--passive", action="store_true", help="give recordings, and allow no experiments")
    serving.add_argument("--trust", action="store_true", help="execute answers that are code")
    serving.add_argument("--mcp", action="store_true", help="speak the Model Context Protocol instead")
    serving.add_argument("--session", type=Path, metavar="FILE", help="keep the session there, or go on with it")

    grading = arguments.command(
        actions, "baselines", baselines, "grade baselines in hidden worlds; goes on where it stopped"
    )
    _add_lab(grading)
    arguments.add_number(grading, "--worlds", "hidden ones", least=1, default=30)
    grading.add_argument("--budgets", nargs="+", type=arguments.at_least(1), default=[40, 200, 1000], help="in steps")
    grading.add_argument(
        "--baselines", nargs="+", choices=list(BASELINES), default=list(BASELINES), help="(default: all)"
    )
    arguments.add_output(grading, "the table (csv), a row for each world, budget and baseline", required=True)

    drawing = arguments.command(
        actions, "figure", figure, "draw the grades of baselines against the budget, and print them"
    )
    drawing.add_argument("table", metavar="TABLE", help="that `segar lab baselines` wrote")
    arguments.add_output(drawing, "the figure (png, pdf or svg)", required=True)


def serve(chosen: argparse.Namespace) -> None:
    """``segar lab serve``."""
    own = {"world": chosen.hidden, "budget": chosen.budget, "questions": chosen.questions}
    lab = dataclasses.replace(_lab(chosen), **own, passive=chosen.passive, trusted=chosen.trust)
    place: Path | None = chosen.session
    session = Session.load(place, lab) if place is not None and place.exists() else Session(lab)
    session.file = place
    if chosen.mcp:
        need("a server of the Model Context Protocol", "mcp")
        from segar.lab.mcp_server import make_server

        make_server(session).run("stdio")
    else:
        session.serve(sys.stdin.buffer, sys.stdout)


def baselines(chosen: argparse.Namespace) -> None:
    """``segar lab baselines``."""
    lab = _lab(chosen)
    for row in grade_baselines(chosen.output, lab, chosen.worlds, chosen.budgets, chosen.baselines):
        said = ", ".join(f"{name} {row[name]}" for name in ("world", "budget", "baseline", "score"))
        print(said, file=sys.stderr, flush=True)
    _print(chosen, chosen.output)


def figure(chosen: argparse.Namespace) -> None:
    """``segar lab figure``."""
    draw_grades(_means(read_grades(chosen.table)), chosen.output)
    _print(chosen, chosen.table)


def _add_lab(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--family", default="objectsx1-hard", help=f"{arguments.NAME_HELP} (default: %(default)s)")
    parser.add_argument(
        "--world",
        default="segar.rules.templates:law_space",
        help="the rule space: 'module:attribute' (default: %(default)s)",
    )
    arguments.add_number(parser, "--seed", "of worlds, levels and noise", least=0, default=0)
    arguments.add_number(parser, "--steps", "of one experiment, at most", least=1, default=Lab.most_steps)
    parser.add_argument(
        "--noise", type=float, default=Lab.noise, help="standard deviation of what is seen (default: %(default)s)"
    )


def _lab(chosen: argparse.Namespace) -> Lab:
    world = arguments.find_world(chosen.world)
    distribution = dataclasses.replace(arguments.find_distribution(chosen.family), world=world)
    return Lab(distribution, seed=chosen.seed, most_steps=chosen.steps, noise=chosen.noise)


def _print(chosen: argparse.Namespace, path: str) -> None:
    """Print the means of a table, and whether experiments of one's own beat recordings."""
    rows = read_grades(path)
    means, gains = _means(rows), dict[str, Any]()
    scores = {(row["budget"], row["baseline"], row["world"]): float(row["score"]) for row in rows}
    for budget in dict.fromkeys(row["budget"] for row in rows):
        worlds = [w for b, n, w in scores if (b, n) == (budget, ACTIVE) and (b, PASSIVE, w) in scores]
        pairs = [scores[budget, ACTIVE, world] - scores[budget, PASSIVE, world] for world in worlds]
        gains[budget] = mean_of_levels(np.array(pairs))
    text = arguments.records(means) if means else "no rows"
    for budget, gain in gains.items():
        text += f"\n{ACTIVE} minus {PASSIVE}, budget {budget}: {gain}"
    arguments.print_answer(chosen, {"table": path, "means": means, "active_minus_passive": gains}, text)


def _means(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The mean score of each baseline at each budget, with its interval of 95 % over worlds."""
    found = []
    for name, budget in dict.fromkeys((row["baseline"], row["budget"]) for row in rows):
        own = [row for row in rows if (row["baseline"], row["budget"]) == (name, budget)]
        numbers = {c: np.array([float(row[c] or "nan") for row in own]) for c in ("score", "precision", "recall")}
        score, low, high = mean_of_levels(numbers["score"], 0.0, 1.0)
        shares = {c: mean_of_levels(x[~np.isnan(x)]).value for c, x in numbers.items() if c != "score"}
        made = {"baseline": name, "budget": int(budget), "worlds": len(own), "score": score, "low": low, "high": high}
        found.append(made | shares)
    return found
