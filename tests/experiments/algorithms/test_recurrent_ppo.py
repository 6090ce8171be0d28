"""PPO with a memory: it learns from what it remembered while it acted, forgets between episodes, and can tell a story apart."""

import dataclasses

import pytest
import torch
from tensordict import TensorDict
from torchrl.modules import set_recurrent_mode

from segar import family, puttputt
from segar.experiments.algorithms.recurrent_ppo import RecurrentPPO
from segar.experiments.settings import RecurrentPPOConfig

SMALL = RecurrentPPOConfig(num_envs=8, num_steps=12, widths=(16,), core_width=8, head_width=0, minibatches=2)
LEVELS = family("empty-easy").sample(5, seed=0)


def learner(config=SMALL, trials=1):
    env = RecurrentPPO.make_env(LEVELS, config.num_envs, seed=0, task=puttputt(max_steps=5), trials=trials)
    return RecurrentPPO(config, env, 10_000, 0)


@pytest.mark.parametrize("trials", [1, 3])
@pytest.mark.parametrize("core", ["gru", "lstm"])
def test_sequences_give_what_the_steps_of_their_collection_gave(core, trials):
    """Episodes of at most 5 steps begin and end within rollouts of 12, and go on from one into the next."""
    one = learner(dataclasses.replace(SMALL, core=core), trials)
    ends = 0
    for _ in range(3):
        rollout, _ = one.collect()
        batch = one.make_batch(rollout)
        rows = TensorDict({key: value.transpose(0, 1) for key, value in batch.items()}, [8, 12])
        with set_recurrent_mode(True), torch.no_grad():
            hidden = one.policy.core(rows.update({"phi": one.policy.encoder(rows["observation"])}))["hidden"]
            found = (*one.policy.heads(hidden), one.policy.value(hidden))
        for seen, again in zip((rollout.loc, rollout.scale, rollout.value), found, strict=True):
            torch.testing.assert_close(again.transpose(0, 1), seen, atol=1e-5, rtol=1e-5)
        ends += int(rollout.done.sum())
    assert ends > 20
    assert rollout.memory.abs().min() > 0


def test_over_the_trials_of_a_level_everything_is_remembered_and_nothing_beyond():
    one = learner(trials=3)
    forgotten, kept, lost = torch.zeros(8, one.policy.memory_width), 0, 0
    for _ in range(3):
        rollout, _ = one.collect()
        for t, env in rollout.done[:-1, :, 0].nonzero().tolist():
            with torch.no_grad():
                loc, *_ = one.policy.step(rollout.observation[t + 1], forgotten)
            is_forgotten = torch.allclose(loc[env], rollout.loc[t + 1, env], atol=1e-6)
            assert is_forgotten == bool(rollout.level_done[t, env])
            kept, lost = kept + (not is_forgotten), lost + is_forgotten
    assert kept > 10 and lost > 5


@pytest.mark.parametrize("joins", [True, False])
def test_returns_go_on_over_the_trials_of_a_level_or_end_with_each(joins):
    """With lambda = 1, the targets of values are discounted sums of rewards, and of the value where the rollout ends."""
    one = learner(dataclasses.replace(SMALL, joins_trials=joins, gae_lambda=1.0, gamma=0.9, num_steps=24), trials=3)
    rollout, _ = one.collect()
    target = one.make_batch(rollout)["value_target"][..., 0].double()
    ends = (rollout.level_done if joins else rollout.done)[..., 0]
    cut_inside = rollout.done & ~rollout.level_done & ~rollout.terminated
    reward, follows = rollout.reward[..., 0].double(), rollout.next_value[..., 0].double()
    dead = rollout.terminated[..., 0] & ends
    for env in range(8):
        for start in range(24):
            expected, discount = 0.0, 1.0
            for t in range(start, 24):
                expected, discount = expected + discount * float(reward[t, env]), discount * 0.9
                if ends[t, env] or t == 23:
                    expected += 0.0 if dead[t, env] else discount * float(follows[t, env])
                    break
            assert float(target[start, env]) == pytest.approx(expected, abs=1e-4)
    assert cut_inside.sum() > 8
    is_next = (rollout.next_value[:-1] == rollout.value[1:])[cut_inside[:-1]]
    assert is_next.all() if joins else not is_next.any()


def test_without_trials_it_makes_no_difference_whether_returns_join_them():
    batches = []
    for joins in (True, False):
        one = learner(dataclasses.replace(SMALL, joins_trials=joins))
        batches.append(one.make_batch(one.collect()[0]))
    assert all(torch.equal(batches[0][key], batches[1][key]) for key in batches[0].keys())
