"""A question: a level, what happened in it, and what is asked; as data, as words, and as a line of JSON."""

import json
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from segar.errors import SegarError
from segar.language import Factor, Position, Task, Velocity
from segar.levels import Levels, levels_from_data
from segar.queries.words import FOLLOWING, history_in_words, level_in_words, rounded, rules_of, task_in_words
from segar.rules import World
from segar.support import misfit
from segar.tasks import make_task

FORMAT, VERSION = "segar-queries", 1
VALUES = {str: (float, [float])}
STATES = [{str: VALUES}]
FORM: dict[str, Any] = {
    "format": str, "version": int, "id": str, "kind": str, "seed": int, "task": str, "level": dict, "units": {str: str},
    "rules": [str], "history": {"actions": [[float]], "states": STATES}, "ask": dict, "text": str,
}  # fmt: skip
"""The form of a line of a file of questions; see :func:`segar.support.misfit`."""

MOTION = (Position, Velocity)  # what is seen of a world whose change is to be found
STRENGTH = 0.3  # of drawn actions, as a share of half the range
ACTING = 0.5  # share of the steps with an action that is not idle

Place: TypeAlias = tuple[int, type[Factor]]
"""A factor of the entity in a slot."""


@dataclass(frozen=True, eq=False)
class Question:
    """A question about a world.

    Attributes:
        id: names it among others, as ``predict-8``.
        kind: one of :data:`segar.queries.KINDS`.
        level: the single level that it is about, with its world.
        task_name, task: what is played.
        actions: float64 ``(steps, action size)``, what was done first.
        states: what was seen after each of these steps: entity to factor to its value, a number or a list of two.
        ask: what is asked, by kind, as plain data.
        text: all of it in words.
    """

    id: str
    kind: str
    level: Levels
    task_name: str
    task: Task
    actions: np.ndarray
    states: Sequence[Mapping[str, Any]]
    ask: Mapping[str, Any]
    text: str

    def data(self) -> dict[str, Any]:
        """The question as plain data of the form :data:`FORM`, with the level as level files in JSON have it."""
        return {
            "format": FORMAT,
            "version": VERSION,
            "id": self.id,
            "kind": self.kind,
            "seed": self.level.provenance.seed,
            "task": self.task_name,
            "level": level_data(self.level),
            "units": units_of(self.level),
            "rules": rules_of(self.level),
            "history": {"actions": self.actions.tolist(), "states": list(self.states)},
            "ask": dict(self.ask),
            "text": self.text,
        }


def question_of(data: Any, path: Path, line: int, world: World | None, task: Task | None) -> Question:
    """The question that the data of a line hold. Only what the simulator needs is used: words and units are for readers.

    Args:
        path, line: where it stands, for messages.
        world: the rules of levels with rules of their own.
        task: what is played, where it is not built in.

    Raises:
        SegarError: the data are no question; the message names line and field.
    """
    at = f"{path}: line {line}: "
    found = data.get("format") if isinstance(data, dict) else None
    if found != FORMAT:
        raise SegarError(f"{at}'format' must be '{FORMAT}', as `segar queries write` makes it")
    if wrong := misfit(data, {"version": int}):
        raise SegarError(f"{at}{wrong}")
    if not 1 <= data["version"] <= VERSION:
        raise SegarError(f"{at}'version' must be 1 to {VERSION}, not {data['version']}; a newer SEGAR may read it")
    if wrong := misfit(data, FORM, only=True):
        raise SegarError(f"{at}{wrong}")
    described = data["level"].get("description")
    if world is None and isinstance(described, dict) and described.get("rules"):
        raise SegarError(
            f"{at}'level' has rules of its own, which the file does not hold; give them by --world or world="
        )
    level = levels_from_data(data["level"], path, f"line {line}: level.", world)
    if len(level) != 1:
        raise SegarError(f"{at}'level' must hold one level, not {len(level)}")
    try:
        task = make_task(data["task"], trusted=()) if task is None else task
    except SegarError as error:
        raise SegarError(f"{at}{error}") from error
    actions, states = data["history"]["actions"], data["history"]["states"]
    if len(states) != len(actions):
        raise SegarError(
            f"{at}'history.states' must be as many as 'history.actions', {len(actions)}, not {len(states)}"
        )
    taken = read_actions(actions, task, f"{at}'history.actions'")
    return Question(data["id"], data["kind"], level, data["task"], task, taken, states, data["ask"], data["text"])


def read_actions(given: list[list[float]], task: Task, what: str) -> np.ndarray:
    """Actions from plain data, float64 ``(steps, action size)``; raises :class:`SegarError`."""
    size = len(task.action_low)
    for step, action in enumerate(given):
        if len(action) != size:
            raise SegarError(f"{what}[{step}]: an action of this task has {size} numbers, not {len(action)}")
    return np.array(given, np.float64).reshape(len(given), size)


def level_data(level: Levels) -> dict[str, Any]:
    """Levels as the plain data of a level file in JSON."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "level.json"
        level.save(path)
        data = json.loads(path.read_bytes())
    data["description"].pop("moments", None)  # of distances, which no question needs
    return data


def units_of(level: Levels) -> dict[str, str]:
    """The units of all factors and world parameters of a level, by name; empty where they have none."""
    return {f.__name__: f.unit for f in (*level.layout.factors, *level.layout.parameters)}


def draw_actions(task: Task, steps: int, rng: np.random.Generator) -> np.ndarray:
    """Weak actions, half of them idle, with three digits; float64 ``(steps, action size)``."""
    low, high = np.array(task.action_low), np.array(task.action_high)
    idle = np.clip(np.zeros(len(low)), low, high)
    drawn = (low + high) / 2 + STRENGTH * (high - low) / 2 * rng.uniform(-1, 1, (steps, len(low)))
    chosen = np.where(rng.random((steps, 1)) < ACTING, drawn, idle)
    return np.vectorize(rounded, otypes=[float])(chosen)


def changing_places(level: Levels, trajectories: np.ndarray, seen: Iterable[type[Factor]] = ()) -> list[Place]:
    """The factors of entities that change in some of the trajectories, float64 ``(n, steps + 1, entities, columns)``.

    Args:
        seen: only these factors; all but :data:`segar.queries.words.FOLLOWING` where there are none.
    """
    chosen = tuple(seen)
    found = []
    for slot in np.flatnonzero(level.types[0] >= 0).tolist():
        for factor, column in level.layout.columns.items():
            part = trajectories[:, :, slot, column : column + factor.width]
            wanted = issubclass(factor, chosen) if chosen else not issubclass(factor, FOLLOWING)
            if wanted and (part != part[:1, :1]).any() and not np.isnan(part).any():
                found.append((slot, factor))
    return found


def told(level: Levels, states: np.ndarray, places: Iterable[Place]) -> list[dict[str, Any]]:
    """The values at these places after each step, for states float64 ``(steps + 1, entities, columns)``."""
    lines: list[dict[str, Any]] = [{} for _ in range(len(states) - 1)]
    for slot, factor in places:
        name = level.layout.names[slot]
        for line, state in zip(lines, states[1:], strict=True):
            line.setdefault(name, {})[factor.__name__] = plain(value_at(level, state, (slot, factor)))
    return lines


def value_at(level: Levels, state: np.ndarray, place: Place) -> np.ndarray:
    """The value of a factor of an entity in a state ``(entities, columns)``, float64 ``(width,)``."""
    slot, factor = place
    column = level.layout.columns[factor]
    return state[slot, column : column + factor.width]


def plain(value: np.ndarray) -> float | list[float]:
    """The value of a factor as plain data: a number, or a list of two."""
    return float(value[0]) if len(value) == 1 else value.tolist()


def place_of(level: Levels, entity: str, factor: str) -> Place:
    """The place of those names; raises :class:`LevelError`."""
    return level.layout.slot_index(entity), level.layout.factor(factor)


def places_of(level: Levels, states: Sequence[Mapping[str, Any]]) -> list[Place]:
    """The places that a history tells of; raises :class:`LevelError` where the level has none of that name."""
    return [
        place_of(level, entity, factor) for entity, said in (states[0] if states else {}).items() for factor in said
    ]


def text_of(
    level: Levels, task_name: str, task: Task, actions: np.ndarray, states: Sequence[Mapping[str, Any]], asked: str
) -> str:
    """A question in words.

    Args:
        asked: the question itself and the form of the answer.
    """
    rules = "\n".join(f"- {text}" for text in rules_of(level))
    history = history_in_words(actions, states, units_of(level))
    parts = (
        level_in_words(level, task),
        f"Rules:\n{rules}",
        task_in_words(task_name, task),
        f"What happened:\n{history}",
    )
    return "\n\n".join([*parts, asked])
