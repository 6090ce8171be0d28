"""Progress of a run: a bar on a terminal; a line every :data:`LINE_INTERVAL` seconds where there is none."""

import sys
import time
from collections.abc import Mapping
from typing import TextIO

from tqdm import tqdm

LINE_INTERVAL = 15.0  # [s]


class Progress:
    """Shows frames done, frames per second, mean return and the time that is left."""

    def __init__(self, label: str, total: int, done: int, *, shown: bool, stream: TextIO | None = None) -> None:
        self.label, self.total, self.frames, self.shown = label, total, done, shown
        self.stream = stream or sys.stderr
        self.started, self.first = time.monotonic(), done
        self.last_line = self.started
        self.bar = None
        if shown and self.stream.isatty():
            self.bar = tqdm(
                total=total, initial=done, desc=label, unit="frame", unit_scale=True, file=self.stream, leave=False
            )

    def update(self, frames: int, figures: Mapping[str, float]) -> None:
        """Shows that ``frames`` are done; ``figures`` may hold ``episode/return`` and ``episode/success``."""
        advance, self.frames = frames - self.frames, frames
        text = ", ".join(
            f"{name} {figures[f'episode/{name}']:.2f}" for name in ("return", "success") if f"episode/{name}" in figures
        )
        if self.bar is not None:
            if text:
                self.bar.set_postfix_str(text, refresh=False)
            self.bar.update(advance)
        elif self.shown and time.monotonic() - self.last_line > LINE_INTERVAL:
            self.last_line = time.monotonic()
            left = max(self.total - frames, 0) / max(self.rate(), 1e-9)
            print(
                f"{self.label}: {frames:,} of {self.total:,} frames, {self.rate():,.0f} frames/s, {text}, "
                f"about {left:.0f} s left",
                file=self.stream,
                flush=True,
            )

    def rate(self) -> float:
        """Frames per second since the start."""
        return (self.frames - self.first) / max(time.monotonic() - self.started, 1e-9)

    def close(self) -> None:
        """Removes the bar."""
        if self.bar is not None:
            self.bar.close()
