"""``segar cite``: how to cite SEGAR, and what a publication states of a run, so that others can repeat it."""

import argparse
import platform
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from segar.cli import arguments
from segar.errors import SegarError
from segar.support import __version__, data_in, installed_version, need

SOFTWARE = {
    "author": "{SEGAR developers}",
    "title": "{SEGAR}: a sandbox for research on generalization in reinforcement learning",
    "year": "2026",
}
PAPER = {
    "author": "Hjelm, R Devon and Mazoure, Bogdan and Golemo, Florian and Frujeri, Felipe V and Braga, Pedro H M and"
    " Jalobeanu, Mihai and Kahou, Samira E and Kolobov, Andrey",
    "title": "The Sandbox Environment for Generalizable Agent Research ({SEGAR})",
    "year": "2022",
    "eprint": "2203.10351",
    "archiveprefix": "arXiv",
}
LIBRARIES = ("segar", "torch", "torchrl", "numpy", "numba", "gymnasium")
CONFIG, VERSIONS, SUMMARY = "config.yaml", "versions.json", "summary.json"
FORMS = {
    CONFIG: {"scale": dict},
    VERSIONS: {"libraries": dict, **dict.fromkeys(("git?", "levels?", "code?"), (dict, None))},
    SUMMARY: dict,
}
"""What is read of the files of a run; see :func:`segar.support.misfit`."""
DECIDES = ("levels", "task", "observation", "algorithm", "frames", "evaluation", "seed")  # the settings behind results


def add_commands(commands: Any) -> None:
    """Add ``cite`` to the sub-commands of a parser."""
    purpose = "print BibTeX entries, and what a publication states of a run: versions, hashes, settings and seeds"
    citing = arguments.command(commands, "cite", cite, purpose)
    citing.add_argument(
        "folder", metavar="RUN", nargs="?", help="a run folder; without it, the versions that are installed"
    )


def cite(chosen: argparse.Namespace) -> None:
    """``segar cite``."""
    answer = about_installation() if chosen.folder is None else about_run(Path(chosen.folder))
    entries = bibtex(answer["versions"]["segar"])
    text = [*entries.values(), *(_section(name, part) for name, part in answer.items())]
    arguments.print_answer(chosen, {"bibtex": entries, **answer}, "\n\n".join(text))


def bibtex(release: str | None) -> dict[str, str]:
    """The BibTeX entries of a release of this software, None where it is not known, and of the paper of 2022."""
    stated = {} if release is None else {"version": release}
    return {
        "software": _entry("software", "segar", SOFTWARE | stated),
        "paper": _entry("misc", "hjelm2022segar", PAPER),
    }


def about_installation() -> dict[str, Any]:
    """The versions of what is installed here."""
    found = {name: installed_version(name) for name in LIBRARIES if name != "segar"}
    return {"versions": {"segar": __version__, "python": platform.python_version(), **found}}


def about_run(folder: Path) -> dict[str, Any]:
    """What a publication states of the run in a folder: names, versions, hashes, settings and seeds, as plain data.

    Raises:
        SegarError: the folder holds no run, or a file of it cannot be read.
    """
    if not (folder / CONFIG).is_file():
        raise SegarError(f"{folder} is no run folder: there is no {CONFIG}; give the folder that segar train names")
    if not (folder / VERSIONS).is_file():
        raise SegarError(f"the run in {folder} never began to train: there is no {VERSIONS}")
    settings, made = (_data_in(folder / name) for name in (CONFIG, VERSIONS))
    summary = _data_in(folder / SUMMARY) if (folder / SUMMARY).is_file() else {}
    settings["frames"] = settings["scale"].get("frames")
    libraries, commit, levels, code = (made.get(name) or {} for name in ("libraries", "git", "levels", "code"))
    flat = dict(_leaves({name: settings[name] for name in DECIDES if name in settings}))
    return {
        "run": {"name": summary.get("label", folder.resolve().name), "finished": bool(summary)},
        "versions": {
            "segar": libraries.get("segar"),
            "python": made.get("python"),
            **{name: libraries.get(name) for name in LIBRARIES if name != "segar"},
            "platform": made.get("platform"),
            "commit": commit.get("commit"),
            "commit, with changes": commit.get("changed"),
        },
        "hashes": {f"{name} levels": value for name, value in levels.items()} | code,
        "seeds": {name: value for name, value in flat.items() if name.rpartition(".")[2].endswith("seed")},
        "settings": flat,
    }


def _data_in(path: Path) -> dict[str, Any]:
    """The names and values in a file of YAML, or JSON, as plain data; no code that they name is imported."""
    need("reading the files of a run", "yaml")
    from segar.support import read_yaml

    return data_in(path, "a file of a run", SegarError, read_yaml, form=FORMS[path.name])


def _leaves(data: Mapping[str, Any], place: str = "") -> Iterator[tuple[str, Any]]:
    """Names with dots and their values, one for each setting."""
    for name, value in data.items():
        if isinstance(value, dict) and value:
            yield from _leaves(value, f"{place}{name}.")
        else:
            yield f"{place}{name}", value


def _entry(kind: str, key: str, fields: Mapping[str, str]) -> str:
    lines = [f"  {name} = {{{value}}}," for name, value in fields.items()]
    return "\n".join([f"@{kind}{{{key},", *lines, "}"])


def _section(title: str, part: Mapping[str, Any]) -> str:
    return f"{title}\n{arguments.columns([[f'  {name}', _shown(value)] for name, value in part.items()])}"


def _shown(value: Any) -> Any:
    """A value as the table has it: settings keep all their digits."""
    empty: Sequence[Any] = ({}, [], "")
    return "none" if value in empty else repr(value) if isinstance(value, float) else value
