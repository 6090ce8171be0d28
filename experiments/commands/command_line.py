"""Command lines that are not Hydra's: the fields of a dataclass, or the arguments of a function, as options of argparse."""

import argparse
import dataclasses
import inspect
import signal
import sys
import typing
from collections.abc import Callable, Sequence
from importlib.metadata import entry_points
from types import ModuleType
from typing import Any

from omegaconf import OmegaConf

from segar.errors import naming
from segar.experiments.commands.hydra_app import ends_with_its_reader, errors_as_messages, to_plain, unreadable_told
from segar.experiments.settings import ConfigError, construct
from segar.support import Parser


@ends_with_its_reader()
def run_from_command_line(task: Callable[..., Any], settings: type | None = None) -> None:
    """Runs ``task`` with what the command line states: an object of the dataclass ``settings``, or the arguments of ``task``.

    Each of them is an option, ``--name value`` or ``name=value``, with values as in YAML. ``-o`` is ``--output``, and a setting
    that is false by default needs no value. What stands without a name goes to the ``*arguments`` of the function, if it has
    any. ``--help`` begins with the text of the function's module. Exits with 1 and one message where a user can mend something.
    """
    kinds = {p.kind for p in inspect.signature(task).parameters.values()}
    takes_others = settings is None and inspect.Parameter.VAR_POSITIONAL in kinds
    stated = settings or settings_of(task)
    try:
        with errors_as_messages():
            module = sys.modules[task.__module__]
            data, others = read_arguments(sys.argv[1:], stated, module.__doc__, command_of(module))
            if others and not takes_others:
                raise ConfigError(f"'{others[0]}' is no setting; settings are given as name=value")
            found = construct(stated, data, "")
            task(found) if settings is not None else task(*others, **vars(found))
    except KeyboardInterrupt:
        sys.exit(128 + signal.SIGINT)


def command_of(module: ModuleType) -> str:
    """How the command in a module is called: ``segar NAME`` where an entry point says so, else ``python -m MODULE``."""
    name = module.__spec__.name.removesuffix(".__main__") if module.__spec__ else module.__name__
    known = {one.module.removesuffix(".__main__"): one.name for one in entry_points(group="segar.commands")}
    return f"segar {known[name]}" if name in known else f"python -m {name}"


def read_arguments(
    arguments: Sequence[str], settings: type, about: str | None, command: str
) -> tuple[dict[str, Any], list[str]]:
    """The settings that a command line states, as plain data, and what stands there without a name.

    Raises:
        ConfigError: a value cannot be read, or nothing is called so.
    """
    parser = Parser(
        prog=command,
        description=(about or "").strip(),
        epilog="name=value is the same as --name value.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    lists = {name for name, hint in typing.get_type_hints(settings).items() if typing.get_origin(hint) is tuple}
    for one in dataclasses.fields(settings):
        flags = ["-o", "--output"] if one.name == "output" else [f"--{one.name}"]
        note = "required" if one.default is dataclasses.MISSING else f"default: {one.default}".replace("%", "%%")
        options: dict[str, Any] = {"nargs": "+"} if one.name in lists else {}
        if one.default is False:
            options = {"nargs": "?", "const": "true"}
        parser.add_argument(*flags, help=note, metavar="VALUE", default=argparse.SUPPRESS, **options)
    given = [f"--{one}" if one.partition("=")[0].isidentifier() and "=" in one else one for one in arguments]
    stated, rest = parser.parse_known_args(given)
    data: dict[str, Any] = {}
    for name, texts in vars(stated).items():
        values = [read_value(name, text) for text in (texts if name in lists else [texts])]
        data[name] = values if name in lists and not (len(values) == 1 and isinstance(values[0], list)) else values[0]
    unknown = {one.lstrip("-").partition("=")[0]: None for one in rest if one.startswith("--")}
    return data | unknown, [one for one in rest if not one.startswith("--")]


def read_value(name: str, text: str) -> Any:
    """The value of a setting, from YAML; raises :class:`ConfigError`."""
    with naming(name, ConfigError), unreadable_told():
        return to_plain(OmegaConf.from_cli([f"{name}={text}"]))[name]


def settings_of(function: Callable[..., Any]) -> type:
    """A dataclass with the arguments of a function that have a default."""
    hints = typing.get_type_hints(function)
    named = [p for p in inspect.signature(function).parameters.values() if p.default is not p.empty]
    return dataclasses.make_dataclass("Settings", [(p.name, hints[p.name], p.default) for p in named])
