"""What several trials on a level ask of an agent, said before training begins."""

from itertools import islice
from typing import Any

from segar.envs import VectorEnv, play
from segar.evaluation import Random
from segar.experiments.levels.builders import Prepared

NUM_ENVS = 8


def advice_on_trials(prepared: Prepared, policy: Any) -> list[str]:
    """Warnings, where there are several trials and the policy has no memory, or it pays never to end one."""
    config = prepared.config
    if config.trials == 1:
        return []
    if not hasattr(policy, "begin"):
        return [
            f"warning: trials={config.trials}, and the policy of algorithm={config.algorithm.name} has no memory: it can carry"
            f" nothing from one trial to the next. It meets each level {config.trials} times in a row, and its trials differ by"
            " chance alone, so that the adaptation gain says nothing of it. An algorithm with a memory adapts:"
            " algorithm=ppo_recurrent"
        ]
    if getattr(config.algorithm, "joins_trials", False) and trials_cost(prepared):
        return [
            f"warning: trials={config.trials}, and the task {prepared.task.name} rewards the first step"
            " with less than 0 everywhere. Returns go on over the trials of a level, so an agent that ends a trial early begins"
            " the next one and its costs early, and may learn not to end any. algorithm.joins_trials=false ends the return with"
            " each trial and keeps the memory (algorithm=ppo_recurrent_trials); or reward success"
        ]
    return []


def trials_cost(prepared: Prepared) -> bool:
    """Whether a step of random play at the start of an episode has a negative reward in each of ``NUM_ENVS`` environments,
    which are this function's own."""
    env = VectorEnv(prepared.level_sets[0], NUM_ENVS, seed=0, **prepared.env_options())
    _, first = islice(play(env, Random(0), env.reset()), 2)
    env.close()
    return bool((first.reward < 0).all())
