"""Pictures for people: frames, windows, videos.

The room draws states; it knows no environments. It imports the engine's states and the colours of the observations.
"""

from segar.rendering.camera import (
    RENDER_MODES,
    Camera,
    Episodes,
    episode_verdict,
    offered_modes,
    status_line,
    steps_per_second,
)
from segar.rendering.scene import Figure, Scene, Stage, View
from segar.rendering.video import record, write_video

__all__ = [
    "RENDER_MODES", "Camera", "Episodes", "Figure", "Scene", "Stage", "View", "episode_verdict", "offered_modes",
    "record", "status_line", "steps_per_second", "write_video",
]  # fmt: skip
