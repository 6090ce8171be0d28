"""Trials: episodes in a row on one level. Which of them runs follows from the number of episodes that were started."""

from typing import Any

MOST_TRIALS = 1_000_000


def trial_info(trials: int, episodes: Any, lengths: Any) -> dict[str, Any]:
    """What ``info`` says of trials; nothing where each level is played once.

    Args:
        trials: episodes on each level.
        episodes, lengths: int64 ``(num_envs,)``, arrays or tensors: how many were started, and the steps of the running ones.

    Returns:
        ``trial`` (int64, from 0): which episode on its level runs; ``new_level`` (bool): whether it is the first one and no
        step was taken yet.
    """
    if trials == 1:
        return {}
    trial = (episodes - 1) % trials
    return {"trial": trial, "new_level": (trial == 0) & (lengths == 0)}
