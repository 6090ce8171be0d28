"""A task: what an action does, what is rewarded, and when an episode is over, as typed functions."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from segar.errors import SegarError
from segar.language.layout import Factors
from segar.language.pickling import packed
from segar.language.rule_definition import Rule, as_rule, value_rule

Function = Callable[..., Any]
NO_LIMIT = 2**62
"""``max_steps`` of episodes that somebody else ends, such as Gymnasium's ``TimeLimit``."""
FUNCTIONS = ("act", "reward", "terminated", "success", "death")


@dataclass(frozen=True)
class TaskFunctions:
    """What a task adds to a kernel: the rules of its action, and functions of the state.

    Rewards add up; a truth holds if any of its functions holds.
    """

    act: tuple[Rule, ...]
    reward: tuple[Rule, ...]
    terminated: tuple[Rule, ...]
    success: tuple[Rule, ...]
    death: tuple[Rule, ...]
    action_low: tuple[float, ...]
    action_high: tuple[float, ...]

    @property
    def of_state(self) -> tuple[Rule, ...]:
        """All functions of the state, in the order in which they are numbered."""
        return (*self.reward, *self.terminated, *self.success, *self.death)


@dataclass(frozen=True)
class Task:
    """A task, compiled into the kernel together with the rules.

    Each function takes entities, factors and parameters by type, as rules do. ``reward`` is summed over all tuples of
    entities that match, but of arguments hinted ``Best[...]`` only the greatest value counts; ``terminated``,
    ``success`` and ``death`` hold if they hold for any, and for all of what is hinted ``Every[...]``::

        def nearness(ball: Ball, hole: Best[Hole]) -> float: ...  # of the nearest hole, summed over balls
        def all_down(cue: CueBall, ball: Every[Ball]) -> bool: ...

    Each function may be a tuple of functions: their rewards add up, and a truth holds if any of them does. Without functions
    a reward is 0, and a truth never holds.

    A task has no memory beside the factors: ``act`` writes to a factor what a reward needs to know of the past.

    Raises:
        SegarError: a function is none, or ranges or numbers of steps make no sense.

    Attributes:
        act: rule with an ``Action`` (of several, some may go without); applied once per step before the first sub-step,
            differentials unscaled.
        reward: number, evaluated once per step after the last sub-step.
        terminated: truth, evaluated after every sub-step; the step ends where it holds.
        success: truth, evaluated at the end of the step and reported in ``info``.
        death: truth, evaluated at the end of the step and reported in ``info``.
        action_low, action_high: range of each number of the action; values outside are clipped.
        max_steps: an episode is truncated after this many steps.
        sub_steps: sub-steps per step.
        results: name to a function of the :class:`Factors` of a batch of environments that returns an array
            ``(num_envs, ...)``. :meth:`results_of` calls them.
        demo_actions: function of the :class:`Factors` of a batch of environments that gives the actions of a scripted
            player, float32 ``(num_envs, action size)``, for demonstrations and for comparison. Whoever plays it calls
            :meth:`scripted_actions`, so that it always gets a batch, of one environment too.
    """

    name: str
    act: Function | tuple[Function, ...]
    reward: Function | tuple[Function, ...] = ()
    terminated: Function | tuple[Function, ...] = ()
    success: Function | tuple[Function, ...] = ()
    death: Function | tuple[Function, ...] = ()
    action_low: tuple[float, ...] = (-1.0, -1.0)
    action_high: tuple[float, ...] = (1.0, 1.0)
    max_steps: int = 100
    sub_steps: int = 5
    results: Mapping[str, Callable[[Factors], np.ndarray]] = field(default_factory=dict, hash=False)
    demo_actions: Callable[[Factors], np.ndarray] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "results", MappingProxyType({**self.results}))
        for name in FUNCTIONS:
            for value in _several(getattr(self, name)):
                if not callable(value):
                    raise SegarError(
                        f"task {self.name}: {name} must be a function, or a tuple of functions, not {value!r}"
                        + (f"; leave {name}= out where there is none" if name != "act" else "")
                    )
        if len(self.action_low) != len(self.action_high) or not self.action_low:
            raise SegarError(
                f"task {self.name}: action_low and action_high must have the same length, at least 1, and action_low"
                f" {self.action_low!r} has {len(self.action_low)}, action_high {self.action_high!r} has {len(self.action_high)}"
            )
        for name in ("action_low", "action_high"):
            for value in getattr(self, name):
                if not isinstance(value, (int, float, np.integer, np.floating)) or not np.isfinite(value):
                    raise SegarError(f"task {self.name}: {name} must be finite numbers, not {value!r}")
        for k, (low, high) in enumerate(zip(self.action_low, self.action_high, strict=True)):
            if not low < high:
                raise SegarError(
                    f"task {self.name}: action_low must be below action_high, but component {k} of the action goes from {low!r}"
                    f" to {high!r}; leave out a component that cannot vary"
                )
        for name in ("max_steps", "sub_steps"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
                raise SegarError(f"task {self.name}: {name} must be a whole number of at least 1, not {value!r}")

    def scripted_actions(self, factors: Factors) -> np.ndarray:
        """The actions of the scripted player, float32 ``(num_envs, action size)``; ``(action size,)`` of a single environment.

        Args:
            factors: ``env.factors``, of a batch or of a single environment.

        Raises:
            SegarError: the task has no scripted player, or ``demo_actions`` returns an array of another shape.
        """
        if self.demo_actions is None:
            raise SegarError(
                f"task {self.name} has no scripted player. Give the task demo_actions=, a function of factors that returns"
                " actions of shape (num_envs, action size); or let another policy play"
            )
        batch = _batch(factors)
        actions = np.asarray(self.demo_actions(batch), np.float32)
        expected = (batch.num_envs, len(self.action_low))
        if actions.shape != expected:
            raise SegarError(
                f"task {self.name}: demo_actions must return one row of actions for each environment, an array of shape"
                f" {expected}, not {actions.shape}. The factors that it is given lead with the environment, of one"
                " environment too: factors['Position'] has the shape (num_envs, entities, 2)"
            )
        return actions if batch is factors else actions[0]

    def results_of(self, factors: Factors) -> dict[str, Any]:
        """What :attr:`results` say of states, by name: arrays ``(num_envs, ...)``; numbers and truths, or arrays without the
        first axis, of a single environment.

        Args:
            factors: ``env.factors``, or ``env.factors_of(info)``.

        Raises:
            SegarError: a function returns an array of another shape.
        """
        batch, found = _batch(factors), {}
        for name, function in self.results.items():
            array = np.asarray(function(batch))
            if array.shape[:1] != (batch.num_envs,):
                raise SegarError(
                    f"the result '{name}' of the task has the shape {array.shape} for {batch.num_envs} environments. It must"
                    " return an array (num_envs, ...), a row for each environment"
                )
            found[name] = array if batch is factors else array[0] if array.ndim > 1 else array.item()
        return found

    def __getstate__(self) -> dict[str, Any]:
        return packed(vars(self))

    def functions(self) -> TaskFunctions:
        """The traced functions; raises :class:`RuleError`."""
        return TaskFunctions(
            act=tuple(map(as_rule, _several(self.act))),
            reward=tuple(value_rule(term, truth=False) for term in _several(self.reward)),
            terminated=_truths(self.terminated),
            success=_truths(self.success),
            death=_truths(self.death),
            action_low=tuple(map(float, self.action_low)),
            action_high=tuple(map(float, self.action_high)),
        )


def _truths(functions: Function | tuple[Function, ...]) -> tuple[Rule, ...]:
    return tuple(value_rule(function, truth=True) for function in _several(functions))


def _batch(factors: Any) -> Factors:
    """The factors as those of a batch."""
    if not isinstance(factors, Factors):
        raise SegarError("give env.factors; info['factors'] does not say which entity is what")
    return factors.batch()


def _several(functions: Function | tuple[Function, ...]) -> tuple[Function, ...]:
    return functions if isinstance(functions, tuple) else (functions,)
