"""Plug-ins: functions that other packages register as entry points, such as studies, and what makes tables and reports.

``python -m segar.experiments.commands.plugin GROUP NAME FOLDER OPTIONS`` calls the function with the folder as its first
argument, and with OPTIONS (JSON) as keyword arguments. It is a process of its own, because what trains must not load what
draws. A package registers a study in its pyproject.toml::

    [project.entry-points."segar.studies"]
    mine = "my_package.my_study:run"  # run(output: Path, **options) -> None
"""

import inspect
import json
import signal
import subprocess
import sys
from collections.abc import Mapping
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from segar.errors import SegarError, did_you_mean
from segar.experiments.settings import ConfigError
from segar.support import escape_what_cannot_be_printed

STUDIES = "segar.studies"  # (output folder, **options) -> None
REPORTS = "segar.reports"  # (results folder) -> None; "tables" and "report"
# (rows of runs, see segar.experiments.runs.run_rows; a file .csv or .parquet for means, if one is wanted) -> str; "default"
SUMMARIES = "segar.summaries"


def find_plugin(group: str, name: str) -> EntryPoint:
    """The entry point of a group that has this name, not loaded; of ``module:function`` one that no package registers.

    Raises:
        ConfigError: no installed package registers the name.
    """
    if ":" in name:
        return EntryPoint(name, name, group)
    known = entry_points(group=group)
    if name not in known.names:
        raise ConfigError(
            f"no installed package has an entry point '{name}' in the group {group}.{did_you_mean(name, known.names)} "
            "Those of this checkout are registered by: make setup. A function of your own is named as module:function"
        )
    return known[name]


def run_plugin(group: str, name: str, folder: Path, options: Mapping[str, Any] | None = None) -> bool:
    """Calls a plug-in in a process of its own; returns whether it ended well. Raises as :func:`find_plugin`."""
    find_plugin(group, name)
    command = [sys.executable, "-m", __name__, group, name, str(folder), json.dumps(dict(options or {}))]
    return subprocess.run(command).returncode == 0


def call_plugin(group: str, name: str, folder: Path, options: Mapping[str, Any]) -> None:
    """Calls a plug-in in this process; raises :class:`ConfigError` if it is not there or takes other options."""
    function = find_plugin(group, name).load()
    try:
        inspect.signature(function).bind(folder, **options)
    except TypeError as error:
        raise ConfigError(f"{name} cannot be called with {dict(options)}: {error}") from error
    function(folder, **options)


if __name__ == "__main__":
    escape_what_cannot_be_printed()
    try:
        call_plugin(sys.argv[1], sys.argv[2], Path(sys.argv[3]), json.loads(sys.argv[4]))
    except SegarError as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        sys.exit(128 + signal.SIGINT)
