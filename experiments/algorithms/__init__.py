"""Algorithms: each is a learner behind the protocol of :mod:`segar.experiments.algorithms.learner`.

Authors of algorithms import the protocol from here, and :class:`PPO`, the simplest learner to start from; the other learners
lie in modules of their own. The modules of ``experiments`` name the file instead, so that the code that a run is resumed
under is only the code that it executes.
"""

from segar.experiments.algorithms.learner import Learner, PolicyNetwork, learner_class, make_learner
from segar.experiments.algorithms.ppo import PPO, PPOPolicy

__all__ = ["PPO", "Learner", "PPOPolicy", "PolicyNetwork", "learner_class", "make_learner"]
