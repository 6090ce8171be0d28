"""Pictures are drawn without a screen."""

from __future__ import annotations

import os

os.environ["SDL_VIDEODRIVER"] = "dummy"  # read by SDL when the first window is opened
