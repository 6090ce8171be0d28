"""One loop plays episodes: it yields the start and every step, and knows which episodes are over."""

import numpy as np
import pytest

import segar
from segar.envs import VectorEnv, play
from segar.errors import SegarError

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


def idle(observations):
    return np.zeros((len(observations), 2), np.float32)


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
    steps = play(source, lambda seen: calls.append(len(seen)) or idle(seen), (source.left, {}))
    next(steps)
    assert calls == []
    next(steps)
    assert calls == [3]


class Begun:
    """Notes what it begins with and what it observes."""

    def begin(self, env):
        self.env, self.seen = env, []

    def __call__(self, observations):
        self.seen.append(len(observations))
        return idle(observations) + 1


def test_a_policy_begins_with_what_is_stepped_before_it_acts():
    policy, source = Begun(), Shrinking(4)
    list(play(source, policy, (source.left, {})))
    assert policy.env is source and policy.seen == [4, 4, 2, 1]


def test_a_policy_that_takes_something_else_at_the_beginning_is_refused():
    policy, source = Begun(), Countdown(2)
    policy.begin = lambda: None
    with pytest.raises(SegarError, match="must take one argument"):
        list(play(source, policy, (source.left, {})))


def test_a_policy_can_be_asked_for_running_episodes_only():
    policy, source = Begun(), Countdown(3)
    policy.only_running = True
    _, *steps = play(source, policy, (source.left, {}))
    acted = [now.action[:, 0].tolist() for now in steps]
    assert policy.seen == [3, 2, 1] and acted == [[1, 1, 1], [0, 1, 1], [0, 0, 1]]


def test_it_plays_an_environment_as_a_loop_of_ones_own_does():
    def make():
        env = VectorEnv(LEVELS, 3, seed=1, max_steps=5)
        return env, env.reset(seed=1, options={"levels": np.arange(3)})

    env, _ = make()
    expected = [env.step(np.full((3, 2), 0.1, np.float32))[:2] for _ in range(5)]
    env, start = make()
    found = list(play(env, lambda seen: np.full((3, 2), 0.1, np.float32), start))
    assert [now.time for now in found] == [0, 1, 2, 3, 4, 5] and found[-1].ended.all()
    for (observation, reward), now in zip(expected, found[1:], strict=True):
        np.testing.assert_array_equal(now.observation, observation)
        np.testing.assert_array_equal(now.reward, reward)
