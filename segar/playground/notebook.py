"""What notebooks show of levels, distributions, worlds and evaluations: pictures, densities and intervals, without scripts."""

import inspect
from functools import singledispatch
from typing import Any

from segar.evaluation import Evaluation, Interval, LevelSetResult
from segar.language import GoalTile, Rule
from segar.levels import LevelDistribution, Levels
from segar.metrics import component
from segar.noise import Noise
from segar.playground.page import STATIC
from segar.playground.priors_text import together, varying
from segar.playground.world import aim_of, density
from segar.rendering import SIGNS, Stage
from segar.rules import World
from segar.suites import Causes
from segar.support import templates
from segar.tasks import task_of

PICTURES, FIRST = 8, 4  # levels that the cards of a level set and of a distribution show, at most
NOTHING: dict[str, Any] = {"lines": (), "scenes": (), "head": (), "rows": (), "text": ""}
DRAWN: dict[str, Any] = {"signs": SIGNS, "is_goal": lambda thing: issubclass(thing.entity, GoalTile)}


def html_of(shown: Any) -> str:
    """A card of an object in HTML, one element of about 2 to 100 kB, which asks the network for nothing and has no scripts.

    Args:
        shown: levels, a level distribution, a world, what an evaluation found, or causes of failures.

    Raises:
        TypeError: it is none of these.
    """
    return templates(STATIC, autoescape=True).get_template("notebook.html.jinja").render(NOTHING | DRAWN | _card(shown))


@singledispatch
def _card(shown: Any) -> dict[str, Any]:
    """What the card of an object shows; see the template."""
    raise TypeError(f"there is no card of a {type(shown).__name__}")


@_card.register
def _of_levels(levels: Levels) -> dict[str, Any]:
    more = [f"The first {PICTURES} of them:"] if len(levels) > PICTURES else []
    return {"title": repr(levels)[1:-1], "lines": [aim_of(levels), *more], "scenes": _scenes(levels[:PICTURES])}


@_card.register
def _of_distribution(distribution: LevelDistribution) -> dict[str, Any]:
    levels = distribution.sample(FIRST)
    rows = [
        {"cells": (one.title, together(one.entities), repr(one.law), one.unit), "densities": _densities(one.law)}
        for one in varying(distribution)
    ]
    return {
        "title": repr(distribution),
        "lines": [
            aim_of(levels),
            f"What varies between levels; below it, the first {FIRST} training levels of seed 0:",
        ],
        "head": ("what", "of", "distribution", "unit", "density"),
        "rows": rows,
        "scenes": _scenes(levels),
    }


@_card.register
def _of_world(world: World) -> dict[str, Any]:
    contacts = {"limit": world.limit, "walls": world.wall_contact, "contacts": world.pair_contact}
    roles = [("motion" if one.active is None else f"where {one.active.__name__}", one) for one in world.rules]
    roles += [(role, one) for role, one in contacts.items() if one is not None]
    roles += [("notes of contacts", one) for one in world.on_contact]
    rows = [(one.name, role, ", ".join(sorted(f.__name__ for f in one.changes)), _says(one)) for role, one in roles]
    return {
        "title": f"world of {len(rows)} rules",
        "lines": [f"The walls stand {world.walls:g} m from the middle."],
        "head": ("rule", "part", "changes", "what it does"),
        "rows": [{"cells": row} for row in rows],
    }


@_card.register
def _of_evaluation(found: Evaluation) -> dict[str, Any]:
    parts = {"training": found.train.mean("success"), "test": found.test.mean("success"), "gap": found.gap("success")}
    return {"title": "evaluation of a policy", "text": str(found), **_intervals("success", parts)}


@_card.register
def _of_level_set(found: LevelSetResult) -> dict[str, Any]:
    shares = {name: found.mean(name) for name in ("success", "death")}
    return {"title": repr(found)[1:-1], **_intervals("share of episodes", shares)}


@_card.register
def _of_causes(found: Causes) -> dict[str, Any]:
    effects = {f"{one.group}{'' if one.differs else ' (control)'}": one.effect for one in found.causes()}
    return {"title": "what failures come from", "text": str(found), **_intervals("gain of success", effects)}


def _intervals(name: str, found: dict[str, Interval]) -> dict[str, Any]:
    """Rows of values from -1 to 1, with their intervals as lines."""
    rows = [{"cells": (what, str(one)), "interval": one} for what, one in found.items()]
    return {"head": ("", f"{name} [95 %]", "−1 to 1"), "rows": rows}


def _densities(law: Any) -> list[dict[str, Any]]:
    """The densities of the components of a distribution; none of what is no number or has no distribution function."""
    if not isinstance(law, Noise):
        return []
    found = [density(component(law, axis)) for axis in range(law.width)]
    return [one for one in found if one is not None]


def _says(rule: Rule) -> str:
    """The first line of what a rule says of itself."""
    return (inspect.getdoc(rule.function) or "").partition("\n")[0]


def _scenes(levels: Levels) -> list[Any]:
    stage = Stage(levels, levels.world or World(), task_of(levels))
    return [stage.scene(levels.values[k], k) for k in range(len(levels))]
