"""Episodes that Python and a page play alike: both say what they saw by the same numbers."""

from collections.abc import Sequence
from itertools import count, islice
from typing import Any

import numpy as np

from segar.envs import VectorEnv
from segar.levels import Levels
from segar.policies import NetworkPolicy
from segar.tasks import task_of
from tests.segar.playground.browsers import Browser

PRIMES = (16777619, 2246822519)  # odd, so that every bit of the bytes counts

PLAY = """
const page = window.playground, primes = argument.primes;
const sums = (array) => {
  const bytes = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
  return primes.map((prime) => {
    let sum = 0;
    for (let k = 0; k < bytes.length; k++) sum = (Math.imul(sum, prime) + bytes[k] + 1) | 0;
    return sum >>> 0;
  });
};
return argument.episodes.map(({ level, seed, actions }) => {
  const world = page.world;
  world.start(level, BigInt(seed));
  const told = [];
  const tell = () => told.push([
    sums(world.values), page.about.sets[0].observations.map((_, k) => sums(world.observe(k))),
    String(world.rewards.at(-1) ?? 0), world.terminated, world.truncated, world.success, world.death,
  ]);
  tell();
  if (!actions) page.policy.begin();
  for (let k = 0; !world.over && k < (actions?.length ?? Infinity); k++) {
    world.step(actions ? actions[k] : page.policy.action(world));
    tell();
  }
  return { told, failed: world.failed, total: String(world.total) };
});
"""


def sums_of(array: np.ndarray) -> list[int]:
    """Two numbers of 32 bits that stand for the bytes of an array."""
    data = np.frombuffer(array.tobytes(), np.uint8).astype(np.uint32) + np.uint32(1)
    found = []
    for prime in PRIMES:
        powers = np.ones(len(data), np.uint32)
        powers[1:] = prime
        powers = np.multiply.accumulate(powers, dtype=np.uint32)[::-1]
        found.append(int((data * powers).sum(dtype=np.uint32)))
    return found


def episodes_of(levels: Levels, number: int, steps: int | None, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Random episodes, some with actions beyond the range; those of the policy, to their end, where ``steps`` is None."""
    task = task_of(levels)
    low, high = np.array(task.action_low), np.array(task.action_high)
    return [
        {
            "level": int(rng.integers(len(levels))),
            "seed": str(int(rng.integers(2**63)) * 2 + 1),
            "actions": None
            if steps is None
            else rng.uniform(1.2 * low, 1.2 * high, (steps, len(low))).astype(np.float32).tolist(),
        }
        for _ in range(number)
    ]


def assert_played_alike(
    levels: Levels,
    observations: Sequence[Any],
    browser: Browser,
    episodes: list[Any],
    policy: NetworkPolicy | None = None,
) -> None:
    """The page that is open says of the episodes, which are many steps, what the processor's own environments say."""
    found, expected = play_in(browser, episodes), play_natively(levels, observations, episodes, policy)
    assert sum(len(one["told"]) for one in expected) > 100
    for k, (mine, theirs) in enumerate(zip(expected, found, strict=True)):
        assert (k, mine) == (k, theirs)


def play_natively(
    levels: Levels, observations: Sequence[Any], episodes: Sequence[dict[str, Any]], policy: NetworkPolicy | None = None
) -> list[dict[str, Any]]:
    """What the processor's own environments say of the episodes."""
    return [_play_one(levels, observations, one, policy) for one in episodes]


def _play_one(
    levels: Levels, observations: Sequence[Any], episode: dict[str, Any], policy: NetworkPolicy | None
) -> dict[str, Any]:
    options = {"levels": np.array([episode["level"]])}
    envs = [
        VectorEnv(levels, 1, observation=one, seed=int(episode["seed"]), autoreset_mode="Disabled")
        for one in observations
    ]
    seen = [env.reset(options=options)[0][0] for env in envs]
    told: list[Any] = []
    rewards, ends = [], (False, False, False, False)

    def tell(reward: float) -> None:
        told.append([sums_of(envs[0].state().state.values[0]), [sums_of(one) for one in seen], float(reward), *ends])

    tell(0.0)
    if policy is not None:
        policy.begin(envs[0])
    actions = (policy(seen[0][None])[0] if policy is not None else episode["actions"][k] for k in count())
    for action in islice(actions, episode["actions"] and len(episode["actions"])):
        results = [env.step(np.array([action], np.float32)) for env in envs]
        seen = [result[0][0] for result in results]
        _, reward, terminated, truncated, info = results[0]
        rewards.append(float(reward[0]))
        ends = (bool(terminated[0]), bool(truncated[0]), bool(info["success"][0]), bool(info["death"][0]))
        tell(reward[0])
        if ends[0] or ends[1]:
            break
    return {"told": told, "failed": None, "total": sum(rewards, 0.0)}


def play_in(browser: Browser, episodes: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """What the page that is open says of the episodes."""
    found = browser.run(PLAY, {"primes": PRIMES, "episodes": episodes})
    for one in found:
        one["total"] = float(one["total"])
        for told in one["told"]:
            told[2] = float(told[2])
    return found
