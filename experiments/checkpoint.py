"""Checkpoints: weights and what it takes to go on, as tensors and plain data, loaded without unpickling objects."""

from __future__ import annotations

import hashlib
import io
import pickle
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import nn

from experiments.atomic import write_bytes
from experiments.config import RunConfig
from experiments.errors import CheckpointError
from experiments.learner import Learner
from experiments.run_folder import CHECKPOINT, CONFIG
from experiments.versions import code_fingerprint

FORMAT = 1
TRAIN_ANEW = "restart=true trains anew"


def save_checkpoint(folder: Path, config: RunConfig, learner: Learner, extra: Mapping[str, Any]) -> None:
    """Replaces the run's checkpoint; raises :class:`RunFolderError` if it cannot be written, and keeps the old one.

    Args:
        extra: what else the run needs to go on; tensors, numbers, text, and dicts and lists of these.
    """
    content = {
        "format": FORMAT,
        "config": config.hash(),
        "code": code_fingerprint(config.algorithm.learner),
        "architecture": architecture(learner.policy),
        "frames": learner.frames,
        "policy": learner.policy.state_dict(),
        "learner": learner.state_dict(),
        "extra": dict(extra),
    }
    buffer = io.BytesIO()  # a full disk would end torch.save's own writing with an error that names no cause
    torch.save(content, buffer)
    write_bytes(folder / CHECKPOINT, buffer.getvalue())


def resume_checkpoint(folder: Path, config: RunConfig, learner: Learner) -> dict[str, Any] | None:
    """Puts the learner where the run's checkpoint was; returns its ``extra``, or None where there is no checkpoint.

    Raises:
        CheckpointError: it was written by other code or for another network or configuration, or is damaged.
    """
    path = folder / CHECKPOINT
    if not path.exists():
        return None
    content = read_checkpoint(path)
    _require_equal(path, "configuration", content["config"], config.hash())
    _require_equal(path, "code", content["code"], code_fingerprint(config.algorithm.learner))
    _load_weights(path, learner.policy, content)
    learner.load_state_dict(content["learner"])
    return content["extra"]


def load_policy(path: Path, policy: nn.Module) -> int:
    """Fills ``policy`` with the weights of a checkpoint; returns the frames that they were trained for.

    Raises:
        CheckpointError: the weights belong to another network, or the file is missing or damaged.
    """
    content = read_checkpoint(path)
    _load_weights(path, policy, content)
    return content["frames"]


def read_checkpoint(path: Path) -> dict[str, Any]:
    """The content of a checkpoint file; raises :class:`CheckpointError` if it is missing, damaged or of another format."""
    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
    except FileNotFoundError as error:
        raise CheckpointError(f"there is no checkpoint at {path}") from error
    except (RuntimeError, ValueError, OSError, EOFError, pickle.UnpicklingError) as error:
        raise CheckpointError(
            f"the checkpoint {path} is damaged or none of ours: {_first_line(error)}. {TRAIN_ANEW}"
        ) from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        found = content.get("format") if isinstance(content, dict) else type(content).__name__
        raise CheckpointError(
            f"the checkpoint {path} has format {found!r}; this version reads format {FORMAT}. {TRAIN_ANEW}"
        )
    return content


def architecture(policy: nn.Module) -> str:
    """Sixteen hexadecimal digits over the names and shapes of all weights."""
    text = "\n".join(f"{name} {tuple(value.shape)}" for name, value in policy.state_dict().items())
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _load_weights(path: Path, policy: nn.Module, content: Mapping[str, Any]) -> None:
    if content["architecture"] != architecture(policy):
        stored = {name: tuple(v.shape) for name, v in content["policy"].items()}
        here = {name: tuple(v.shape) for name, v in policy.state_dict().items()}
        odd = next(name for name in (*here, *stored) if stored.get(name) != here.get(name))
        raise CheckpointError(
            f"the checkpoint {path} is of another network: '{odd}' is {_shape(stored, odd)} there and "
            f"{_shape(here, odd)} here. The settings of its run, in {CONFIG}, make the right one"
        )
    policy.load_state_dict(content["policy"])


def _shape(shapes: Mapping[str, tuple[int, ...]], name: str) -> str:
    return str(shapes[name]) if name in shapes else "absent"


def _require_equal(path: Path, what: str, stored: str, here: str) -> None:
    if stored != here:
        raise CheckpointError(
            f"the checkpoint {path} was written by another {what} ({stored} there, {here} here). "
            f"Go back to that {what}, or train anew with restart=true"
        )


def _first_line(error: BaseException) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
