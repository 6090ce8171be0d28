"""What a page needs of a level set: modules that play and show it; its entities, factors and priors in words; and, to compare
players, returns of random play, of an idle agent and of the planner, and its plans."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box

from segar import language
from segar.engine import Call, described_world
from segar.envs import VectorEnv, environment_calls
from segar.errors import PriorError, SegarError
from segar.evaluation import find_baselines
from segar.hardness import make_starts
from segar.language import Entity, Factor, Task
from segar.levels import LevelDistribution, Levels, description_of, hash_of_levels
from segar.noise import Noise
from segar.observations import Observation, colour_of
from segar.playground.modules import Blobs, described_module
from segar.rendering import Stage, steps_per_second
from segar.tasks import task_of

AIMS = {
    "puttputt": "Hit the ball to the middle of the goal.",
    "invisiball": "Hit the ball to the middle of the goal; some of it is not to be seen.",
    "billiards": "Push the cue ball so that the others fall into the pockets, and it does not.",
}
BINS = 32  # of a prior's density
TINY = 1e-9  # a negative number that is nearly zero
TAIL = 0.002  # of a distribution without bounds that is not drawn, on each side
SEED = 0  # of random play, of the search, and of the randomness in rules


def described_set(
    levels: Levels, task: Task | None, observations: Sequence[tuple[str, Observation]], title: str, blobs: Blobs
) -> dict[str, Any]:
    """A level set with the modules that play it and make its observations.

    Args:
        observations: each with the name that the page gives it.

    Raises:
        SegarError: something has no form in WebAssembly; the message names it.
    """
    task = task or task_of(levels)
    envs = [VectorEnv(levels, 1, task=task, observation=one, seed=0) for _, one in observations]
    calls = [environment_calls(env) for env in envs]
    simulator = envs[0].simulator
    arrays = simulator.arrays_of(levels)
    entities = len(levels.layout.slots)
    sizes = {"envs": 1, "rows": 1, "levels": len(levels), "corners": arrays.vertex.shape[2]}
    step = Call(calls[0].step, {f"level_{name}": array for name, array in vars(arrays).items()})
    world = described_module({"start": calls[0].start[:1], "step": [step]}, sizes, entities, blobs)
    found = []
    for (name, _), env, one in zip(observations, envs, calls, strict=True):
        space = env.single_observation_space
        if not isinstance(space, Box):
            raise SegarError(
                f"a page shows observations that are one array, and {name} gives {space}; give its parts one by one,"
                f" such as observations=('state', 'rgb')"
            )
        module = described_module(
            {"begin": one.start[1:], "advance": one.advance, "write": one.write},
            sizes | {"bytes": int(np.prod(space.shape))},
            entities,
            blobs,
        )
        module |= {"name": name, "shape": list(space.shape), "dtype": space.dtype.name}
        found.append(module)
    changed = np.flatnonzero(_bits(levels.values) != _bits(levels.sampled_values)).astype(np.int32)
    return {
        **described_world(levels.layout, task),
        "title": title,
        "aim": aim_of(levels, task),
        "count": len(levels),
        "hash": hash_of_levels(levels),
        "module": world,
        "observations": found,
        "kinds": [_kind(kind) for kind in levels.layout.types],
        "slots": [
            {"name": slot.name, "kinds": [levels.layout.types.index(t) for t in slot.types], "optional": slot.optional}
            for slot in levels.layout.slots
        ],
        "agents": sorted(Stage(levels, simulator.world, task).agents),
        "factors": {factor.__name__: _factor(factor) for factor in levels.layout.factors},
        "worlds": {one.__name__: _factor(one) for one in levels.layout.parameters},
        "walls": simulator.world.walls,
        "rules": [rule.where for rule in simulator.source.rules],
        "steps_per_second": steps_per_second(levels, task),
        "types": blobs.add(np.ascontiguousarray(levels.types, np.int16).tobytes()),
        "indices": levels.provenance.indices.tolist(),
        "description": {**description_of(levels), "most_vertices": levels.vertices.shape[2]},
        "sampled": [blobs.add(changed.tobytes()), blobs.add(levels.sampled_values.ravel()[changed].tobytes())],
        "priors": _priors(levels.distribution) if isinstance(levels.distribution, LevelDistribution) else [],
    }


def described_baselines(levels: Levels, task: Task, blobs: Blobs) -> dict[str, Any]:
    """The baselines that ``find_baselines(levels, task, rng=np.random.default_rng(0))`` gives, with the planner's actions.

    The actions of all plans stand one after the other, float32; the keys, uint64, decide what rules draw in the plans.
    """
    found = find_baselines(levels, task, rng=np.random.default_rng(SEED), seed=SEED)
    plan = found.plan
    assert plan is not None  # find_baselines keeps it
    actions = [plan.actions[i, :steps].tobytes() for i, steps in enumerate(plan.steps)]
    return {
        **{name: getattr(found, name).tolist() for name in ("random", "idle", "oracle")},
        "solved": plan.solved.tolist(),
        "steps": plan.steps.tolist(),
        "actions": blobs.add(b"".join(actions)),
        "keys": blobs.add(make_starts(levels, task, SEED).state.key.tobytes()),
    }


def aim_of(levels: Levels, task: Task | None = None) -> str:
    """The aim of a task in a sentence for who plays it; empty for tasks of the user's own without a goal."""
    known = AIMS.get((task or task_of(levels)).name.partition("-")[0], "")
    return known or (
        AIMS["puttputt"] if any(issubclass(kind, language.GoalTile) for kind in levels.layout.types) else ""
    )


def name_of(observation: str | Observation) -> str:
    """What a page calls an observation."""
    return observation if isinstance(observation, str) else type(observation).__name__


def _bits(values: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(values).view(np.uint64).ravel()


def _kind(kind: type[Entity]) -> dict[str, Any]:
    colour = colour_of(kind)
    return {
        "name": kind.__name__,
        "tile": language.Floor in kind.declared,
        "hole": language.Consumes in kind.declared,
        "goal": issubclass(kind, language.GoalTile),
        "holds": [factor.__name__ for factor in kind.declared if factor.width],
        "low": colour.low,
        "high": colour.high or colour.low,
        "factor": colour.factor.__name__ if colour.factor else None,
        "span": colour.span,
    }


def _factor(factor: type[Factor]) -> dict[str, Any]:
    return {
        "width": factor.width,
        "unit": factor.unit,
        "bounds": factor.bounds,
        "possible": factor.possible_values(),
        "whole": issubclass(factor, language.Count),
        "flag": issubclass(factor, language.Flag),
        "negative": bool(factor.is_possible(np.array([-1.0, -TINY])).any()),
        "zero": bool(factor.is_possible(np.array(0.0))),
    }


def _priors(distribution: LevelDistribution) -> list[dict[str, Any]]:
    """Densities of the factors of one number and of parameters, in bins, where they have distribution functions."""
    found = []
    for entity, laws in distribution.marginals().items():
        for factor, law in laws.items():
            if isinstance(law, Noise) and law.width == 1:
                drawn = density(law)
                if drawn is not None:
                    found.append({"entity": entity, "factor": factor.__name__, "law": repr(law), **drawn})
    return found


def density(law: Noise) -> dict[str, Any] | None:
    """Bounds of a distribution, and the probability of each bin between them; None without a distribution function."""
    try:
        low, high = (float(x) for x in np.ravel(law.support))
        low = low if np.isfinite(low) else float(law.icdf(TAIL))
        high = high if np.isfinite(high) else float(law.icdf(1 - TAIL))
        if not low < high:
            return {"low": low, "high": low, "bins": [1.0]}
        below = np.asarray(law.cdf(np.linspace(low, high, BINS + 1)), float)
        below[0] = 0.0  # an atom at the lower bound counts
        return {"low": low, "high": high, "bins": np.round(np.diff(below), 4).tolist()}
    except PriorError:
        return None
