"""Pictures for people: frames, windows, videos, a game, contact sheets."""

from segar.rendering.scene import Figure, Scene, Stage
from segar.rendering.video import record, write_video
from segar.rendering.view import View

__all__ = ["Figure", "Scene", "Stage", "View", "record", "write_video"]
