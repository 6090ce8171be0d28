"""Questions for a plan: actions that lead to success."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from segar.errors import SegarError
from segar.hardness import plan
from segar.language import Task
from segar.levels import Levels
from segar.queries.kind import Draft, Mark
from segar.queries.question import Question, changing_places, draw_actions, read_actions, told
from segar.queries.trajectories import Player
from segar.support import misfit

SAMPLES, ITERATIONS = 64, 4  # of the planner
SPARE = 2  # times the steps of the planner's way are allowed
HISTORY = (6, 10)  # steps of the episode that is seen, at least and at most


@dataclass(frozen=True)
class MakePlan:
    """Actions that lead from the beginning of the level to success; whatever does is right."""

    def draw(self, level: Levels, task: Task, player: Player, rng: np.random.Generator) -> Draft | None:
        actions = draw_actions(task, int(rng.integers(HISTORY[0], HISTORY[1] + 1)), rng)
        shown = player.play(level, actions)
        if not shown.go_on[0]:
            return None
        best = plan(level, task, rng=rng, samples=SAMPLES, iterations=ITERATIONS)
        if not best.solved[0]:
            return None
        steps = min(task.max_steps, SPARE * int(best.steps[0]))
        steady = steady_players(task, steps)
        if (player.play(level[[0] * len(steady)], steady).solved <= steps).any():
            return None
        answer = best.actions[0, : best.steps[0]].tolist()
        asked = (
            "This was another episode; the level begins anew.\n\n"
            f"Question: which actions lead to success within {steps} steps?\n"
            f"Answer: a list of at most {steps} actions, [[...], ...]. They are taken from the beginning; after the last one"
            " nothing more happens."
        )
        states = told(level, shown.states[0], changing_places(level, shown.states))
        return Draft(actions, states, {"steps": steps}, asked, answer)

    def check(self, question: Question) -> None:
        wrong = misfit(question.ask, {"steps": int}, "ask", only=True)
        if wrong is None and not 1 <= question.ask["steps"] <= question.task.max_steps:
            wrong = f"'ask.steps' must be 1 to {question.task.max_steps}, not {question.ask['steps']}"
        if wrong:
            raise SegarError(wrong)

    def misfit(self, question: Question, answer: Any) -> str | None:
        if wrong := misfit(answer, [[float]], "answer"):
            return wrong
        try:
            read_actions(answer, question.task, "'answer'")
        except SegarError as error:
            return str(error)
        return None

    def mark(self, question: Question, answer: Any, player: Player) -> Mark:
        actions = read_actions(answer, question.task, "'answer'")[: question.ask["steps"]]
        is_right = bool(player.play(question.level, actions).solved[0] <= len(actions))
        return Mark(is_right, float(is_right))


def steady_players(task: Task, steps: int) -> np.ndarray:
    """Actions that are the same in all steps: each number of the action low, idle or high with the others idle, and all at
    once; float64 ``(players, steps, action size)``."""
    low, high = np.array(task.action_low), np.array(task.action_high)
    idle = np.clip(np.zeros(len(low)), low, high)
    one = np.eye(len(low), dtype=bool)
    players = [idle, low, high, *np.where(one, low, idle), *np.where(one, high, idle)]
    return np.repeat(np.array(players)[:, None], steps, axis=1)
