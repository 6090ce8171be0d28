"""What is said before training begins of what an agent learns badly or not at all from, and of what it does not see.

Some of it shows in random play. The environments there, their seed and the policy belong to this module, so that a run has the
same results with and without the look.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import Any

import numpy as np

from segar.envs import VectorEnv, play
from segar.evaluation import Random
from segar.experiments.levels.builders import Prepared, check_results
from segar.experiments.runs.level_prints import is_own, prints_of, share_of
from segar.language import Factor, Parameter, Position
from segar.levels import Levels
from segar.observations import OBSERVATIONS, StateVector

LARGE = 10.0  # a network whose weights start at the usual size learns badly from numbers beyond
SHARE = 0.01  # of the states; speeds exceed LARGE in fewer, after a collision
NUM_ENVS = 8  # of random play
NUMBER_STEPS = 200  # of random play, in which numbers may become large
ENTITY_STEPS = 50  # of random play, in which rules may change a factor
Hidden = Mapping[str, list[type[Factor]]]
Values = dict[tuple[str, type[Factor]], np.ndarray]  # of an entity's factor, [level or environment, component]


def advice(prepared: Prepared, policy: Any) -> Iterator[str]:
    """Warnings of what an agent with this policy learns badly or not at all from, of what it does not see, and of a test
    without new levels."""
    config, (train, test) = prepared.config, prepared.level_sets
    for name in check_results(prepared, train, test):
        yield (
            f"warning: the task's result '{name}' is several numbers per environment: the files of episodes hold it, and tables"
            " and claims have no column of it. Give each number a result of its own, such as lambda factors: ...[:, 0]"
        )
    if not prepared.task.functions().reward:
        yield (
            f"warning: the task {prepared.task.name} has no reward function: all rewards are 0, and an agent learns nothing by"
            " them"
        )
    if config.takes_no_step():
        rollout = config.algorithm.num_envs * config.algorithm.num_steps  # type: ignore[attr-defined]
        yield (
            f"warning: the agent stays untrained: {config.scale.frames:,} frames are one rollout ({rollout:,} frames) or less,"
            f" and algorithm.anneal lowers the learning rate to 0 in the last one. Give scale.frames={2 * rollout} or more, or"
            " algorithm.anneal=false"
        )
    if large := large_numbers(prepared):
        yield advice_on_numbers(large, prepared)
    if unseen := unseen_entities(prepared):
        yield advice_on_entities(unseen, prepared)
    if parameters := unseen_parameters(prepared):
        yield advice_on_parameters(parameters, prepared)
    if is_own(config.levels.train) and (share := share_of(prints_of(test), prints_of(train))):
        yield (
            f"warning: {share:.0%} of the test levels are training levels, too, so the gap says little or nothing of levels"
            " that the agent has not seen; name others: levels.test=..."
        )
    if config.trials > 1:
        yield from advice_on_trials(prepared, policy)


def advice_on_trials(prepared: Prepared, policy: Any) -> Iterator[str]:
    """A warning of several trials where the policy has no memory, or where it pays never to end one."""
    config = prepared.config
    if not hasattr(policy, "begin"):
        yield (
            f"warning: trials={config.trials}, and the policy of algorithm={config.algorithm.name} has no memory: it can carry"
            f" nothing from one trial to the next. It meets each level {config.trials} times in a row, and its trials differ by"
            " chance alone, so that the adaptation gain says nothing of it. An algorithm with a memory adapts:"
            " algorithm=ppo_recurrent"
        )
    elif getattr(config.algorithm, "joins_trials", False) and trials_cost(prepared):
        yield (
            f"warning: trials={config.trials}, and the task {prepared.task.name} rewards the first step"
            " with less than 0 everywhere. Returns go on over the trials of a level, so an agent that ends a trial early begins"
            " the next one and its costs early, and may learn not to end any. algorithm.joins_trials=false ends the return with"
            " each trial and keeps the memory (algorithm=ppo_recurrent_trials); or reward success"
        )


def trials_cost(prepared: Prepared) -> bool:
    """Whether a step of random play at the start of an episode has a negative reward in each environment."""
    _, (_, first) = random_play(prepared, 1)
    return bool((first.reward < 0).all())


def large_numbers(prepared: Prepared) -> dict[str, float]:
    """The numbers that exceed ``LARGE`` in more than ``SHARE`` of the states of random play, and the largest of each.

    One episode in each environment is played, at most ``NUMBER_STEPS`` of its steps. Of observations other than
    :class:`segar.observations.StateVector` nothing is known.

    Returns:
        The largest absolute value by the number's name, such as ``golfball.Hits``.
    """
    state = prepared.env_options()["observation"]
    if not isinstance(state, StateVector) or state.mask == "dict":
        return {}
    env, played = random_play(prepared, NUMBER_STEPS)
    names = env.observation.names  # type: ignore[attr-defined]
    numbers = np.concatenate([now.observation for now in played]).astype(float).reshape(-1, len(names))
    sizes = np.where(numbers == state.missing, 0.0, np.abs(numbers))
    is_large = (sizes > LARGE).mean(axis=0) > SHARE
    return {names[k]: float(sizes[:, k].max()) for k in np.flatnonzero(is_large)}


def advice_on_numbers(found: Mapping[str, float], prepared: Prepared) -> str:
    """What to say of the numbers that :func:`large_numbers` found: their names, and the settings that scale them."""
    factors: dict[str, float] = {}
    for name, value in found.items():
        factor = name.split(".")[1]
        factors[factor] = max(factors.get(factor, 0.0), value)
    known = prepared.config.observation.options.get("scale", {})
    overrides = [
        f"observation.options.scale.{factor}={_round_up(value * known.get(factor, 1.0)):g}"
        for factor, value in factors.items()
    ]
    largest = ", ".join(f"{name} up to {value:,.0f}" for name, value in found.items())
    return (
        f"warning: the observation has large numbers, from which an agent learns badly: {largest} in random play. Divide"
        f" them by constants: {' '.join(overrides)}"
    )


def _round_up(value: float) -> float:
    """The least number of one digit and zeros that is not below a positive one."""
    unit = 10.0 ** math.floor(math.log10(value))
    return math.ceil(value / unit) * unit


def unseen_entities(prepared: Prepared) -> dict[str, list[str]]:
    """The abstract entities of which the agent sees nothing, and their factors that differ between levels or change in play.

    An entity is abstract if it has no position. A state shows abstract entities only if its ``entities`` name them, so that
    nothing is found where ``entities`` are chosen, nor of hidden factors, nor of named families, whose abstract entities
    the paper's agents do not see, nor of other observations.

    Returns:
        The names of factors by the name of the entity.
    """
    (train, test), state = prepared.level_sets, prepared.env_options()["observation"]
    if not (is_own(prepared.config.levels.train) and isinstance(state, StateVector) and state.entities is None):
        return {}
    hidden = {
        slot.name: [f for f in dict.fromkeys(f for kind in slot.types for f in kind.declared) if state.has_number_of(f)]
        for slot in train.layout.slots
        if not slot.may_have(Position)
    }
    hidden = {name: factors for name, factors in hidden.items() if factors}
    if not hidden:
        return {}
    values = [_at_start(train, hidden), _at_start(test, hidden), *_in_play(prepared, hidden)]
    found: dict[str, list[str]] = {}
    for name, factors in hidden.items():
        for factor in factors:
            seen = np.concatenate([one[name, factor] for one in values if (name, factor) in one])
            if len(np.unique(seen, axis=0)) > 1:
                found.setdefault(name, []).append(factor.__name__)
    return found


def advice_on_entities(found: Mapping[str, list[str]], prepared: Prepared) -> str:
    """What to say of the entities that :func:`unseen_entities` found, and the setting that shows them."""
    shown = [slot.name for slot in prepared.level_sets[0].layout.slots if slot.may_have(Position) or slot.name in found]
    names = ", ".join(f"{factor} of {name}" for name, factors in found.items() for factor in factors)
    fix = _setting(f"entities=[{','.join(shown)}]", prepared)
    return (
        f"warning: the agent does not see {names}, which differs between levels or changes. A state shows entities without a"
        f" position only if they are named: {fix}"
    )


def _at_start(levels: Levels, hidden: Hidden) -> Values:
    """The values in the levels of entities and factors that these levels have."""
    layout = levels.layout
    there = [
        (name, f) for name, factors in hidden.items() for f in factors if name in layout.names and f in layout.columns
    ]
    return {(name, f): levels.values[:, layout.slot_index(name), layout.columns_of(f)] for name, f in there}


def _in_play(prepared: Prepared, hidden: Hidden) -> Iterator[Values]:
    """The values in the steps of random play."""
    env, (_, *played) = random_play(prepared, ENTITY_STEPS)
    for now in played:
        values = now.info["factors"]
        yield {
            (name, f): values[f.__name__].reshape(NUM_ENVS, -1, f.width)[:, env.levels.layout.slot_index(name)]
            for name, factors in hidden.items()
            for f in factors
        }


def unseen_parameters(prepared: Prepared) -> list[str]:
    """The names of the world parameters that differ between levels, of training or of test, and that the agent does not see.

    A state shows the parameters that its ``parameters`` name. Nothing is found of those that its ``hidden`` names, nor of
    named families, nor of other observations.
    """
    state = prepared.observations["train"]
    if not (is_own(prepared.config.levels.train) and isinstance(state, StateVector)):
        return []
    values: dict[type[Parameter], list[np.ndarray]] = {}
    for levels in prepared.level_sets:
        for parameter, column in zip(levels.layout.parameters, levels.parameters.T, strict=True):
            values.setdefault(parameter, []).append(column)
    differing = [parameter for parameter, columns in values.items() if len(np.unique(np.concatenate(columns))) > 1]
    chosen = (*state.chosen_parameters, *state.hidden_factors)
    return list(dict.fromkeys(parameter.__name__ for parameter in differing if not issubclass(parameter, chosen)))


def advice_on_parameters(found: Sequence[str], prepared: Prepared) -> str:
    """What to say of the parameters that :func:`unseen_parameters` found, and the settings that show them or say nothing."""
    state = prepared.observations["train"]
    shown = ",".join(dict.fromkeys([*(parameter.__name__ for parameter in state.chosen_parameters), *found]))
    fix, silence = _setting(f"parameters=[{shown}]", prepared), _setting(f"hidden=[{','.join(found)}]", prepared)
    if state.form == "table":  # in which parameters have no row
        fix = f"StateVector(entities=[], parameters=[{shown}]) beside the table"
    return (
        f"warning: the agent does not see {', '.join(found)}, which {'differs' if len(found) == 1 else 'differ'} between"
        f" levels. A state shows world parameters only if they are named: {fix}. Where the agent shall not see them, {silence}"
        " says so and ends this warning"
    )


def _setting(option: str, prepared: Prepared) -> str:
    """How an option of the observation is given."""
    is_named = prepared.config.observation.name in OBSERVATIONS
    return f"observation.options.{option}" if is_named else f"StateVector({option})"


def random_play(prepared: Prepared, steps: int) -> tuple[VectorEnv, list[Any]]:
    """Environments on the training levels, and the start and the first steps of random play there."""
    env = VectorEnv(prepared.level_sets[0], NUM_ENVS, seed=0, **prepared.env_options())
    played = list(islice(play(env, Random(0), env.reset()), steps + 1))
    env.close()
    return env, played
