"""The command line of a study: its function ``run``, with an option for each argument."""

import argparse
import inspect
from collections.abc import Callable


def run_from_command_line(run: Callable[..., None]) -> None:
    """Calls ``run`` of the module that was started with what the command line says.

    Each argument of ``run`` is an option of its name, with its default and of its default's type; ``-o`` is ``--output``.
    """
    module = inspect.getmodule(run)
    spec = getattr(module, "__spec__", None)
    parser = argparse.ArgumentParser(
        prog=f"python -m {spec.name}" if spec else None,
        description=module.__doc__ if module else None,
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    for name, argument in inspect.signature(run).parameters.items():
        flags = ("-o", "--output") if name == "output" else (f"--{name}",)
        parser.add_argument(*flags, type=type(argument.default), default=argument.default, help=" ")
    run(**vars(parser.parse_args()))
