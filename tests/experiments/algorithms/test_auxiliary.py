"""CURL and SPR: losses by hand, that they fall, whom their gradient reaches, and which frames make a sequence."""

import math

import pytest
import torch
from torch.nn import functional as F

from segar import family
from segar.experiments.algorithms.curl import CURL
from segar.experiments.algorithms.ppo import PPO
from segar.experiments.algorithms.spr import SPR, sequences
from segar.experiments.collection.collector import Rollout
from segar.experiments.settings import CURLConfig, SPRConfig

LEVELS = family("objectsx1-easy").sample(5, seed=0)  # frames differ more than those of empty tasks
SMALL = {
    "num_envs": 3,
    "num_steps": 12,
    "encoder": "small",
    "minibatches": 2,
    "auxiliary_minibatches": 3,
    "precision": "fp32",
}
ONE_STEP = SPRConfig(**SMALL)
CONFIGS = {
    "curl": CURLConfig(**SMALL),
    "curl_original": CURLConfig(**SMALL, auxiliary_learning_rate=1e-3, tau=0.05, crop=1.0, shift=6, projection=50),
    "spr": ONE_STEP,
    "spr_original": SPRConfig(
        **SMALL, tau=1.0, crop=1.0, shift=4, intensity=0.05, horizon=5, model="transition", weight=2.0
    ),
}


def learner(config, seed=0):
    cls = CURL if isinstance(config, CURLConfig) else SPR
    return cls(config, cls.make_env(LEVELS, config.num_envs, seed=seed, observation="rgb"), 10_000, seed)


@pytest.fixture(
    params=["curl", "spr", *(pytest.param(f"{name}_original", marks=pytest.mark.slow) for name in ("curl", "spr"))]
)
def config(request):
    return CONFIGS[request.param]


def test_the_gradient_reaches_the_encoder_and_no_target_and_nothing_of_the_policy_behind_the_encoder(config):
    one = learner(config)
    rollout, _ = one.collect()
    batch = next(iter(one.batches(rollout)))
    one.loss(batch)["loss"].backward()
    moved = {name for name, weight in one.policy.named_parameters() if weight.grad is not None and weight.grad.any()}
    encoder = {f"actor.encoder.{name}" for name, _ in one.encoder.named_parameters()}
    assert moved == encoder
    targets = one.loss.target_network.parameters() if one.config.tau < 1 else ()  # the others are the encoder's
    assert not any(weight.requires_grad for weight in targets)
    own = [w for w in one.weights if not any(w is v for v in one.policy.parameters())]
    assert own and all(weight.grad is not None for weight in own)


def test_every_weight_of_the_loss_is_learned_and_the_encoder_is_the_policys(config):
    one = learner(config)
    learned = {id(w) for group in (one.own_optimizer or one.optimizer).param_groups for w in group["params"]}
    assert {id(w) for w in one.loss.parameters() if w.requires_grad} <= learned
    assert {id(w) for w in one.encoder.parameters()} <= {id(w) for w in one.loss.parameters()}
    before = [w.detach().clone() for w in one.weights]
    one.iterate()
    assert all(not torch.equal(w, old) for w, old in zip(one.weights, before, strict=True) if w.numel() > 1)


@pytest.mark.parametrize("name", CONFIGS)
def test_the_target_encoder_is_the_moving_average_of_the_encoder(name):
    one = learner(CONFIGS[name])
    tau = one.config.tau
    rollout, _ = one.collect()
    PPO.learn(one, rollout)  # PPO's steps do not move it
    expected = [weight.clone() for weight in one.loss.target_network.parameters()]
    passed = []
    follow = one.loss.follow

    def noting():
        passed.append([weight.detach().clone() for weight in one.loss.network.parameters()])
        follow()

    one.loss.follow = noting
    one.learn_auxiliary(rollout)
    assert len(passed) == one.config.auxiliary_minibatches
    for quick in passed:
        expected = [slow + tau * (new - slow) for slow, new in zip(expected, quick, strict=True)]
    for weight, slow in zip(one.loss.target_network.parameters(), expected, strict=True):
        torch.testing.assert_close(weight, slow)


def test_two_views_of_each_frame_are_contrasted_and_every_frame_is_seen(monkeypatch):
    one = learner(CONFIGS["curl"])
    rollout, _ = one.collect()
    monkeypatch.setattr(one, "augmented", lambda frames: frames)
    plain = list(one.batches(rollout))
    monkeypatch.undo()
    assert [len(batch) for batch in plain] == [12, 12, 12]
    seen = torch.cat([batch["query"] for batch in plain]).flatten(1)
    frames = rollout.observation.flatten(0, 1).flatten(1)
    assert torch.equal(seen.double().sum(1).sort()[0], frames.double().sum(1).sort()[0])
    batch = next(iter(one.batches(rollout)))
    assert not torch.equal(batch["query"], batch["key"])


def test_the_contrast_is_that_of_its_definition():
    one = learner(CONFIGS["curl"])
    rollout, _ = one.collect()
    one.learn_auxiliary(rollout)
    batch = next(iter(one.batches(rollout)))
    with torch.no_grad():
        figures = one.loss(batch)
        queries = one.encoder(batch["query"])
        keys = one.loss.target_codes(batch["key"])
        scores = queries @ one.loss.similarity.weight.T @ keys.T
    expected = -sum(math.log(F.softmax(scores, -1)[i, i].item()) for i in range(12)) / 12
    assert figures["loss"].item() == pytest.approx(expected, rel=1e-4)
    assert figures["accuracy"].item() == pytest.approx(sum(int(scores[i].argmax() == i) for i in range(12)) / 12)


def numbered_rollout(steps=9, envs=4, seed=0):
    """Observations say which environment, step and episode they are of; actions say so, too."""
    rng = torch.Generator().manual_seed(seed)
    done = torch.rand(steps, envs, generator=rng) < 0.25
    episode = torch.cat([torch.zeros(1, envs, dtype=torch.int64), done.cumsum(0)[:-1]])
    step, env = torch.meshgrid(torch.arange(steps), torch.arange(envs), indexing="ij")
    observation = torch.stack([env, step, episode], -1)
    u = (10 * env + step)[..., None].expand(-1, -1, 2) / 100.0
    column = torch.zeros(steps, envs, 1)
    empty = torch.zeros(envs, 0)
    ends = done[..., None]
    return Rollout(observation, u, u, u, column, column, column, ends, ends, ends, empty)


@pytest.mark.parametrize("horizon", [1, 3, 8])
def test_sequences_are_of_one_environment_in_order_and_never_valid_beyond_an_episodes_end(horizon):
    rollout = numbered_rollout()
    starts = torch.arange((9 - horizon) * 4)
    part = sequences(rollout, starts // 4, starts % 4, horizon)
    env, step, episode = part["observation"].unbind(-1)
    assert torch.equal(env, env[:, :1].expand_as(env))
    assert set(env[:, 0].tolist()) == {0, 1, 2, 3}
    assert torch.equal(step - step[:, :1], torch.arange(horizon + 1).expand_as(step))
    assert torch.equal(part["valid"], episode[:, 1:] == episode[:, :1])
    torch.testing.assert_close(part["action"], ((10 * env + step)[:, :-1, None] / 100.0).tanh().expand(-1, -1, 2))
    assert part["valid"].any() and not part["valid"].all()


def test_all_sequences_of_all_environments_are_used_once(monkeypatch):
    one = learner(CONFIGS["spr_original"])
    rollout, _ = one.collect()
    asked = []
    found = sequences
    monkeypatch.setattr(
        "segar.experiments.algorithms.spr.sequences", lambda r, t, e, h: asked.append((t, e)) or found(r, t, e, h)
    )
    list(one.batches(rollout))
    pairs = [pair for t, e in asked for pair in zip(t.tolist(), e.tolist(), strict=True)]
    assert len(asked) == 3
    assert sorted(pairs) == [(t, e) for t in range(12 - 5) for e in range(3)]


def test_what_lies_beyond_an_episodes_end_does_not_count():
    one = learner(CONFIGS["spr_original"])
    rollout, _ = one.collect()
    batch = next(iter(one.batches(rollout)))
    batch["valid"][:] = True
    batch["valid"][0, 2:] = False
    changed = batch.clone()
    changed["following"][0, 2:] = 255 - changed["following"][0, 2:]
    with torch.no_grad():
        assert one.loss(batch)["loss"] == one.loss(changed)["loss"]
        changed["following"][0, 1] = 255 - changed["following"][0, 1]
        assert one.loss(batch)["loss"] != one.loss(changed)["loss"]
        batch["valid"][:] = False
        assert torch.isfinite(one.loss(batch)["loss"])


def test_the_error_is_twice_the_cosine_distance_of_what_was_foretold_and_what_was_seen():
    one = learner(ONE_STEP)
    rollout, _ = one.collect()
    one.learn_auxiliary(rollout)
    batch = next(iter(one.batches(rollout)))
    _, model = one.loss.network
    with torch.no_grad():
        loss = one.loss(batch)["loss"]
        predicted = model.predict(one.encoder(batch["first"]), batch["action"])[:, 0]
        seen = one.loss.target_codes(batch["following"][:, 0])
    a, b = F.normalize(predicted, dim=-1), F.normalize(seen, dim=-1)
    squared = ((a - b) ** 2).sum(-1)[batch["valid"][:, 0]]
    torch.testing.assert_close(loss, squared.mean())


def test_actions_matter_to_what_is_foretold():
    for name in ("spr", "spr_original"):
        one = learner(CONFIGS[name])
        (_, model), horizon = one.loss.network, one.config.horizon
        phi = torch.rand(2, 256, generator=torch.Generator().manual_seed(0))
        still, moved = torch.zeros(2, horizon, 2), torch.zeros(2, horizon, 2)
        moved[:, -1] = 1.0
        a, b = model.predict(phi, still), model.predict(phi, moved)
        assert torch.equal(a[:, :-1], b[:, :-1]) and not torch.equal(a[:, -1], b[:, -1])
