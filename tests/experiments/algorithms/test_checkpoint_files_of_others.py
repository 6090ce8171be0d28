"""Checkpoint files that others made are data: each is refused with its name, or leads to the same weights."""

import copy
import io
import zipfile

import pytest
import torch

from experiments.algorithms.checkpoint import read_checkpoint, resume_checkpoint
from experiments.runs.run_folder import CHECKPOINT
from experiments.settings import CheckpointError
from tests.crafted import crafted_descriptions, flipped, zipped
from tests.experiments.algorithms.test_checkpoint import CODE, CONFIG, learner, saved  # noqa: F401


def as_file(content) -> bytes:
    buffer = io.BytesIO()
    torch.save(content, buffer)
    return buffer.getvalue()


def crafted(path):
    """Checkpoints with other content, as bytes."""
    whole = torch.load(path, weights_only=True)
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


def test_a_checkpoint_that_was_changed_is_refused_or_leads_to_the_same_weights(saved):  # noqa: F811
    folder, one = saved
    path, other = folder / CHECKPOINT, learner()
    weights = one.policy.state_dict()
    for what, content in list(crafted(path)):
        path.write_bytes(content)
        try:
            resume_checkpoint(folder, CONFIG, other, CODE)
        except CheckpointError as error:
            assert CHECKPOINT in str(error) and "\n" not in str(error), what
        else:
            assert all(torch.equal(weights[name], value) for name, value in other.policy.state_dict().items()), what


def test_changed_bytes_of_a_checkpoint_are_found_or_change_nothing(saved):  # noqa: F811
    folder, _ = saved
    path = folder / CHECKPOINT
    weights = read_checkpoint(path)["policy"]
    for what, content in flipped(path, 150):
        path.write_bytes(content)
        try:
            found = read_checkpoint(path)["policy"]
        except CheckpointError as error:
            assert CHECKPOINT in str(error) and "\n" not in str(error), what
        else:
            assert all(torch.equal(weights[name], value) for name, value in found.items()), what


def test_a_checkpoint_of_compressed_parts_is_refused_before_it_is_expanded(saved):  # noqa: F811
    folder, _ = saved
    path = folder / CHECKPOINT
    with zipfile.ZipFile(path) as archive:
        parts = [(name, archive.read(name)) for name in archive.namelist()]
    path.write_bytes(zipped([*parts, ("archive/data/99", bytes(10**7))]))
    with pytest.raises(CheckpointError, match="is damaged or none of ours: its parts are larger than the file"):
        read_checkpoint(path)
