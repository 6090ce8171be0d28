"""The journal of a run: one JSON object per line says when it was started, stopped, failed, finished, or lost.

A process that is killed outright (``kill -9``, out of memory, a power cut) writes nothing. The next process finds a start
without an end, and notes it as ``lost``.
"""

import json
import os
import socket
import sys
import traceback
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from segar.experiments.commands.signals import Stopped
from segar.experiments.runs.run_folder import JOURNAL
from segar.experiments.settings import RunFolderError
from segar.support import content_of, from_json, misfit

PREPARATION = "preparation"  # what a run does before its first frame
LINE = {"event": str, "time": str, "process?": int, "host?": str, "frames?": int, "error?": str}


class Journal:
    """Writes the journal of a run folder; ``doing`` and ``frames`` say how far the run is."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / JOURNAL
        self.doing = PREPARATION
        self.frames = 0

    def begin(self) -> str | None:
        """Notes that this process starts; returns a message if the process before it was lost."""
        message = None
        before = read_journal(self.path.parent)
        if before and before[-1]["event"] == "started":
            last = before[-1]
            self.note("lost", **{name: last[name] for name in ("process", "host") if name in last})
            message = (
                f"the process before this one ({last.get('process', '?')} on {last.get('host', '?')}, begun {last['time']})"
                " ended without a word: killed, out of memory, or a power cut"
            )
        self.note("started", process=os.getpid(), host=socket.gethostname())
        return message

    def end(self, error: BaseException | None = None) -> None:
        """Notes how this process ended: with an error, or finished."""
        if error is None:
            self.note("finished", frames=self.frames)
            return
        event = "stopped" if isinstance(error, KeyboardInterrupt | SystemExit) else "failed"
        self.note(event, during=self.doing, frames=self.frames, **_account(error))
        error.add_note(f"This happened during {self.doing}, after {self.frames:,} frames; see {self.path}")

    def note(self, event: str, **facts: Any) -> None:
        """Appends a line; where that is impossible (a full disk), prints the line to stderr."""
        line = {"time": datetime.now(UTC).isoformat(timespec="seconds"), "event": event, **facts}
        try:
            with self.path.open("ab") as stream:
                torn = stream.tell() > 0 and not self.path.read_bytes().endswith(b"\n")
                stream.write(b"\n" * torn + json.dumps(line).encode() + b"\n")
        except OSError as error:
            print(f"cannot write {self.path}: {error.strerror}; it would say: {json.dumps(line)}", file=sys.stderr)


def read_journal(folder: Path) -> list[dict[str, Any]]:
    """All lines of a run's journal that are whole; a full disk or a power cut can leave others."""
    path = folder / JOURNAL
    text = content_of(path, "journal", RunFolderError) if path.exists() else b""
    lines = text.decode(errors="replace").splitlines()
    return [entry for entry in map(_parsed, lines) if entry is not None]


def _account(error: BaseException) -> dict[str, Any]:
    """The message of an error, the place in the code where it was raised, and its traceback."""
    frames = traceback.extract_tb(error.__traceback__)
    where = f"{frames[-1].filename}:{frames[-1].lineno} in {frames[-1].name}" if frames else ""
    what = str(error) if isinstance(error, Stopped) else f"{type(error).__name__}: {error}"
    return {"error": what, "where": where, "traceback": traceback.format_exception(error)}


def _parsed(line: str) -> dict[str, Any] | None:
    try:
        entry = from_json(line.encode())
    except ValueError:
        return None
    return None if misfit(entry, LINE) else entry
