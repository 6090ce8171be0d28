from .notebook import html_of as html_of
from .page import Playground as Playground, make_playground
from .policy import WEIGHTS as WEIGHTS
from .priors_text import (
    Varying as Varying,
    composition as composition,
    described as described,
    together as together,
    varying as varying,
)
from .run_folder import read_policy, read_row_policy as read_row_policy
from .server import serve_pages as serve_pages
from .studio import Studio as Studio
from .world import aim_of as aim_of

__all__ = ["make_playground", "read_policy"]
