from .episodes import Episode as Episode
from .recipe import Recipe as Recipe, levels_of, recipe_of
from .recording import record
from .replay import check_replay, read_play

__all__ = ["check_replay", "levels_of", "read_play", "recipe_of", "record"]
