"""The whole range of the task's actions is used, whatever it is: on a bandit, both ways to act find the best action."""

import numpy as np
import pytest

import segar
from segar.experiments.algorithms.learner import learner_class, make_learner
from segar.experiments.evaluation.episodes import play_episodes
from segar.experiments.settings import PPOConfig, SACConfig

LEVELS = segar.family("empty-easy").with_rules(()).sample(2, seed=0)
LOW, HIGH, STEPS = -3.0, 7.0, 5
FAST = {"num_envs": 16, "num_steps": 16, "epochs": 4, "minibatches": 4, "gamma": 0.0, "learning_rate": 3e-3}
OFF_POLICY = {"num_envs": 4, "num_steps": 8, "warmup": 64, "batch_size": 32, "capacity": 4000, "gamma": 0.0}
OFF_POLICY |= {"learning_rate": 3e-3, "widths": (32,), "temperature": 0.02}
ALGORITHMS = {  # the two distributions of actions; the other algorithms take these
    "ppo": (PPOConfig(**FAST, widths=(32,)), "state", 6_000),
    "sac": (SACConfig(**OFF_POLICY), "state", 2_000),
}


def bandit() -> segar.Task:
    """A task whose reward is its only action, which lies between -3 and 7: 7 is the best."""

    def nothing(ball: segar.GolfBall, action: segar.Action) -> segar.SetFactor[segar.Velocity]:
        return segar.SetFactor[segar.Velocity](ball[segar.Velocity], (0.0 * action[0], 0.0))

    def gain(ball: segar.GolfBall, action: segar.Action) -> float:
        return action[0]

    return segar.Task("bandit", nothing, gain, action_low=(LOW,), action_high=(HIGH,), max_steps=STEPS)


def returns(config, observation: str, frames: int) -> np.ndarray:
    options = {"observation": observation, "task": bandit(), "unit_actions": True}
    kind = learner_class(config)
    env = kind.make_env(LEVELS, config.num_envs, seed=0, **options)
    learner = make_learner(kind, config, env, frames, seed=0)
    while learner.frames < frames:
        learner.iterate()
    rows = play_episodes(learner.policy, LEVELS, np.arange(2), options, rng=None, seed=0)
    return np.array([row["return"] for row in rows])


@pytest.mark.parametrize(
    "name", ["ppo", *(pytest.param(name, marks=pytest.mark.slow) for name in ALGORITHMS if name != "ppo")]
)
def test_the_best_action_at_the_end_of_the_range_is_found(name):
    config, observation, frames = ALGORITHMS[name]
    assert (returns(config, observation, frames) > 0.95 * HIGH * STEPS).all()
