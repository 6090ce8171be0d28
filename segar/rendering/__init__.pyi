from .camera import (
    RENDER_MODES as RENDER_MODES,
    Camera as Camera,
    episode_verdict as episode_verdict,
    status_line as status_line,
    steps_per_second as steps_per_second,
)
from .scene import Figure as Figure, Stage as Stage, View
from .signs import SIGNS as SIGNS
from .video import check_video as check_video, record, write_video as write_video

__all__ = ["View", "record"]
