"""Checkpoints: what does not belong is refused with the file's name and the way out; nothing is unpickled.

Files that others made are data: each is refused with its name, or leads to the same weights.
"""

import copy
import dataclasses
import io
import pickle
import zipfile

import pytest
import torch

from segar.experiments.algorithms.checkpoint import (
    load_newest_policy,
    read_checkpoint,
    resume_checkpoint,
    save_checkpoint,
)
from segar.experiments.algorithms.ppo import PPO, PPOPolicy
from segar.experiments.levels.builders import make_levels
from segar.experiments.runs.run_folder import CHECKPOINT
from segar.experiments.settings import CheckpointError, PPOConfig, RunConfig
from tests.crafted import assert_clean_errors, crafted_descriptions, flipped, zipped

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
    with pytest.raises(CheckpointError, match="there is no checkpoint "):
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


def test_a_file_that_is_no_checkpoint_is_refused(tmp_path):
    path = tmp_path / "other.pt"
    torch.save({"weights": torch.zeros(3)}, path)
    with pytest.raises(CheckpointError, match=r"other\.pt has format None; this version reads 2"):
        read_checkpoint(path)
    with pytest.raises(CheckpointError, match="is no checkpoint: it is a folder"):
        read_checkpoint(tmp_path)


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


def as_file(content) -> bytes:
    buffer = io.BytesIO()
    torch.save(content, buffer)
    return buffer.getvalue()


def crafted(path):
    """Checkpoints with other content, as bytes."""
    whole = torch.load(path, weights_only=True) | {"format": 1}
    outline = {name: part for name, part in whole.items() if name not in ("policy", "learner")}
    for what, changed in crafted_descriptions(outline):
        yield what, as_file(changed | {name: whole[name] for name in ("policy", "learner")})
    for part in ("policy", "learner"):
        for name, value in whole[part].items():
            others = [None, "x", {}, [1], torch.zeros(0), torch.zeros(3, dtype=torch.int64)]
            if isinstance(value, torch.Tensor) and value.is_floating_point():
                others += [value[..., None], torch.full_like(value, torch.nan)]
            for other in others:
                yield f"{part} {name} {type(other)}", as_file(whole | {part: whole[part] | {name: other}})
            yield f"{part} without {name}", as_file(whole | {part: {n: v for n, v in whole[part].items() if n != name}})
        yield f"{part} with more", as_file(whole | {part: whole[part] | {"more": torch.zeros(3)}})
    for name, value in whole["learner"]["env"]["state"].items():
        others = [value[:1], value.int() if value.is_floating_point() else value.double()]
        if value.dtype == torch.int64:
            others += [torch.full_like(value, -1)] + [torch.full_like(value, 2**62)] * (name == "level")
        for other in others:
            changed = copy.deepcopy(whole)
            changed["learner"]["env"]["state"][name] = other
            yield f"state {name}", as_file(changed)


def test_a_checkpoint_that_was_changed_is_refused_or_leads_to_the_same_weights(saved):
    folder, one = saved
    path, other = folder / CHECKPOINT, learner()
    weights = one.policy.state_dict()

    def is_harmless(_):
        return all(torch.equal(weights[name], value) for name, value in other.policy.state_dict().items())

    def resume():
        return resume_checkpoint(folder, CONFIG, other, CODE)

    assert_clean_errors(crafted(path), path, resume, is_harmless, CheckpointError)


def test_changed_bytes_of_a_checkpoint_are_found_or_change_nothing(saved):
    folder, _ = saved
    path = folder / CHECKPOINT
    weights, whole = read_checkpoint(path)["policy"], path.read_bytes()
    truncated = [(f"{share} of it", whole[: int(share * len(whole))]) for share in (0.0, 0.1, 0.5, 0.999)]

    def is_harmless(found):
        return all(torch.equal(weights[name], value) for name, value in found["policy"].items())

    assert_clean_errors(flipped(path, 150), path, lambda: read_checkpoint(path), is_harmless, CheckpointError)
    assert_clean_errors(truncated, path, lambda: read_checkpoint(path), refusal=CheckpointError)


def test_a_checkpoint_of_compressed_parts_is_refused_before_it_is_expanded(saved):
    folder, _ = saved
    path = folder / CHECKPOINT
    with zipfile.ZipFile(path) as archive:
        parts = [(name, archive.read(name)) for name in archive.namelist()]
    path.write_bytes(zipped([*parts, ("archive/data/99", bytes(10**7))]))
    with pytest.raises(CheckpointError, match="is damaged or none of ours: its parts are larger than the file"):
        read_checkpoint(path)
