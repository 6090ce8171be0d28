"""Tuples, dicts, stacks, previous actions and chance: whole in every environment, and reproducible to the bit."""

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces
from gymnasium.utils.env_checker import check_env
from tensordict import TensorDict
from torchrl.envs.utils import check_env_specs

import segar
from segar import Charge, Mass, SegarError
from segar.envs import Env, Snapshot, TorchRLEnv, VectorEnv
from segar.observations import Colour, Multi, OneOf, Pixels, PreviousActions, Stack, StateVector
from segar.observations.composed.stack import BoundStack
from segar.observations.protocol import empty_batch, leaves, map_leaves

LEVELS = segar.family("objectsx1-hard").sample(12, seed=0)
RED = Pixels(colours={segar.GolfBall: Colour((255, 0, 0))})
COMPOSED: dict[str, Any] = {
    "tuple": ("rgb", "state"),
    # Gymnasium sorts the names of a dict, and these are not.
    "dict": {"state": StateVector(mask="dict"), "look": Stack("rgb", 3), "past": PreviousActions(2)},
    "stack of states": Stack("state", 4),
    "planes": Stack(Pixels(channels="first"), 4),
    "per episode": OneOf(["rgb", RED], weights=[1, 3]),
    "per level": Multi([OneOf([Stack("rgb", 2), Stack(RED, 2)], per="level"), PreviousActions()]),
    "textures": {"look": Stack("textures", 2)},
}
STEPS, MAX_STEPS = 30, 11


def actions(step: int, num_envs: int) -> np.ndarray:
    """Actions of which those of the first environments do not depend on the batch; some are out of range."""
    return np.random.default_rng(step).uniform(-1.5, 1.5, (num_envs, 2)).astype(np.float32)


def same(a: Any, b: Any) -> bool:
    return all(np.array_equal(x, y) for x, y in zip(leaves(a), leaves(b), strict=True))


def part(observation: Any, index: Any) -> Any:
    return map_leaves(lambda array: array[index].copy(), observation)


def roll(env: VectorEnv, steps: int = STEPS, rows: Any = slice(None)) -> list[Any]:
    """Everything observed in a rollout with autoreset, last observations of episodes included."""
    trail = [part(env.reset(seed=5)[0], rows)]
    for step in range(steps):
        observed, _, terminated, truncated, info = env.step(actions(step, env.num_envs))
        ended = terminated | truncated
        assert ended.any() == ("final_obs" in info)
        final = info["final_obs"] if ended.any() else map_leaves(np.zeros_like, observed)
        trail.append((part(observed, rows), part(final, rows)))
    return trail


@pytest.mark.parametrize("observation", COMPOSED.values(), ids=COMPOSED)
def test_the_environment_checker_passes_and_observations_are_in_their_space(observation):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(Env(LEVELS, observation=observation, seed=0), skip_render_check=True)
    env = VectorEnv(LEVELS, 5, observation=observation, seed=0)
    assert env.observation_space.contains(env.reset()[0]) and env.observation_space.contains(env.step(actions(0, 5))[0])


@pytest.mark.parametrize("observation", COMPOSED.values(), ids=COMPOSED)
def test_batch_threads_and_copying_change_no_bit(observation):
    def env(num_envs: int, **options: Any) -> VectorEnv:
        return VectorEnv(LEVELS, num_envs, observation=observation, max_steps=MAX_STEPS, **options)

    steps = MAX_STEPS + 3
    many = roll(env(70), steps)
    assert same(tuple(many), tuple(roll(env(70, num_threads=2), steps)))
    assert same(tuple(many), tuple(roll(env(70, copy=False), steps)))
    one = roll(env(3), steps, slice(0, 1))
    assert same(tuple(one), part(tuple(many), slice(0, 1)))


@pytest.mark.parametrize("observation", COMPOSED.values(), ids=COMPOSED)
def test_forks_of_a_saved_snapshot_observe_what_the_environment_would_have(observation, tmp_path):
    env = VectorEnv(LEVELS, 6, observation=observation, seed=1, autoreset_mode="Disabled")
    env.reset()
    for step in range(5):
        observed = env.step(actions(step, 6))[0]
    env.state().save(tmp_path / "snapshot.npz")
    fork = VectorEnv(LEVELS, 3, observation=observation, seed=2, autoreset_mode="Disabled")
    rows = [4, 4, 1]
    assert same(fork.restore(Snapshot.load(tmp_path / "snapshot.npz")[rows]), part(observed, rows))
    for step in range(5, 12):
        a = actions(step, 6)
        assert same(fork.step(a[rows])[0], part(env.step(a)[0], rows))


@pytest.mark.parametrize("observation", COMPOSED.values(), ids=COMPOSED)
def test_a_masked_reset_starts_the_masked_and_changes_nothing_of_the_others(observation):
    env = VectorEnv(LEVELS, 8, observation=observation, seed=1, autoreset_mode="Disabled")
    env.reset()
    for step in range(4):
        before = part(env.step(actions(step, 8))[0], slice(None))
    mask = np.arange(8) % 3 == 0
    after, info = env.reset(options={"reset_mask": mask})
    assert same(part(after, ~mask), part(before, ~mask)) and not same(part(after, mask), part(before, mask))
    assert (info["length"] == np.where(mask, 0, 4)).all()


class Noise:
    """A bound observation that shows what it is told."""

    def __init__(self, shape: tuple[int, ...], dtype: Any) -> None:
        self.space, self.frame = spaces.Box(0, 255, shape, dtype), np.empty(0)

    def begin(self, values: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None: ...

    def write(self, values: np.ndarray, level: np.ndarray, out: np.ndarray, rows: np.ndarray) -> None:
        out[rows] = self.frame[rows]


FORMS = [((8, 8, 3), np.uint8, -1), ((8, 8, 1), np.uint8, -1), ((3, 8, 8), np.uint8, 1), ((5, 7, 3), np.uint8, -1),
         ((16, 16, 3), np.uint8, -1), ((7,), np.float32, 1), ((3, 4), np.float32, 1)]  # fmt: skip


@pytest.mark.parametrize(("shape", "dtype", "axis"), FORMS)
@pytest.mark.parametrize("n", [1, 3, 4, 5])
def test_a_stack_is_what_was_shown_whatever_happens_in_between(shape, dtype, axis, n, monkeypatch):
    """Random spots change, in random environments; steps, interventions and starts in random order; runs of rows too."""
    monkeypatch.setattr("segar.observations.composed.stack.TAPE", 5)
    rng, envs = np.random.default_rng(0), 90
    source = Noise(shape, dtype)
    stack = BoundStack(source, n, envs)
    source.frame = rng.integers(0, 255, (envs, *shape)).astype(dtype)
    every, history = np.arange(envs), [source.frame] * n
    stack.write(np.empty(0), np.empty(0), stack.kept, every)
    for _ in range(60):
        event = rng.choice(["step", "step", "step", "intervene", "start", "recall"])
        source.frame, spots = source.frame.copy(), rng.random((envs, *shape)) < 0.02
        source.frame[spots] = rng.integers(0, 255, spots.sum())
        if event == "step":
            stack.advance(np.zeros((envs, 2), np.float32))
            history = [*history[1:], source.frame]
        elif event == "start":
            mask = rng.random(envs) < 0.3
            stack.start(every.astype(np.uint64), every, mask)
            history = [*history[:-1], source.frame]
            history = [np.where(mask.reshape(-1, *[1] * len(shape)), source.frame, h) for h in history]
        else:
            history = [*history[:-1], source.frame]
        if event == "recall":
            memory, stack = stack.memory(), BoundStack(source, n, envs)
            stack.recall(memory)
        out = stack.kept if rng.random() < 0.5 else empty_batch(stack.space, envs)
        stack.write(np.empty(0), np.empty(0), out, rng.permutation(every) if rng.random() < 0.2 else every)
        assert np.array_equal(out, np.concatenate(history, axis))


def test_previous_actions_are_those_that_were_taken_and_none_before_the_episode():
    env = VectorEnv(LEVELS, 4, observation=PreviousActions(3), seed=0, max_steps=5)
    observed, _ = env.reset()
    assert observed.shape == (4, 6) and not observed.any()
    taken = [np.zeros((4, 2))] * 3
    for step in range(5):
        a = actions(step, 4)
        taken = [*taken[1:], np.clip(a, -1, 1)]
        observed, _, terminated, truncated, info = env.step(a)
        ended = terminated | truncated
        expected = np.concatenate(taken, 1)
        np.testing.assert_array_equal(np.where(ended[:, None], info.get("final_obs", 0), observed), expected)
        assert not observed[ended].any()
        taken = [np.where(ended[:, None], 0, t) for t in taken]
    assert np.abs(actions(0, 4)).max() > 1


def push(action: segar.Action, v: segar.Velocity) -> segar.Differential[segar.Velocity]:
    return segar.Differential[segar.Velocity](v, (action[0], action[1] + action[2]))


def test_previous_actions_are_of_the_environments_task():
    low, high = (-2.0, -1.0, 0.5), (2.0, 1.0, 3.0)
    task = replace(segar.puttputt(), name="three numbers", act=push, action_low=low, action_high=high)
    env = VectorEnv(LEVELS, 2, observation={"past": Stack(PreviousActions(), 2)}, task=task, seed=0)
    box = env.single_observation_space["past"]
    np.testing.assert_array_equal(box.low, [-2, -1, 0] * 2)
    np.testing.assert_array_equal(box.high, [2, 1, 3] * 2)
    assert env.observation_space.contains(env.reset()[0])
    observed = env.step(np.full((2, 3), 9.0, np.float32))[0]["past"]
    np.testing.assert_array_equal(observed, [[0, 0, 0, 2, 1, 3]] * 2)


def test_a_snapshot_without_a_past_starts_one_and_another_observations_past_is_refused():
    state, stack = (VectorEnv(LEVELS, 3, observation=o, seed=0) for o in ("state", Stack("state", 3)))
    state.reset()
    now = state.step(actions(0, 3))[0]
    np.testing.assert_array_equal(stack.restore(state.state()), np.concatenate([now] * 3, 1))
    np.testing.assert_array_equal(state.restore(stack.state()), now)
    with pytest.raises(SegarError, match=r"taken under another observation: its 'stack' is float32 \(\d+,\) per env"):
        VectorEnv(LEVELS, 3, observation=Stack("state", 2)).restore(stack.state())


def test_one_of_a_family_is_drawn_for_each_episode_by_its_weight():
    family = [StateVector(factors=[factor], entities=["golfball"]) for factor in (Mass, Charge, segar.Size)]
    env = VectorEnv(LEVELS, 3000, observation=OneOf(family, weights=[1, 0, 3]), seed=0, max_steps=2)
    env.reset()
    shares = []
    for _ in range(6):
        shares.append(np.bincount(env.observation.chosen, minlength=3) / 3000)
        chosen = env.observation.chosen.copy()
        _, _, terminated, truncated, _ = env.step(np.zeros((3000, 2), np.float32))
        assert (chosen == env.observation.chosen)[~(terminated | truncated)].all()
    assert np.abs(np.array(shares) - [0.25, 0, 0.75]).max() < 4 * np.sqrt(0.1875 / 3000)
    again = VectorEnv(LEVELS, 100, observation=OneOf(family, weights=[1, 0, 3]), seed=0)
    other = VectorEnv(LEVELS, 100, observation=OneOf(family, weights=[1, 0, 3], seed=1), seed=0)
    first = VectorEnv(LEVELS, 3000, observation=OneOf(family, weights=[1, 0, 3]), seed=0)
    for e in (again, other, first):
        e.reset()
    assert np.array_equal(again.observation.chosen, first.observation.chosen[:100])
    assert not np.array_equal(again.observation.chosen, other.observation.chosen)


def test_one_of_a_family_belongs_to_the_level_wherever_it_is():
    family = OneOf(["rgb", RED], per="level")
    levels = segar.family("objectsx1-hard").sample(60, seed=0)
    every = VectorEnv(levels, 60, observation=family, seed=0)
    observed, _ = every.reset(options={"levels": np.arange(60)})
    some = VectorEnv(levels[[50, 7, 31]], 3, observation=family, seed=9)
    assert np.array_equal(some.reset(options={"levels": np.arange(3)})[0], observed[[50, 7, 31]])
    assert 15 < every.observation.chosen.sum() < 45
    assert np.array_equal(every.reset(options={"levels": np.arange(60)})[0], observed)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Multi({"a": ("rgb", "stat")}), "Did you mean 'state'"),
        (lambda: VectorEnv(LEVELS, 1, observation={}), "needs at least one"),
        (lambda: VectorEnv(LEVELS, 1, observation=3), "a tuple or dict, or an object with bind"),
        (lambda: Stack(("rgb", "state"), 4).bind(LEVELS, 1), r"it stacks arrays, not Tuple.*stack the parts"),
        (lambda: Stack("rgb", 0), "n must be at least 1, not 0"),
        (lambda: PreviousActions(0), "n must be at least 1"),
        (lambda: OneOf(["state", "rgb"]).bind(LEVELS, 1), r"must be equal; .* number 1's is Box\(0, 255"),
        (lambda: OneOf(["rgb"], per="episodes"), "Did you mean 'episode'"),
        *(
            (lambda weights=weights: OneOf(["rgb", RED], weights=weights), "weights must be 2 numbers")
            for weights in ([1], [0, 0], [-1, 2], [np.nan, 1])
        ),
        (lambda: TorchRLEnv(LEVELS, 1, observation={"reward": "state"}), "cannot be called 'reward'"),
    ],
)
def test_wrong_compositions_are_errors_that_say_how_to_mend_them(make, message):
    with pytest.raises(SegarError, match=message):
        make()


@pytest.mark.parametrize("observation", COMPOSED.values(), ids=COMPOSED)
def test_torchrl_gets_every_part_under_its_name(observation):
    env, plain = (
        TorchRLEnv(LEVELS, 4, observation=observation, seed=3),
        VectorEnv(LEVELS, 4, observation=observation, seed=3, autoreset_mode="Disabled"),
    )
    check_env_specs(env, seed=3)
    env.set_seed(3)
    current, (observed, _) = env.reset(), plain.reset(seed=3)
    for step in range(4):
        names = [key for key in current.keys(True, True) if key not in ("done", "terminated", "truncated")]
        arrays = [current[key].numpy() for key in names if key not in ("level", "return", "length", "success", "death")]
        assert all(any(np.array_equal(a, b) for b in arrays) for a in leaves(observed))
        current = env.step(TensorDict({"action": torch.from_numpy(actions(step, 4))}, [4]))["next"]
        observed = plain.step(actions(step, 4))[0]
    mask = torch.tensor([True, False, True, False])
    again = env.reset(TensorDict({"_reset": mask[:, None]}, [4]))
    assert again["length"].flatten().tolist() == [0, 4, 0, 4]
