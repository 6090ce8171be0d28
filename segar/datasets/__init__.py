"""Recorded episodes: frames, true factors and actions, for offline learning and for the study of representations."""

from segar.datasets.dataset import Dataset, Episode, Shard
from segar.datasets.human_play import read_play
from segar.datasets.manifest import Manifest, Settings
from segar.datasets.minari_export import minari_place, to_minari
from segar.datasets.recording import record
from segar.datasets.replay import check_replay
from segar.datasets.rollouts import Policy, Rollouts

__all__ = [
    "Dataset", "Episode", "Manifest", "Policy", "Rollouts", "Settings", "Shard", "check_replay", "minari_place",
    "read_play", "record", "to_minari",
]  # fmt: skip
