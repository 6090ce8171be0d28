"""A lab: the hidden world, what can be seen and set in it, what experiments cost, and what the experimenter is told."""

import inspect
import linecache
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from segar.engine import Simulator, State, StepResult, generate
from segar.envs import world_of
from segar.errors import SegarError
from segar.language import Alive, Charge, Factor, Flag, Mass, Object, Position, Rule, Size, Task, Velocity, Visible
from segar.levels import LevelDistribution, Levels, Prior, checks, rule_space_of
from segar.noise import GaussianNoise2D, UniformNoise
from segar.rules import DEFAULT_RULES, RuleOption, RuleSpace, World
from segar.support import cores, is_whole
from segar.tasks import task_of

SEEN = (Position, Velocity, Mass, Size, Visible, Alive)
SETTABLE = {Position: (-0.9, 0.9), Velocity: (-2.0, 2.0), Mass: (0.5, 2.0), Charge: (-2.0, 2.0)}
START_LEVELS = 16  # in which experiments begin
QUESTION_LEVELS = 120  # that are tried for each question of each kind


@dataclass(frozen=True, eq=False)
class Lab:
    """A hidden world, in which an experimenter finds the rules.

    Args:
        distribution: of levels, whose rules are drawn from a rule space.
        world: which of the worlds that are drawn from it is the hidden one.
        seed: of the worlds, the levels, the noise and the questions.
        budget: steps that experiments may take in all.
        most_steps: of one experiment.
        noise: standard deviation of what is seen, in the unit of each number; flags are seen as they are.
        passive: whether the experimenter only gets recordings, for which the budget is spent.
        trusted: whether an answer may be code, which is executed.
        questions: of each kind that are asked when they are asked for.
        seen: factors that can be seen. settable: factors that can be set, and their bounds.
        shifted: another distribution of levels, on which answers are graded, too; None: bodies move at the beginning, and
            have other masses.

    Raises:
        SegarError: the distribution has no rule space, a number is out of range, or rules draw random numbers.
    """

    distribution: LevelDistribution
    world: int = 0
    seed: int = 0
    budget: int = 200
    most_steps: int = 20
    noise: float = 0.01
    passive: bool = False
    trusted: bool = False
    questions: int = 3
    seen: Sequence[type[Factor]] = SEEN
    settable: Mapping[type[Factor], tuple[float, float]] = field(default_factory=lambda: dict(SETTABLE))
    shifted: LevelDistribution | None = None
    _simulators: dict[World | None, Simulator] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        checks.require_distribution("Lab", self.distribution)
        least = {"world": 0, "seed": 0, "budget": 1, "most_steps": 1, "questions": 0}
        for name, low in least.items():
            if not is_whole(getattr(self, name)) or getattr(self, name) < low:
                raise SegarError(f"Lab: {name} must be a whole number from {low} up, not {getattr(self, name)!r}")
        checks.require_size("Lab", "noise", self.noise)
        if self.space and generate(self.hidden.layout, world_of(self.hidden), self.task.functions()).draws:
            raise SegarError("Lab: a rule or the task draws random numbers, so that nobody can know what comes")

    @cached_property
    def hidden(self) -> Levels:
        """A level with the rules of the hidden world."""
        return self.distribution.sample(1, self.seed, "hidden", start=self.world)

    @cached_property
    def space(self) -> RuleSpace:
        """The rule space; raises :class:`LevelError` where the levels have none."""
        return rule_space_of(self.hidden)

    @cached_property
    def ranges(self) -> dict[str, dict[str, tuple[float, float]]]:
        """The least and the greatest value of each constant of each option, by their names."""
        laws = self.space.laws
        return {o.name: {p.__name__: laws[p].support for p in o.constants} for o in self.space.options}

    @cached_property
    def levels(self) -> Levels:
        """Those in which experiments begin, then those that questions are about."""
        return self.distribution.sample(START_LEVELS + QUESTION_LEVELS * self.questions, self.seed, "lab")

    @cached_property
    def other_levels(self) -> LevelDistribution:
        """The shifted distribution of levels."""
        if self.shifted is not None:
            return self.shifted
        priors = Prior(Velocity, GaussianNoise2D(std=1.0), Object), Prior(Mass, UniformNoise(0.5, 2.0), Object)
        return replace(self.distribution, priors=(*self.distribution.priors, *priors))

    @cached_property
    def task(self) -> Task:
        return task_of(self.hidden)

    @cached_property
    def places(self) -> dict[str, int]:
        """What is seen: names such as ``golfball.Position.x``, and their places in a state ``(entities * columns,)``."""
        layout, found = self.hidden.layout, dict[str, int]()
        for slot, kind in enumerate(layout.slots[:-1]):
            for factor in (f for f in layout.columns if issubclass(f, tuple(self.seen)) and kind.may_have(f)):
                for k, axis in enumerate((".x", ".y") if factor.width == 2 else ("",)):
                    at = slot * layout.width + layout.columns[factor] + k
                    found[f"{kind.name}.{factor.__name__}{axis}"] = at
        return found

    def noise_of(self, shape: tuple[int, ...], number: int) -> np.ndarray:
        """The noise of the experiment of that number, float32 ``(..., seen)``."""
        flags = {f.__name__ for f in self.hidden.layout.columns if issubclass(f, Flag)}
        scale = np.array([0.0 if name.split(".")[1] in flags else self.noise for name in self.places], np.float32)
        rng = np.random.Generator(np.random.SFC64((self.seed, self.world, number)))  # faster than the default one
        noise = rng.standard_normal(shape, np.float32)
        noise *= scale  # in place, because a new array takes longer than the products
        return noise

    def observed(self, states: np.ndarray, number: int) -> np.ndarray:
        """States, float64 ``(..., seen)``, as they are seen, with the noise of the experiment of that number."""
        return states + self.noise_of(states.shape, number) if self.noise else states

    def in_world(self, rules: Any) -> Levels:
        """A level in a world of other rules, with the world parameters that the hidden world has, too."""
        other = self.distribution.with_rules(rules).sample(1, self.seed, "hidden", start=self.world)
        known = dict(zip(self.hidden.layout.parameters, self.hidden.parameters[0], strict=True))
        row = [known.get(p, own) for p, own in zip(other.layout.parameters, other.parameters[0], strict=True)]
        return replace(other, parameters=np.array([row]))

    @cached_property
    def default_physics(self) -> Levels:
        """A level with the default rules."""
        return self.in_world(DEFAULT_RULES)

    def player(self, laws: Levels) -> Simulator:
        """What plays levels under the rules of these levels."""
        if laws.world not in self._simulators:
            self._simulators[laws.world] = Simulator(world_of(laws), laws.layout, self.task, cores())
        return self._simulators[laws.world]

    def play(
        self, laws: Levels, level: np.ndarray, values: np.ndarray, actions: np.ndarray,
        places: Sequence[int] | None = None,
    ) -> "Played":  # fmt: skip
        """What becomes of states under each of some laws, with the bits of :class:`segar.envs.VectorEnv`.

        Args:
            laws: levels whose rules and world parameters count, and not their entities.
            level: int ``(n,)``, which of :attr:`levels` a state is of.
            values: float64 ``(n, entities, columns)``, the first states.
            actions: float32 ``(n, steps, action size)``.
            places: what is noted, of ``entities * columns``; what is seen where it is None.
        """
        at = np.array(list(self.places.values()) if places is None else places)
        used, row = np.unique(level, return_inverse=True)
        number, steps, width = len(laws), actions.shape[1], len(used)
        parameters = np.repeat(laws.parameters, width, axis=0)
        there = replace(self.levels[np.tile(used, number)], layout=laws.layout, world=laws.world, parameters=parameters)
        n = number * len(level)
        state, result, simulator = State.empty(n, laws.layout), StepResult.empty(n), self.player(laws)
        state.level[:] = (np.arange(number)[:, None] * width + row.reshape(-1)).reshape(-1)
        state.values[:], acts = np.tile(values, (number, 1, 1)), np.tile(actions, (number, 1, 1))
        laws.layout.set_floor(state.values, parameters[state.level])
        seen, ends, solved = np.empty((steps + 1, n, len(at))), np.full(n, steps + 1), np.full(n, steps + 1)
        flat = state.values.reshape(n, -1)
        flat.take(at, axis=1, out=seen[0], mode="clip")
        for step in range(1, steps + 1):
            simulator.act(state, there, acts[:, step - 1], result)
            flat.take(at, axis=1, out=seen[step], mode="clip")
            running = ends > steps
            solved[running & result.success & (solved > steps)] = step
            ends[running & result.terminated] = step
        shape = number, len(level)
        states = seen.reshape(steps + 1, *shape, len(at)).transpose(1, 2, 0, 3)
        return Played(states, ends.reshape(shape), solved.reshape(shape))

    def language(self) -> dict[str, Any]:
        """What the experimenter is told, as plain data: all but the draw of the hidden world."""
        layout, values = self.hidden.layout, self.hidden.parameters[0]
        stated = {p: values[k].item() for k, p in enumerate(layout.parameters) if p not in self.space.parameters}
        functions, world = self.task.functions(), world_of(self.hidden)
        contacts = [rule for rule in (world.limit, world.wall_contact, world.pair_contact) if rule is not None]
        return {
            "aim": AIM,
            **{name: getattr(self, name) for name in ("budget", "most_steps", "noise", "passive", "trusted")},
            "levels": START_LEVELS,
            "entities": {slot.name: [t.__name__ for t in slot.types] for slot in layout.slots[:-1]},
            "seen": list(self.places),
            "unseen": [f.__name__ for f in layout.factors if not issubclass(f, tuple(self.seen))],
            "set": {f.__name__: list(bounds) for f, bounds in self.settable.items()},
            "units": {f.__name__: f.unit for f in (*layout.factors, *stated)},
            "parameters": {p.__name__: value for p, value in stated.items()},
            "walls": world.walls,
            "action": [list(self.task.action_low), list(self.task.action_high)],
            "sub_steps": self.task.sub_steps,
            "task": [source_of(rule) for name in ("act", "success", "terminated") for rule in getattr(functions, name)],
            "always": [source_of(rule) for rule in (*self.space.always, *contacts)],
            "exclusive": [[self.space.names[k] for k in group] for group in self.space.exclusive],
            "options": {o.name: self._option(o) for o in self.space.options},
        }

    def _option(self, option: RuleOption) -> dict[str, Any]:
        ranges, units = self.ranges[option.name], {p.__name__: p.unit for p in option.constants}
        constants = {name: {"unit": units[name], "from": low, "to": high} for name, (low, high) in ranges.items()}
        code = [source_of(rule) for rule in (*option.rules, *option.on_contact)]
        return {"words": option.words, "constants": constants, "rules": code}


AIM = (
    "Find which options of the rule space hold in this world, and their constants. Rules that always hold are given."
    " Experiment: choose a level, set factors of entities, act; see what happens. Predict: what a law of yours makes of an"
    ' experiment, at no cost. Answer once: {"law": {"options": {name: {constant: value}}}}. An answer without a law asks'
    " for questions, and ends the experiments."
)


@dataclass(frozen=True, eq=False)
class Played:
    """Episodes; arrays lead with the law and the case.

    Attributes:
        seen: float64 ``(laws, n, steps + 1, places)``, the first states and those after each step.
        ends: int ``(laws, n)``, after how many steps the task was over; ``steps + 1`` where it is not.
        solved: int ``(laws, n)``, after how many steps there was success; ``steps + 1`` where there was none.
    """

    seen: np.ndarray
    ends: np.ndarray
    solved: np.ndarray


def source_of(rule: Rule) -> dict[str, Any]:
    """The text of a rule's function, and the numbers that it takes from around it; no text where no file has it."""
    function = inspect.unwrap(rule.function)
    lines = linecache.getlines(function.__code__.co_filename, function.__globals__)
    text = "".join(inspect.getblock(lines[function.__code__.co_firstlineno - 1 :]))
    around = inspect.getclosurevars(function)
    numbers = {k: v for k, v in {**around.globals, **around.nonlocals}.items() if isinstance(v, (int, float))}
    return {"name": rule.name, "code": textwrap.dedent(text), "numbers": numbers}
