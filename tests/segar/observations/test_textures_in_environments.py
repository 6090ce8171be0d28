"""Textured pixels in environments: episodes, snapshots, interventions, and Gymnasium's single face."""

import numpy as np

import segar
from segar.language.factors import Charge, Mass, StoredEnergy
from segar.observations.pixels.textured import TexturedPixels
from tests.segar.observations.scenes import random_textures

LEVELS = segar.family("objectsx3-hard").sample(20, seed=0)
ACTIONS = np.random.default_rng(0).uniform(-1, 1, (60, 32, 2)).astype(np.float32)


def environment(**options: object) -> segar.envs.VectorEnv:
    observation = TexturedPixels(random_textures(4), **options)
    return segar.envs.VectorEnv(LEVELS, 32, observation=observation, seed=3, max_steps=40)


def test_energies_that_are_spent_show_only_where_patterns_follow():
    still, following = environment(), environment(follow=True)
    for env in (still, following):
        env.reset(seed=1)
    differing = 0
    for action in ACTIONS[:30]:
        (a, *_, info), (b, *_) = still.step(action), following.step(action)
        changed = (info["factors"][StoredEnergy.__name__] != LEVELS.values[info["level"]][..., energy()]).any(axis=1)
        differs = (a != b).any(axis=(1, 2, 3))
        assert not differs[~changed].any()
        differing += differs.sum()
    assert differing > 0


def energy() -> int:
    return LEVELS.layout.columns[StoredEnergy]


def test_an_intervention_shows_at_once_and_only_where_it_happened():
    env = environment(hidden=(Mass,))
    before, _ = env.reset(seed=1)
    where = np.arange(32) % 2 == 0
    after = env.intervene("golfball", Charge, -0.7, where=where)
    np.testing.assert_array_equal((before != after).any(axis=(1, 2, 3)), where)
    np.testing.assert_array_equal(env.intervene("golfball", Mass, 5.0), after)
