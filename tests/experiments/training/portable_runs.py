"""Short runs of the algorithms that the command line names, and the hashes of their weights, as JSON on the last line."""

import hashlib
import json
import sys
import tempfile
from pathlib import Path

from segar.experiments.commands.kernels import choose_kernels
from segar.experiments.settings import (
    KINDS,
    EvaluationConfig,
    LevelsConfig,
    ObservationConfig,
    PPOConfig,
    RunConfig,
    ScaleConfig,
    TrackingConfig,
)

FRAMES, STATE = ObservationConfig("rgb_stack2"), ObservationConfig("state")
ROLLOUT = {"num_envs": 8, "num_steps": 16, "minibatches": 2, "encoder": "keypoints", "widths": (64,), "head_width": 64}
REPLAY = {"num_envs": 2, "num_steps": 16, "warmup": 32, "batch_size": 32, "capacity": 500}
ALGORITHMS = {
    "ppo": (KINDS["ppo"](**{**ROLLOUT, "encoder": "small"}, reward_transform="sqrt"), FRAMES),
    "ppo_recurrent": (KINDS["ppo_recurrent"](**ROLLOUT), FRAMES),
    "curl": (KINDS["curl"](**ROLLOUT, shift=2, intensity=0.05), FRAMES),
    "spr": (KINDS["spr"](**ROLLOUT, horizon=2, model="transition"), FRAMES),
    "drac": (KINDS["drac"](**ROLLOUT, augmentations=("colour_jitter", "random_conv"), shift=2), FRAMES),
    "ppg": (KINDS["ppg"](**ROLLOUT, phase=2, auxiliary_minibatches=2), FRAMES),
    "sac": (KINDS["sac"](**REPLAY), STATE),
    "drq": (KINDS["drq"](**REPLAY), FRAMES),
}


def hash_of_weights(name: str, determinism: str) -> str:
    """Trains the algorithm on frames that are drawn, or on states, and hashes its weights and its evaluation."""
    from segar.experiments.algorithms.checkpoint import read_checkpoint
    from segar.experiments.runs.run_folder import CHECKPOINT, read_episodes
    from segar.experiments.training.run import run

    algorithm, observation = ALGORITHMS[name]
    config = RunConfig(
        levels=LevelsConfig("objectsx1-easy", count=3, test_count=3),
        observation=observation,
        algorithm=algorithm,
        scale=ScaleConfig(frames=256 if isinstance(algorithm, PPOConfig) else 96),
        evaluation=EvaluationConfig(episodes=3, distances=()),
        tracking=TrackingConfig(name="none"),
        determinism=determinism,
        root=tempfile.mkdtemp(),
        progress=False,
    )
    folder = run(config, say=lambda line: None).folder
    digest = hashlib.sha256(json.dumps(read_episodes(Path(folder)).to_pylist()).encode())
    for key, value in read_checkpoint(folder / CHECKPOINT)["policy"].items():
        digest.update(key.encode() + value.contiguous().numpy().tobytes())
    return digest.hexdigest()


if __name__ == "__main__":
    choose_kernels(sys.argv[1])
    print(json.dumps({name: hash_of_weights(name, sys.argv[1]) for name in sys.argv[2:]}))
