"""Pictures are drawn without a screen."""

import os

os.environ["SDL_VIDEODRIVER"] = "dummy"  # read by SDL when the first window is opened
