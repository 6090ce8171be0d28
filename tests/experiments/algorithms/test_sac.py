"""SAC and DrQ: targets by hand, who gets which gradient, and steps that are those of the plain environment."""

import dataclasses

import numpy as np
import pytest
import torch
from tensordict import TensorDict

from segar import family, puttputt
from segar.envs.vector import VectorEnv
from segar.experiments.algorithms.drq import DrQ
from segar.experiments.algorithms.sac import SAC
from segar.experiments.settings import DrQConfig, SACConfig

LEVELS = family("empty-easy").sample(5, seed=0)
SMALL = SACConfig(num_envs=3, num_steps=10, warmup=12, batch_size=8, capacity=200, widths=(16, 8), gamma=0.9)
FRAMES = DrQConfig(num_envs=3, num_steps=6, warmup=12, batch_size=4, capacity=200, widths=(8,), precision="fp32")


def learner(config=SMALL, seed=0, frames=10_000, **options):
    cls = DrQ if isinstance(config, DrQConfig) else SAC
    observation = "rgb" if isinstance(config, DrQConfig) else "state"
    return cls(
        config, cls.make_env(LEVELS, config.num_envs, seed=seed, observation=observation, **options), frames, seed
    )


def toy_batch(width, n=3, seed=1):
    """A step that goes on, one that is truncated, one that is terminated."""
    rng = torch.Generator().manual_seed(seed)
    after = {
        "observation": torch.randn(n, width, generator=rng),
        "reward": torch.randn(n, 1, generator=rng),
        "done": torch.tensor([[False], [True], [True]]),
        "terminated": torch.tensor([[False], [False], [True]]),
    }
    before = {"observation": torch.randn(n, width, generator=rng), "u": torch.randn(n, 2, generator=rng)}
    return TensorDict({**before, "next": TensorDict(after, [n])}, [n])


def valued(critics, observation, u):
    return torch.minimum(*(critic(observation, u) for critic in critics))


def test_critics_learn_towards_targets_that_are_those_of_their_definition():
    """r + gamma (min Q'(s', a') - alpha log pi(a'|s')), but r alone where the step terminated."""
    one = learner()
    for _ in range(3):
        one.iterate()  # so that targets differ from critics
    batch = toy_batch(one.shape[0])
    draws = torch.Generator().manual_seed(0)
    draws.set_state(one.rng.get_state())
    figures = one.loss(batch)

    loc, scale = one.policy(batch["next", "observation"])
    noise = torch.randn(3, 2, generator=draws)
    u = loc + scale * noise
    density = torch.distributions.Normal(loc, scale).log_prob(u) - torch.log(1 - u.tanh() ** 2)
    ahead = valued(one.loss.target_critics, batch["next", "observation"], u)
    soft = ahead - one.loss.log_alpha.exp() * density.sum(-1, keepdim=True)
    goes_on = torch.tensor([[1.0], [1.0], [0.0]])
    target = batch["next", "reward"] + one.config.gamma * goes_on * soft
    errors = [critic(batch["observation"], batch["u"]) - target for critic in one.loss.critics]
    expected = sum((error**2).mean() for error in errors)
    torch.testing.assert_close(figures["loss_qvalue"], expected, rtol=1e-4, atol=1e-6)


def test_the_policys_loss_is_that_of_its_definition_and_moves_no_critic():
    one = learner()
    batch = toy_batch(one.shape[0])
    draws = torch.Generator().manual_seed(0)
    draws.set_state(one.rng.get_state())
    figures = one.loss(batch)
    torch.randn(3, 2, generator=draws)  # the actions of the next step
    loc, scale = one.policy(batch["observation"])
    u = loc + scale * torch.randn(3, 2, generator=draws)
    density = (torch.distributions.Normal(loc, scale).log_prob(u) - torch.log(1 - u.tanh() ** 2)).sum(-1, keepdim=True)
    worse = valued(one.loss.critics, batch["observation"], u)
    expected = (one.config.temperature * density - worse).mean()
    torch.testing.assert_close(figures["loss_actor"], expected, rtol=1e-4, atol=1e-6)

    figures["loss_actor"].backward()
    assert all(p.grad is not None for p in one.policy.parameters())
    assert all(p.grad is None for p in one.loss.critics.parameters())


def test_the_temperature_falls_while_the_policy_is_noisier_than_asked_for():
    one = learner()
    batch = toy_batch(one.shape[0])
    for target, sign in ((-50.0, 1.0), (50.0, -1.0)):
        config = dataclasses.replace(SMALL, target_entropy=target)
        one = learner(config)
        one.loss(batch.clone())["loss_alpha"].backward()
        assert one.loss.log_alpha.grad.sign().item() == sign


@pytest.mark.parametrize("config", [SMALL, FRAMES])
def test_target_networks_are_the_moving_average_of_networks(config):
    one = learner(dataclasses.replace(config, tau=0.25))
    while len(one.replay) < 8:
        one.step()
    expected = [target.clone() for target in one.targets.values()]
    for _ in range(3):
        one.update()
        expected = [torch.lerp(slow, quick, 0.25) for slow, quick in zip(expected, one.sources, strict=True)]
    assert {name.split(".")[0] for name in one.targets} >= {"target_critics"}
    for slow, target, quick in zip(expected, one.targets.values(), one.sources, strict=True):
        torch.testing.assert_close(target, slow)
        assert not torch.equal(target, quick)


def test_what_is_remembered_is_what_a_plain_environment_does(monkeypatch):
    """Episodes of seven steps: the replay knows last observations, and which episodes were cut and which ended."""
    task = puttputt(max_steps=7)
    one = learner(dataclasses.replace(SMALL, warmup=1000), task=task)
    plain = VectorEnv(LEVELS, 3, seed=0, observation="state", task=task)
    taken = []
    step = one.env.step
    monkeypatch.setattr(one.env, "step", lambda actions: taken.append(actions) or step(actions))
    observation, _ = plain.reset()
    made, truncations = set(), 0
    for _ in range(40):
        one.step()
        after, reward, terminated, truncated, info = plain.step(taken[-1])
        done = terminated | truncated
        following = np.where(done[:, None], info.get("final_obs", after), after)
        rows = (observation, following, taken[-1], reward.astype(np.float32), terminated, done)
        made |= {tuple(entry.tobytes() for entry in row) for row in zip(*rows, strict=True)}
        truncations += int(truncated.sum())
        observation = after
    batch = one.replay.sample(3000)
    after = [batch["next", key].squeeze(-1).numpy() for key in ("reward", "terminated", "done")]
    rows = (batch["observation"].numpy(), batch["next", "observation"].numpy(), batch["u"].tanh().numpy(), *after)
    drawn = {tuple(entry.tobytes() for entry in row) for row in zip(*rows, strict=True)}
    assert drawn <= made and len(drawn) == len(one.replay) > 100
    assert truncations > 10


def test_random_actions_before_learning_are_uniform_and_finite():
    one = learner(dataclasses.replace(SMALL, warmup=1200, num_envs=100, capacity=4000))
    for _ in range(12):
        one.step()
    u = one.replay.sample(20_000)["u"]
    assert torch.isfinite(u).all()
    shares = torch.histc(u.tanh(), 10, -1.0, 1.0) / u.numel()
    torch.testing.assert_close(shares, torch.full((10,), 0.1), atol=0.02, rtol=0)
    assert one.updates_due() == 100 and one.frames == 1200


@pytest.mark.parametrize(("per", "expected"), [(1, 9), (2, 5), (3, 3), (100, 0)])
def test_gradient_steps_keep_pace_with_environment_steps(per, expected):
    one = learner(dataclasses.replace(SMALL, steps_per_update=per, warmup=12, num_steps=6))
    assert one.iterate()["updates"] == expected  # of 18 steps, the last 9 of which are learned from


def test_losses_reach_exactly_whom_they_should_behind_a_cnn():
    """The critics' loss trains the CNN; the policy's and the temperature's do not; nothing trains targets."""
    one = learner(FRAMES)
    while len(one.replay) < 4:
        one.step()
    loss = one.loss
    parts = {
        "cnn": list(loss.encoder.parameters()),
        "policy": list(loss.actor.parameters()),
        "critics": list(loss.critics.parameters()),
        "temperature": [loss.log_alpha],
        "targets": [*loss.target_encoder.parameters(), *loss.target_critics.parameters()],
    }
    expected = {"loss_qvalue": {"cnn", "critics"}, "loss_actor": {"policy"}, "loss_alpha": {"temperature"}}
    for name, reached in expected.items():
        loss.zero_grad(set_to_none=True)
        loss(one.replay.sample(4))[name].backward()
        moved = {part for part, weights in parts.items() if any(w.grad is not None and w.grad.any() for w in weights)}
        assert moved == reached, name
    assert {id(w) for w in one.policy.parameters()} == {id(w) for name in ("cnn", "policy") for w in parts[name]}
    learned = {id(w) for group in one.optimizer.param_groups for w in group["params"]}
    assert learned == {id(w) for name, weights in parts.items() if name != "targets" for w in weights}


def test_what_follows_is_seen_by_the_slow_cnn_for_critics_and_by_the_quick_one_for_the_policy(monkeypatch):
    monkeypatch.setattr("segar.experiments.algorithms.drq.random_shift", lambda frames, **_: frames)
    one = learner(FRAMES)
    for _ in range(3):
        one.iterate()
    batch = one.replay.sample(4)
    seen = {}
    for name, network in (
        ("actor", one.loss.actor),
        ("target", one.loss.target_critics[0]),
        ("critic", one.loss.critics[0]),
    ):
        network.register_forward_pre_hook(
            lambda _, given, name=name: seen.setdefault(name, []).append(given[0].detach())
        )
    one.loss(batch)
    quick, slow = one.loss.encoder, one.loss.target_encoder
    now, following = batch["observation"], batch["next", "observation"]
    wanted = {"actor": [quick(following), quick(now)], "target": [slow(following)], "critic": [quick(now), quick(now)]}
    assert wanted.keys() == seen.keys()
    for name, features in wanted.items():
        for there, expected in zip(seen[name], features, strict=True):
            torch.testing.assert_close(there, expected)
    assert not torch.equal(quick(following), slow(following))


def test_frames_before_and_after_a_step_are_shifted_by_draws_of_their_own(monkeypatch):
    shifted = []
    monkeypatch.setattr(
        "segar.experiments.algorithms.drq.random_shift", lambda frames, pixels, rng: shifted.append(pixels) or frames
    )
    one = learner(FRAMES)
    while not one.updates_due():
        one.step()
    one.update()
    assert shifted == [FRAMES.shift] * 2
