"""What a page needs to compare players: returns of random play, of an idle agent and of the planner, and its plans."""

from typing import Any

import numpy as np

from segar.evaluation import find_baselines
from segar.hardness import make_starts
from segar.language import Task
from segar.levels import Levels
from segar.playground.modules import Blobs

SEED = 0  # of random play, of the search, and of the randomness in rules


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
