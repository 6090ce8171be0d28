from .episodes import Episode as Episode
from .human_play import read_play
from .recipe import Recipe as Recipe, levels_of, recipe_of
from .recording import record
from .replay import check_replay

__all__ = ["check_replay", "levels_of", "read_play", "recipe_of", "record"]
