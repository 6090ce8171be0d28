"""PPO: advantages, the squashed policy, rollouts that are those of the plain environment, and that it learns."""

import contextlib
import dataclasses

import numpy as np
import pytest
import torch
from tensordict import TensorDict

from segar import family, puttputt
from segar.envs import VectorEnv
from segar.experiments.algorithms.ppo import PPO
from segar.experiments.collection.collector import Rollout
from segar.experiments.collection.rewards import ReturnScale, learner_reward
from segar.experiments.networks.encoders import MLP, FrameEncoder
from segar.experiments.networks.policies import SquashedNormal
from segar.experiments.settings import ConfigError, PPOConfig, ScaleConfig
from segar.experiments.training.run import run
from tests.experiments.short_runs import short_run

SMALL = PPOConfig(num_envs=6, num_steps=16, widths=(16,), head_width=0)
PIXELS = dataclasses.replace(SMALL, encoder="small", precision="fp32")
LEVELS = family("empty-easy").sample(5, seed=0)


def learner(config=SMALL, seed=0, levels=LEVELS, **env_options):
    env = PPO.make_env(levels, config.num_envs, seed=seed, **env_options)
    return PPO(config, env, 10_000, seed)


def see(policy, observation):
    """Mean and deviation of the policy, and the value, at an observation."""
    with torch.no_grad():
        return policy(torch.from_numpy(observation))


@pytest.mark.parametrize(("config", "shown"), [(SMALL, "state"), (PIXELS, "rgb")])
def test_a_rollout_is_that_of_a_plain_environment_loop(config, shown):
    """On burning tiles episodes end at different times, so that most resets are of a part of the environments."""
    levels = family("tilesx1-hard").sample(20, seed=0)
    ppo = learner(config, levels=levels, task=puttputt(max_steps=7), observation=shown)
    plain = VectorEnv(levels, 6, seed=0, task=puttputt(max_steps=7), observation=shown)
    observation, _ = plain.reset()
    partial_resets = cut = 0
    for _ in range(3):
        rollout, _ = ppo.collect()
        for t in range(SMALL.num_steps):
            np.testing.assert_array_equal(rollout.observation[t].numpy(), observation)
            torch.testing.assert_close(
                (rollout.loc[t], rollout.scale[t], rollout.value[t]), see(ppo.policy, observation)
            )
            observation, reward, terminated, truncated, info = plain.step(rollout.u[t].tanh().numpy())
            np.testing.assert_array_equal(rollout.reward[t, :, 0].numpy(), reward.astype(np.float32))
            np.testing.assert_array_equal(rollout.terminated[t, :, 0].numpy(), terminated)
            np.testing.assert_array_equal(rollout.done[t, :, 0].numpy(), terminated | truncated)
            cut_here = truncated.reshape(-1, *[1] * (observation.ndim - 1))
            after = np.where(cut_here, info.get("final_obs", observation), observation)
            counts = torch.from_numpy(~terminated)  # what follows a terminated step is never looked at
            torch.testing.assert_close(rollout.next_value[t][counts], see(ppo.policy, after)[2][counts])
            partial_resets += 0 < (terminated | truncated).sum() < 6
            cut += truncated.sum()
    assert partial_resets > 10 and cut > 10


def plain_advantages(config, rollout):
    """Generalised advantages by their definition, one environment and one time at a time."""
    reward = learner_reward(config, rollout.reward).double()
    advantage = torch.zeros_like(reward)
    for env in range(reward.shape[1]):
        following = 0.0
        for t in reversed(range(reward.shape[0])):
            goes_on = 0.0 if rollout.terminated[t, env] else 1.0
            delta = reward[t, env] + config.gamma * goes_on * rollout.next_value[t, env] - rollout.value[t, env]
            same_episode = 0.0 if rollout.done[t, env] else 1.0
            following = delta + config.gamma * config.gae_lambda * same_episode * following
            advantage[t, env] = following
    return advantage


def random_rollout(steps=9, envs=4, seed=0):
    rng = torch.Generator().manual_seed(seed)

    def numbers(*shape):
        return torch.randn(steps, envs, *shape, generator=rng)

    done = torch.rand(steps, envs, 1, generator=rng) < 0.4
    terminated = done & (torch.rand(steps, envs, 1, generator=rng) < 0.5)
    return Rollout(
        observation=numbers(3),
        u=numbers(2),
        loc=numbers(2),
        scale=numbers(2).exp(),
        value=numbers(1),
        next_value=numbers(1),
        reward=numbers(1),
        terminated=terminated,
        done=done,
        level_done=done,
        memory=torch.zeros(envs, 0),
    )


@pytest.mark.parametrize("seed", range(2))
def test_advantages_are_those_of_their_definition(seed):
    rollout = random_rollout(seed=seed)
    config = dataclasses.replace(SMALL, gamma=0.9, gae_lambda=0.7, reward_transform="sqrt")
    batch = learner(config).make_batch(rollout)
    expected = plain_advantages(config, rollout)
    np.testing.assert_allclose(batch["advantage"], expected, atol=1e-5)
    np.testing.assert_allclose(batch["value_target"], expected + rollout.value, atol=1e-5)


def test_the_squashed_law_integrates_to_one_and_has_the_entropy_of_its_density():
    for mean, std in ((0.0, 0.6), (0.8, 1.0), (-1.5, 0.3)):
        law = SquashedNormal(torch.tensor([[mean]], dtype=torch.double), torch.tensor([[std]], dtype=torch.double))
        u = torch.linspace(mean - 12 * std, mean + 12 * std, 200_001, dtype=torch.double)[:, None]
        action = u.tanh()[:, 0]
        log_density = law.log_prob(u)
        # In the action's own measure: da = (1 - tanh² u) du.
        slope = 1 / torch.cosh(u[:, 0]) ** 2
        density = log_density.exp() * slope
        assert torch.trapezoid(density, u[:, 0]).item() == pytest.approx(1.0, abs=1e-6)
        assert torch.trapezoid(density * action, u[:, 0]).item() == pytest.approx(
            torch.tanh(mean + std * torch.randn(400_000, generator=torch.Generator().manual_seed(0))).mean().item(),
            abs=5e-3,
        )
        entropy = -torch.trapezoid(density * log_density, u[:, 0])
        assert law.entropy().item() == pytest.approx(entropy.item(), abs=1e-3)


def test_the_density_of_several_dimensions_is_the_product_and_saturated_actions_stay_finite():
    loc, scale = torch.tensor([[0.3, -0.2]]), torch.tensor([[0.5, 2.0]])
    u = torch.tensor([[0.1, 40.0]])  # tanh(40) is 1 in float32
    parts = [SquashedNormal(loc[:, i : i + 1], scale[:, i : i + 1]).log_prob(u[:, i : i + 1]) for i in range(2)]
    whole = SquashedNormal(loc, scale).log_prob(u)
    assert torch.isfinite(whole).all()
    torch.testing.assert_close(whole, parts[0] + parts[1])


def test_the_learners_reward_keeps_order_and_sign():
    reward = torch.tensor([-100.0, -1.0, -0.04, 0.0, 4.0])
    config = dataclasses.replace(SMALL, reward_transform="sqrt", reward_scale=2.0)
    torch.testing.assert_close(learner_reward(config, reward), torch.tensor([-51.5, -2.0, -0.4, 0.0, 3.5]))
    torch.testing.assert_close(learner_reward(SMALL, reward), reward)
    many = torch.linspace(-100, 100, 100_001, dtype=torch.float64)
    assert (learner_reward(config, many).diff() > 0).all()


def test_a_batch_that_does_not_divide_is_used_whole():
    ppo = learner(dataclasses.replace(SMALL, num_envs=7, num_steps=3, minibatches=4, epochs=2))
    parts = list(ppo.minibatches(TensorDict({"row": torch.arange(21).view(3, 7)}, [3, 7])))
    assert [len(part) for part in parts] == [6, 5, 5, 5] * 2
    for epoch in (parts[:4], parts[4:]):
        assert sorted(torch.cat([part["row"] for part in epoch]).tolist()) == list(range(21))


def test_the_learning_rate_falls_to_zero_where_that_is_asked_for():
    ppo = learner(dataclasses.replace(SMALL, anneal=True))
    ppo.budget = 2 * 6 * 16
    rates = []
    for _ in range(2):
        ppo.iterate()
        rates.append(ppo.optimizer.param_groups[0]["lr"])
    assert rates == pytest.approx([SMALL.learning_rate / 2, 0.0])


def test_normalised_rewards_are_divided_by_the_deviation_of_all_discounted_returns_so_far():
    rng = np.random.default_rng(0)
    reward, done = rng.normal(-3.0, 2.0, (4, 5, 3)), rng.random((4, 5, 3)) < 0.3
    scale = ReturnScale(3, gamma=0.8)
    returns, current = [], np.zeros(3)
    for r, d in zip(reward, done, strict=True):
        for t in range(5):
            current = 0.8 * current + r[t]
            returns.append(current)
            current = np.where(d[t], 0.0, current)
        scaled = scale(torch.from_numpy(r)[..., None], torch.from_numpy(d)[..., None])
        np.testing.assert_allclose(scaled[..., 0], r / np.std(returns))
    assert scale(torch.full((1, 3, 1), 1e4), torch.ones(1, 3, 1, dtype=torch.bool)).max() < 10.0
    fresh = ReturnScale(3, gamma=0.8)
    fresh(torch.zeros(5, 3, 1), torch.zeros(5, 3, 1, dtype=torch.bool))
    assert fresh(torch.full((1, 3, 1), 1e4), torch.ones(1, 3, 1, dtype=torch.bool)).max() <= 10.0


def test_a_frame_is_copied_once_on_its_way_from_the_engine_to_the_loss():
    """The engine draws into one array, which torch reads where it lies, and which is copied into the rollout."""
    one = learner(PIXELS, observation="rgb")
    seen = []
    step = one.policy.step
    one.policy.step = lambda frames, memory: seen.append(frames.data_ptr()) or step(frames, memory)
    drawn = one.collector.current
    for _ in range(2):
        rollout, _ = one.collect()
        assert seen[:-1] == [frames.data_ptr() for frames in rollout.observation]
        assert seen[-1] == one.collector.current.ctypes.data == drawn.ctypes.data
        batch = one.make_batch(rollout)
        assert batch["observation"].data_ptr() == rollout.observation.data_ptr()
        seen.clear()


def test_policy_and_value_share_a_cnn_but_no_mlp_where_that_is_left_open():
    config = dataclasses.replace(PIXELS, shared=None)
    for shape, shared in (((9,), False), ((64, 64, 3), True)):
        policy = PPO.make_policy(config, shape, 2)
        assert policy.shared is shared
        encoders = [m for m in policy.modules() if isinstance(m, MLP | FrameEncoder)]
        assert len(encoders) == (1 if shared else 2)


@pytest.mark.parametrize(("config", "shown"), [(SMALL, "state"), (PIXELS, "rgb")])
def test_the_loss_mixes_no_devices(config, shown, monkeypatch):
    """Torch's device without memory stands for a GPU: it, too, refuses what lies elsewhere."""
    monkeypatch.setattr(torch, "autocast", lambda *_, **__: contextlib.nullcontext())  # which knows no such device
    monkeypatch.setattr(torch.Tensor, "__bool__", lambda _: True)  # the loss asks if the entropy is finite
    ppo = learner(config, levels=family("tilesx1-hard").sample(5, seed=0), observation=shown)
    rollout, _ = ppo.collect()
    batch = ppo.make_batch(rollout)
    ppo.device = torch.device("meta")
    ppo.policy.to(ppo.device)
    figures = ppo.losses(next(ppo.minibatches(batch.to(ppo.device))))
    figures["loss_objective"].backward()
    assert {value.device for value in figures.values()} == {ppo.device}
    assert ppo.make_batch(on(ppo.device, rollout)).device in (None, ppo.device)


def on(device, rollout):
    moved = {field.name: getattr(rollout, field.name).to(device) for field in dataclasses.fields(rollout)}
    return Rollout(**moved)


@pytest.mark.parametrize("name", ["cuda:99", "abacus"])
def test_a_device_that_is_not_there_is_named(name):
    with pytest.raises(ConfigError, match=f"algorithm.device: '{name}' cannot be used here.*algorithm.device=cpu"):
        learner(dataclasses.replace(SMALL, device=name))


@pytest.mark.parametrize(("frames", "anneal"), [(96, True), (97, True), (96, False)])
def test_a_single_annealed_iteration_changes_no_weight_and_is_told(tmp_path, frames, anneal):
    config, said = dataclasses.replace(SMALL, anneal=anneal), []
    ppo = PPO(config, PPO.make_env(LEVELS, SMALL.num_envs, seed=0), frames, 0)
    start = {name: value.clone() for name, value in ppo.policy.state_dict().items()}
    while ppo.frames < frames:
        ppo.iterate()
    same = all(torch.equal(value, start[name]) for name, value in ppo.policy.state_dict().items())
    run(short_run(tmp_path / "run", algorithm=config, scale=ScaleConfig(frames=frames)), said.append)
    told = any("the agent stays untrained: 96 frames are one rollout (96 frames) or less" in line for line in said)
    assert same == told == (frames == 96 and anneal)
