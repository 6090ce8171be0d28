"""Abstract entities and world parameters that a state does not show by default, although they differ, found before training
begins."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import Any

import numpy as np

from segar.envs import VectorEnv, play
from segar.evaluation import Random
from segar.experiments.levels.builders import Prepared
from segar.experiments.runs.level_prints import is_own
from segar.language import Factor, Parameter, Position
from segar.levels import Levels
from segar.observations import OBSERVATIONS, StateVector

NUM_ENVS, MOST_STEPS = 8, 50  # of random play, in which rules may change a factor
Hidden = Mapping[str, list[type[Factor]]]
Values = dict[tuple[str, type[Factor]], np.ndarray]  # of an entity's factor, [level or environment, component]


def unseen_entities(prepared: Prepared) -> dict[str, list[str]]:
    """The abstract entities of which the agent sees nothing, and their factors that differ between levels or change in play.

    An entity is abstract if it has no position. A state shows abstract entities only if its ``entities`` name them, so that
    nothing is found where ``entities`` are chosen, nor of hidden factors, nor of named families, whose abstract entities
    the paper's agents do not see, nor of other observations.

    Returns:
        The names of factors by the name of the entity.
    """
    (train, test), options = prepared.level_sets, prepared.env_options()
    state = options["observation"]
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
    values = [*_at_start(train, hidden), *_at_start(test, hidden), *_in_play(train, hidden, options)]
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
    entities = f"entities=[{','.join(shown)}]"
    fix = (
        f"observation.options.{entities}"
        if prepared.config.observation.name in OBSERVATIONS
        else f"StateVector({entities})"
    )
    return (
        f"warning: the agent does not see {names}, which differs between levels or changes. A state shows entities without a"
        f" position only if they are named: {fix}"
    )


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
    fix, silence = f"parameters=[{shown}]", f"hidden=[{','.join(found)}]"
    if prepared.config.observation.name in OBSERVATIONS:
        fix, silence = f"observation.options.{fix}", f"observation.options.{silence}"
    else:
        fix, silence = f"StateVector({fix})", f"StateVector({silence})"
    if state.form == "table":  # in which parameters have no row
        fix = f"StateVector(entities=[], parameters=[{shown}]) beside the table"
    return (
        f"warning: the agent does not see {', '.join(found)}, which {'differs' if len(found) == 1 else 'differ'} between"
        f" levels. A state shows world parameters only if they are named: {fix}. Where the agent shall not see them, {silence}"
        " says so and ends this warning"
    )


def _at_start(levels: Levels, hidden: Hidden) -> Iterator[Values]:
    """The values in the levels of entities and factors that these levels have."""
    layout = levels.layout
    there = [
        (name, f) for name, factors in hidden.items() for f in factors if name in layout.names and f in layout.columns
    ]
    columns = {f: slice(layout.columns[f], layout.columns[f] + f.width) for _, f in there}
    yield {(name, f): levels.values[:, layout.slot_index(name), columns[f]] for name, f in there}


def _in_play(levels: Levels, hidden: Hidden, options: Mapping[str, Any]) -> Iterator[Values]:
    """The values in the steps of random play, whose environments and policy belong to this function."""
    env = VectorEnv(levels, NUM_ENVS, seed=0, **options)
    for now in islice(play(env, Random(0), env.reset()), 1, MOST_STEPS + 1):
        values = now.info["factors"]
        yield {
            (name, f): values[f.__name__].reshape(NUM_ENVS, -1, f.width)[:, levels.layout.slot_index(name)]
            for name, factors in hidden.items()
            for f in factors
        }
    env.close()
