from .dataset import Dataset as Dataset, Episode as Episode
from .human_play import read_play
from .minari_export import minari_place as minari_place, to_minari
from .recording import record
from .replay import check_replay
from .rollouts import Policy as Policy

__all__ = ["check_replay", "read_play", "record", "to_minari"]
