"""How commands start: Hydra on ``conf/``, whatever the working directory, and errors as one message each."""

import argparse
import os
import select
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from itertools import dropwhile
from pathlib import Path
from typing import Any

import hydra
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import CompactHydraException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf, open_dict
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from segar.errors import SegarError
from segar.experiments.commands.config_store import CONF, register_settings
from segar.experiments.commands.overrides import (
    OWN_NAMES,
    explain_overrides,
    number_of_runs,
    single_runs,
    with_own_names,
    with_search_path,
    without_password_in,
)
from segar.experiments.commands.signals import Stopped
from segar.experiments.settings import ConfigError, RunConfig, import_object, run_config
from segar.support import escape_what_cannot_be_printed

# Options of Hydra's that show something and run nothing, or run what an earlier command was.
SHOWS = ("--help", "-h", "--hydra-help", "--shell-completion", "-sc", "--experimental-rerun")


@contextmanager
def ends_with_its_reader() -> Iterator[None]:
    """A block, or a command that it decorates, that ends quietly with 141, as a shell has it, where nobody reads what it prints
    any more, such as in ``| head``. Characters that cannot be printed are escaped."""
    escape_what_cannot_be_printed()
    try:
        try:
            yield
        finally:
            sys.stdout.flush()  # else Python complains when it ends
    except BrokenPipeError as error:
        if not is_unread():  # the pipe of another process
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        ended = error.__context__
        sys.exit(ended.code if isinstance(ended, SystemExit) and ended.code else 128 + signal.SIGPIPE)


def is_unread() -> bool:
    """Whether what is printed goes into a pipe that has no reader any more."""
    state = select.poll()
    state.register(sys.stdout.fileno(), 0)
    return any(event & select.POLLERR for _, event in state.poll(0))


@ends_with_its_reader()
def run_command(
    task: Callable[[Any], Any],
    config_name: str = "config",
    build: Callable[[DictConfig], Any] | None = None,
    settings: Mapping[str, Any] | None = None,
    about: Callable[[], str] | None = None,
    announce: Callable[[Sequence[Any], int], None] | None = None,
) -> None:
    """Runs ``task`` with the settings of the command line, under Hydra (so ``--multirun`` works).

    Exits with 1 on an error. What a user can mend ends with one message; HYDRA_FULL_ERROR=1 shows where it came from. Exits
    with 128 + n where signal n stopped it, as a shell does.

    Args:
        build: makes the argument of ``task`` from Hydra's result; None makes a :class:`RunConfig`.
        settings: defaults beyond those of a :class:`RunConfig`, known to Hydra as ``base_<config_name>``.
        about: what ``--help`` prints in place of Hydra's text.
        announce: tells what a sweep is going to do: it gets arguments of ``task`` for some of its runs, and how many there are.
    """
    if about is not None and {"-h", "--help"} & {*sys.argv[1:]}:
        print(about())
        return
    register_settings(config_name, settings)
    failed: list[str] = []  # messages of the runs of a sweep; Hydra shows the first

    def call(config: DictConfig) -> Any:
        with ends_with_its_reader(), errors_as_messages():  # inside Hydra, which would print a traceback
            try:
                return task((build or build_run)(config))
            except SegarError as error:
                if HydraConfig.get().mode is not RunMode.MULTIRUN or wants_full_error():
                    raise
                # Hydra goes on with the other runs, says which of them went wrong first, and prints its message.
                failed.append(error_message(error))
                raise CompactHydraException(f"error: {error_message(error)}") from None

    try:
        with errors_as_messages():
            sys.argv[1:] = map(without_password_in, with_own_names(sys.argv[1:]))
            configs, number = check_command_line(config_name)
            if announce is not None and number:
                with suppress(SegarError):  # a run whose settings are wrong says so itself, and the others go on
                    announce([(build or build_run)(one) for one in configs], number)
            hydra.main(version_base="1.3", config_path=str(CONF), config_name=config_name)(call)()
    except SystemExit:
        if len(failed) > 1:
            print("\n".join([f"{len(failed)} runs of the sweep went wrong. The others:", *failed[1:]]), file=sys.stderr)
        raise
    except KeyboardInterrupt as stop:
        print(f"{str(stop) or 'stopped'}. The same command goes on from the last checkpoint", file=sys.stderr)
        sys.exit(128 + (stop.signal if isinstance(stop, Stopped) else signal.SIGINT))


def check_command_line(config_name: str) -> tuple[list[DictConfig], int]:
    """Raises :class:`ConfigError` for a name on the command line that no setting, choice or module has, before a run begins.

    Returns:
        Hydra's results for runs with all choices of a sweep, and how many runs it has; 0 if it is none, or nobody knows.
    """
    told = [*dropwhile(lambda one: not is_setting(one), sys.argv[1:])]
    if rest := [one for one in dropwhile(is_setting, told) if is_setting(one)]:
        raise ConfigError(
            f"settings stand on one side of options such as --multirun, all of them: move {' '.join(rest)}"
        )
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("--config-dir", "-cd")
    parser.add_argument("--config-name", "-cn")
    arguments, rest = parser.parse_known_args()
    if {*SHOWS} & {*rest}:
        return [], 0
    settings = [one for one in rest if is_setting(one)]
    folders = [f"file://{Path(arguments.config_dir).resolve()}"] if arguments.config_dir else []
    name, found = arguments.config_name or config_name, []
    with initialized():
        for overrides in single_runs(asked := with_search_path(settings, folders)):
            found.append(config := compose_data(overrides, name, with_hydra=True))
            with open_dict(config):
                about = config.pop("hydra")
            check_own_objects(config)
    if about.mode is not RunMode.MULTIRUN and not {"--multirun", "-m"} & {*rest}:
        return found, 0
    swept = about.sweeper.get("params") or {}
    return found, number_of_runs([*(f"{key}={value}" for key, value in swept.items()), *asked])


def is_setting(argument: str) -> bool:
    """Whether an argument of a command line states a setting, or removes one, and is no option of Hydra's."""
    return argument.startswith("~") or ("=" in argument and not argument.startswith("-"))


def check_own_objects(config: DictConfig) -> None:
    """Raises :class:`ConfigError` if a module or attribute that names levels, the task or the observation does not exist."""
    for place in ("levels.test", *OWN_NAMES.values()):
        with unreadable_told():
            name = OmegaConf.select(config, place)
        if isinstance(name, str) and ":" in name:
            import_object(name, place)


def compose(overrides: Sequence[str] = (), config_name: str = "config") -> RunConfig:
    """The settings that overrides state, as a command line would; raises :class:`SegarError`.

    In a command that runs, groups are looked for where that command looks, its ``hydra.searchpath`` included.
    """
    register_settings()
    with initialized():
        folders = list(HydraConfig.get().searchpath) if HydraConfig.initialized() else []
        return build_run(compose_data(with_search_path(with_own_names(overrides), folders), config_name))


def initialized() -> AbstractContextManager[Any]:
    """A block in which Hydra composes from ``conf/``: that of the command that runs, else a new one."""
    if GlobalHydra.instance().is_initialized():
        return nullcontext()
    return hydra.initialize_config_dir(str(CONF), version_base="1.3")


def compose_data(overrides: Sequence[str], config_name: str, with_hydra: bool = False) -> DictConfig:
    """Hydra's result, with the settings of Hydra if they are wanted; raises :class:`ConfigError` that names the culprit."""
    with unreadable_told():
        try:
            return hydra.compose(config_name, list(overrides), return_hydra_config=with_hydra)
        except (CompactHydraException, ValueError) as error:  # the latter of a choice that is no text
            raise ConfigError(explain_overrides(error, overrides, config_name)) from error


def build_run(config: DictConfig) -> RunConfig:
    """Hydra's result as a :class:`RunConfig`; nothing after this sees a ``DictConfig``. Raises :class:`ConfigError`."""
    return run_config(to_plain(config))


def to_plain(config: DictConfig) -> dict[str, Any]:
    """Hydra's result as plain data; raises :class:`ConfigError` where a setting refers to what is not there."""
    with unreadable_told():
        data = OmegaConf.to_container(config, resolve=True)
    assert isinstance(data, dict)
    return {str(key): value for key, value in data.items()}


@contextmanager
def unreadable_told() -> Iterator[None]:
    """A block in which :class:`ConfigError` says which settings cannot be read: by their file, or by what they refer to."""
    try:
        yield
    except (OmegaConfBaseException, YAMLError, UnicodeDecodeError, RecursionError) as error:
        text = f", in the file with {error.object[:40]!r}" if isinstance(error, UnicodeDecodeError) else ""
        raise ConfigError(f"settings cannot be read: {' '.join(str(error).split())}{text}") from error


@contextmanager
def errors_as_messages() -> Iterator[None]:
    """A block that ends the command with 1 and one message where a user can mend what went wrong.

    Where the user wants tracebacks, the error itself leaves the block.
    """
    try:
        yield
    except SegarError as error:
        if wants_full_error():
            raise
        sys.exit(f"error: {error_message(error)}")


def error_message(error: Exception) -> str:
    """The text of an error with its notes."""
    return "\n".join([str(error), *getattr(error, "__notes__", ())])


def wants_full_error() -> bool:
    """Whether the user wants tracebacks, as Hydra has it."""
    return os.environ.get("HYDRA_FULL_ERROR") == "1"
