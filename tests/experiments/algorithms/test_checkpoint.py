"""Checkpoints: what does not belong is refused with the file's name and the way out; nothing is unpickled."""

import dataclasses
import pickle

import pytest
import torch

from experiments.algorithms.checkpoint import load_newest_policy, read_checkpoint, resume_checkpoint, save_checkpoint
from experiments.algorithms.ppo import PPO, PPOPolicy
from experiments.levels.builders import make_levels
from experiments.runs.run_folder import CHECKPOINT
from experiments.settings import CheckpointError, PPOConfig, RunConfig

CONFIG = RunConfig(algorithm=PPOConfig(num_envs=4, num_steps=4, widths=(8,), head_width=8))
CODE = {"kernel": "0123456789abcdef", "learner": "fedcba9876543210"}


def learner(config=CONFIG, seed=0):
    train, _ = make_levels(config.levels)
    return PPO(config.algorithm, PPO.make_env(train, config.algorithm.num_envs, seed=seed), 1000, seed)


@pytest.fixture
def saved(tmp_path):
    """A folder with the checkpoint of a learner that has learned a little, and that learner."""
    one = learner()
    one.iterate()
    save_checkpoint(tmp_path, CONFIG, one, {"seconds": 1.5}, CODE)
    return tmp_path, one


def test_where_there_is_no_checkpoint_there_is_nothing_to_resume(tmp_path):
    assert resume_checkpoint(tmp_path, CONFIG, learner(), CODE) is None
    with pytest.raises(CheckpointError, match="there is no checkpoint at"):
        read_checkpoint(tmp_path / CHECKPOINT)


def test_a_checkpoint_of_other_code_is_refused_by_the_name_of_the_part(saved):
    folder, _ = saved
    with pytest.raises(CheckpointError) as caught:
        resume_checkpoint(folder, CONFIG, learner(), {**CODE, "learner": "another"})
    assert f"{folder / CHECKPOINT} was written by other code: learner changed since. Go back to the code" in str(
        caught.value
    )
    assert "or train anew with stale=anew" in str(caught.value)


def test_a_checkpoint_of_another_configuration_is_refused(saved):
    folder, _ = saved
    with pytest.raises(CheckpointError, match=r"was written by another configuration .* restart=true"):
        resume_checkpoint(folder, dataclasses.replace(CONFIG, seed=1), learner(), CODE)


def test_a_checkpoint_of_another_network_is_refused(saved):
    folder, _ = saved
    wide = PPOPolicy(dataclasses.replace(CONFIG.algorithm, widths=(16,)), (9,), 2)
    with pytest.raises(CheckpointError) as caught:
        load_newest_policy(folder, wide)
    assert f"{folder / CHECKPOINT} is of another network: 'actor.encoder.layers.0.weight' is (8, " in str(caught.value)
    assert "there and (16, 9) here" in str(caught.value)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.999])
def test_a_truncated_checkpoint_is_refused(saved, share):
    folder, _ = saved
    content = (folder / CHECKPOINT).read_bytes()
    (folder / CHECKPOINT).write_bytes(content[: int(share * len(content))])
    with pytest.raises(CheckpointError, match=r"checkpoint .*latest\.pt is damaged or none of ours: .*restart=true"):
        resume_checkpoint(folder, CONFIG, learner(), CODE)


def test_a_file_that_is_no_checkpoint_is_refused(tmp_path):
    path = tmp_path / "other.pt"
    torch.save({"weights": torch.zeros(3)}, path)
    with pytest.raises(CheckpointError, match=r"other\.pt has format None; this version reads format 1"):
        read_checkpoint(path)
    with pytest.raises(CheckpointError, match="is damaged or none of ours"):
        read_checkpoint(tmp_path)  # a folder


class Loud:
    """Unpickled, it would run code."""

    def __reduce__(self):
        return (exec, ("raise SystemExit('unpickled')",))


@pytest.mark.parametrize("write", [torch.save, lambda thing, path: path.write_bytes(pickle.dumps(thing, protocol=2))])
def test_nothing_in_a_checkpoint_is_executed(tmp_path, write):
    path = tmp_path / "evil.pt"
    write({"format": 1, "policy": Loud()}, path)
    with pytest.raises(CheckpointError, match="is damaged or none of ours"):
        read_checkpoint(path)
