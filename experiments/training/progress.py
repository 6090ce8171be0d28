"""Progress of a run: a bar on a terminal; where there is none, a line soon and then every :data:`LINE_INTERVAL` seconds."""

import sys
import time
from collections.abc import Mapping

from tqdm import tqdm

LINE_INTERVAL, FIRST_LINE = 15.0, 2.0  # [s] after training has begun; from then on, how fast it is can be said


class Progress:
    """Shows frames done, frames per second, mean return and the time that is left."""

    def __init__(self, label: str, total: int, done: int, *, shown: bool) -> None:
        self.label, self.total, self.frames, self.shown = label, total, done, shown
        self.stream = sys.stderr
        self.since, self.first = time.monotonic(), done  # of the last line, or of the start
        self.next_line = self.since + FIRST_LINE
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
        elif self.shown and time.monotonic() > self.next_line:
            left = max(self.total - frames, 0) / max(self.rate(), 1e-9)
            print(
                f"{self.label}: {frames:,} of {self.total:,} frames, {self.rate():,.0f} frames/s, {text}, "
                f"about {left:.0f} s left",
                file=self.stream,
                flush=True,
            )
            self.since, self.first = time.monotonic(), frames
            self.next_line = self.since + LINE_INTERVAL

    def rate(self) -> float:
        """Frames per second since the last line, as what comes first may be faster or slower."""
        return (self.frames - self.first) / max(time.monotonic() - self.since, 1e-9)

    def close(self) -> None:
        """Removes the bar."""
        if self.bar is not None:
            self.bar.close()
