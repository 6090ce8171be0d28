"""Pictures for people: frames, windows, videos, a game, contact sheets."""

from segar.rendering.camera import RENDER_MODES, Camera, ending_of, status_line, steps_per_second
from segar.rendering.scene import Figure, Scene, Stage
from segar.rendering.video import record, write_video
from segar.rendering.view import View

__all__ = [
    "RENDER_MODES",
    "Camera",
    "Figure",
    "Scene",
    "Stage",
    "View",
    "ending_of",
    "record",
    "status_line",
    "steps_per_second",
    "write_video",
]
