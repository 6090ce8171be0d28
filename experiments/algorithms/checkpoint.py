"""Checkpoints: weights and all state that a resumed run needs, as tensors and plain data, loaded without unpickling objects.

A run keeps its newest checkpoint and the one before. If the newest one is damaged (by a disk, or by an interrupted copy), it
is renamed, and the run resumes from the one before.
"""

import io
import os
import pickle
import shutil
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import torch
from torch import nn

from segar.errors import SegarError, naming
from segar.experiments.algorithms.learner import Learner
from segar.experiments.runs.executed_code import differing_parts
from segar.experiments.runs.files import replacing, write_bytes
from segar.experiments.runs.run_folder import CHECKPOINT, CONFIG, DAMAGED, PREVIOUS
from segar.experiments.settings import CheckpointError, RunConfig, TrainingError, digest
from segar.support import damage_told, misfit, opened

FORMAT, UNSEALED = 2, 1  # the comment of a file is the sum over its parts; before, there was none
TRAIN_ANEW = "restart=true trains anew"
FORM = {
    "config": str,
    "code": {str: str},
    "frames": int,
    "policy": {str: torch.Tensor},
    "learner": {},
    "extra": {"seconds": float, "rows?": int, "played?": int, "figures?": str},
}
"""What a checkpoint holds; see :func:`segar.support.misfit`."""


def save_checkpoint(
    folder: Path, config: RunConfig, learner: Learner, extra: Mapping[str, Any], code: Mapping[str, str]
) -> None:
    """Writes the run's newest checkpoint; the newest one until now becomes the one before.

    The folder holds a whole checkpoint at every moment, also if the process is killed in this function.

    Args:
        extra: further state of the run: tensors, numbers, text, and dicts and lists of these.
        code: the parts of :func:`segar.experiments.runs.executed_code.executed_code`.

    Raises:
        TrainingError: a weight is not finite; the old checkpoints stay.
        RunFolderError: it cannot be written; the old ones stay.
    """
    _require_finite(learner)
    content = {
        "format": FORMAT,
        "config": config.hash,
        "code": dict(code),
        "frames": learner.frames,
        "policy": learner.policy.state_dict(),
        "learner": learner.state_dict(),
        "extra": dict(extra),
    }
    buffer = io.BytesIO()  # a full disk would end torch.save's own writing with an error that names no cause
    torch.save(content, buffer)
    with zipfile.ZipFile(buffer, "a") as parts:
        parts.comment = _sum(parts)
    path = folder / CHECKPOINT
    if path.exists():
        with replacing(folder / PREVIOUS) as beside:
            _link(path, beside)
    write_bytes(path, buffer.getvalue())


def resume_checkpoint(
    folder: Path, config: RunConfig, learner: Learner, code: Mapping[str, str], say: Callable[[str], None] = print
) -> dict[str, Any] | None:
    """Restores the learner from the run's checkpoint; returns its ``extra``, or None where there is no checkpoint.

    A damaged newest checkpoint is renamed, ``say`` gets a message, and the one before is used.

    Raises:
        CheckpointError: it was written by other code or for another network or configuration, or is damaged and there
            is none before it.
    """
    found = newest_checkpoint(folder, say)
    if found is None:
        return None
    path, content = found
    if content["config"] != config.hash:
        raise CheckpointError(
            f"the checkpoint {path} was written by another configuration ({content['config']} there, {config.hash} here). "
            "Go back to that configuration, or train anew with restart=true"
        )
    if differing := differing_parts(content["code"], code):
        raise CheckpointError(
            f"{path} was written by other code: {', '.join(differing)} changed since. Go back to the code that wrote it, "
            "or train anew with stale=anew"
        )
    _load_weights(path, learner.policy, content)
    with naming(f"{path} does not fit the learner ({TRAIN_ANEW})", CheckpointError), damage_told(SegarError):
        learner.load_state_dict(content["learner"])
    return content["extra"]


def newest_checkpoint(folder: Path, say: Callable[[str], None] = print) -> tuple[Path, dict[str, Any]] | None:
    """The newest checkpoint of a run that can be read, and its content; None where there was never one.

    A damaged newest one is renamed (it must not become the one before), and ``say`` gets a message.

    Raises:
        CheckpointError: there are only damaged ones.
    """
    newest, previous = folder / CHECKPOINT, folder / PREVIOUS
    if not newest.exists() and not previous.exists():
        return None
    try:
        return newest, read_checkpoint(newest)
    except CheckpointError as error:
        if not previous.exists():
            raise
        content = read_checkpoint(previous)  # raises: both are damaged
        kept = ""
        if newest.exists():
            os.replace(newest, folder / DAMAGED)
            kept = f" (kept as {DAMAGED})"
        reason = str(error).removesuffix(f". {TRAIN_ANEW}")
        say(f"{reason}{kept}. The one before is used, of {content['frames']:,} frames: {previous}")
        return previous, content


def load_newest_policy(
    folder: Path, policy: nn.Module, say: Callable[[str], None] = print, config: RunConfig | None = None
) -> int:
    """Fills ``policy`` with the newest weights of the run in ``folder``; returns the frames that they were trained for.

    Where ``config``, the run's settings, are not those that the weights were made with, ``say`` gets a note.

    Raises:
        CheckpointError: there is no checkpoint yet, all are damaged, or the weights belong to another network.
    """
    found = newest_checkpoint(folder, say)
    if found is None:
        raise CheckpointError(f"there is no checkpoint in {folder} yet")
    path, content = found
    _load_weights(path, policy, content)
    made_with = content["config"]
    if config is not None and made_with != config.hash:
        say(
            f"note: {folder / CONFIG} was edited: its settings have the hash {config.hash}, and the weights were made with"
            f" {made_with}. The agent plays by the edited settings"
        )
    return content["frames"]


def read_checkpoint(path: Path) -> dict[str, Any]:
    """The content of a checkpoint file; raises :class:`CheckpointError` if it is missing, damaged or of another format.

    Its parts have their types, and weights and the learner's state are tensors and plain data; whether they fit a network
    and a learner, these say. A file whose parts are compressed is refused: torch never compresses them, and compressed
    ones could expand without limit.
    """
    told = f"the checkpoint {path} is damaged or none of ours"
    unusable = damage_told(lambda why: CheckpointError(f"{told}: {why}. {TRAIN_ANEW}"), pickle.UnpicklingError)
    with opened(path, "checkpoint", CheckpointError) as file, unusable:
        parts = zipfile.ZipFile(file)  # torch does not look at the sums that it writes
        if sum(part.file_size for part in parts.infolist()) > path.stat().st_size:
            raise zipfile.BadZipFile("its parts are larger than the file")
        odd = parts.testzip()
        if odd is not None:
            raise zipfile.BadZipFile(f"the sum over {odd} is wrong")
        file.seek(0)
        content = torch.load(file, map_location="cpu", weights_only=True)
    if not isinstance(content, dict) or content.get("format") not in (UNSEALED, FORMAT):
        found = content.get("format") if isinstance(content, dict) else type(content).__name__
        raise CheckpointError(f"the checkpoint {path} has format {found!r}; this version reads {FORMAT}. {TRAIN_ANEW}")
    is_sealed = content["format"] == UNSEALED or parts.comment == _sum(parts)
    if wrong := misfit(content, FORM) or (None if is_sealed else "something else than a run wrote it, or changed it"):
        raise CheckpointError(f"the checkpoint {path} is damaged or none of ours: {wrong}. {TRAIN_ANEW}")
    return content


def _sum(parts: zipfile.ZipFile) -> bytes:
    """A sum over names, sizes and sums of the parts of a file, which are not what they were where somebody edited one."""
    return digest([(part.filename, part.file_size, part.CRC) for part in parts.infolist()]).encode()


def _link(path: Path, other: Path) -> None:
    """Gives a file a second name, or makes a copy where the file system has no such names."""
    other.unlink(missing_ok=True)
    try:
        os.link(path, other)
    except OSError:
        shutil.copyfile(path, other)


def _require_finite(learner: Learner) -> None:
    for name, value in learner.policy.state_dict().items():
        if value.is_floating_point() and not torch.isfinite(value).all():
            raise TrainingError(
                f"the weight '{name}' is not finite after {learner.frames} frames; lower algorithm.learning_rate"
            )


def _load_weights(path: Path, policy: nn.Module, content: Mapping[str, Any]) -> None:
    stored = {name: tuple(v.shape) for name, v in content["policy"].items()}
    here = {name: tuple(v.shape) for name, v in policy.state_dict().items()}
    if stored != here:
        odd = next(name for name in (*here, *stored) if stored.get(name) != here.get(name))
        raise CheckpointError(
            f"the checkpoint {path} is of another network: '{odd}' is {stored.get(odd, 'absent')} there and "
            f"{here.get(odd, 'absent')} here. The settings of its run, in {CONFIG}, make the right one"
        )
    for name, value in content["policy"].items():
        if value.is_floating_point() and not torch.isfinite(value).all():
            raise CheckpointError(f"the checkpoint {path}: the weight '{name}' is not finite. {TRAIN_ANEW}")
    policy.load_state_dict(content["policy"])
