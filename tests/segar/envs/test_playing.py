"""One loop plays episodes: it yields the start and every step, and knows which episodes are over."""

import numpy as np
import pytest

import segar
from segar.envs import VectorEnv, play

LEVELS = segar.family("empty-easy").sample(3, seed=0)


class Countdown:
    """A source of steps in which the episode of row i ends after i + 1 steps."""

    def __init__(self, n: int) -> None:
        self.num_envs, self.left, self.shrunk = n, np.arange(1, n + 1), []

    def step(self, actions):
        self.left = self.left - 1
        no = np.zeros(len(self.left), bool)
        return self.left, np.ones(len(self.left)), self.left == 0, no, {}


class Shrinking(Countdown):
    """The same, which drops rows that are over."""

    def shrink(self, kept):
        self.left = self.left[kept]
        self.shrunk.append(len(self.left))
        return self.left


def idle(now):
    return np.zeros((len(now.episodes), 2), np.float32)


def test_the_start_is_yielded_before_any_step():
    source = Countdown(3)
    start = next(play(source, idle, (source.left, {})))
    assert start.time == 0 and start.running.all() and not start.played.any() and not start.ended.any()


@pytest.mark.parametrize("kind", [Countdown, Shrinking])
def test_every_episode_is_played_to_its_end_once(kind):
    source = kind(8)
    lengths = np.zeros(8, int)
    for now in play(source, idle, (source.left, {})):
        lengths[now.episodes[now.played]] += 1
        assert (now.observation[now.ended] == 0).all()
    np.testing.assert_array_equal(lengths, np.arange(1, 9))


def test_a_source_that_can_shrink_does_so_whenever_half_of_its_rows_are_over():
    source = Shrinking(8)
    list(play(source, idle, (source.left, {})))
    assert source.shrunk == [4, 2, 1]


def test_actions_are_chosen_only_for_steps_that_are_asked_for():
    calls = []
    source = Countdown(3)
    steps = play(source, lambda now: calls.append(now.time) or idle(now), (source.left, {}))
    next(steps)
    assert calls == []
    next(steps)
    assert calls == [0]


def test_it_plays_an_environment_as_a_loop_of_ones_own_does():
    def make():
        env = VectorEnv(LEVELS, 3, seed=1, max_steps=5)
        return env, env.reset(seed=1, options={"levels": np.arange(3)})

    env, _ = make()
    expected = [env.step(np.full((3, 2), 0.1, np.float32))[:2] for _ in range(5)]
    env, start = make()
    found = list(play(env, lambda now: np.full((3, 2), 0.1, np.float32), start))
    assert [now.time for now in found] == [0, 1, 2, 3, 4, 5] and found[-1].ended.all()
    for (observation, reward), now in zip(expected, found[1:], strict=True):
        np.testing.assert_array_equal(now.observation, observation)
        np.testing.assert_array_equal(now.reward, reward)
