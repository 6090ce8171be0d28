"""``segar report serve=true``: the report on the loopback address, where each dot of a run is a link to its agent.

The agent's page is made when somebody asks for it: it plays the test level on which its return is the lowest. The run folders
are those that the plan in the results folder names, or ``runs`` of the checkout where there is no plan.
"""

import re
from functools import partial
from pathlib import Path

from segar.analysis.report.document.files import PAGE
from segar.analysis.report.figures.main_grid import TO_AGENTS
from segar.experiments.evaluation.transfers import LEVELS
from segar.experiments.reproduction.experiment_file import PLAN
from segar.experiments.runs.files import read_json
from segar.experiments.settings import EvaluateConfig, RunFolderError
from segar.levels import Levels
from segar.playground import make_playground, read_policy
from segar.support import WORKSPACE, need

FIGURE = re.compile(r'(?<=<figure id=")(\w+)(">\s*<div class="scroll" tabindex="0">)<img [^>]*>')


def serve_report(results: Path, folder: Path, port: int) -> None:
    """Serves the report in ``folder`` until Ctrl-C.

    Args:
        results: has the plan of the runs.
        port: 0: a free one.

    Raises:
        SegarError: the packages of the extra ``studio`` are missing.
        RunFolderError: there is no report.
    """
    need("serving a report", "starlette", "uvicorn")
    if not (folder / PAGE).exists():
        raise RunFolderError(f"{folder / PAGE} is not there; make the report first, without serve=true")
    plan = read_json(results / PLAN) if (results / PLAN).exists() else {}
    shown, root = with_links(folder), Path(plan.get("runs", WORKSPACE / "runs"))
    from segar.playground import serve_pages  # with the packages of the extra

    serve_pages(shown, TO_AGENTS, partial(agent_page, root), port)


def with_links(folder: Path) -> str:
    """The report's page, in which figures with links to agents are part of the text, so that a click follows them."""

    def opened(found: re.Match[str]) -> str:
        svg = (folder / "figures" / f"{found[1]}.svg").read_text(encoding="utf-8")
        return f"{found[1]}{found[2]}{svg[svg.index('<svg') :]}" if f'"{TO_AGENTS}' in svg else found[0]

    return FIGURE.sub(opened, (folder / PAGE).read_text(encoding="utf-8"))


def agent_page(root: Path, run: str) -> str:
    """The page on which the agent of a run plays the test level of its lowest return, without noise in its actions.

    Raises:
        SegarError: the run folder is not there, has no weights, or its agent cannot play in a browser.
    """
    from segar.experiments.evaluation.evaluator import choose_levels, evaluate

    if not (root / run).is_dir():
        raise RunFolderError(f"{root / run} is not there; the command that made the results trains the run again there")
    asked = EvaluateConfig(str(root / run), modes=("deterministic",), scores=False, videos="none", portable=True)
    played = evaluate(asked)
    levels, (worst, mean) = Levels.load(played.folder / LEVELS), choose_levels(played.episodes)["worst"]
    found = read_policy(played.folder, levels)
    title = f"{run}: test level {worst}, return {mean:.2f}"
    options = {"task": found.task, "policy": found.network, "title": title}
    return make_playground(levels[[worst]], observations=found.observations, **options).html
