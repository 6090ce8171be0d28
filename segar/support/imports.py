"""Python objects by their names: what ``module:attribute`` means on a command line, in a configuration or in levels."""

import importlib
from typing import Any

from segar.errors import SegarError, did_you_mean


def named_object(name: str) -> Any:
    """The object that ``module:attribute`` names; the attribute may have dots.

    Raises:
        SegarError: the name has another form, the module cannot be imported, or it has no such attribute.
    """
    module, _, attribute = name.partition(":")
    if not module or not attribute:
        raise SegarError(f"'{name}' does not name a Python object; write module:attribute")
    try:
        found: Any = importlib.import_module(module)
    except (ImportError, SegarError) as error:
        raise SegarError(f"'{name}' cannot be imported: {error}") from error
    for part in attribute.split("."):
        if not hasattr(found, part):
            raise SegarError(f"'{module}' has no '{part}'.{did_you_mean(part, vars(found))}")
        found = getattr(found, part)
    return found
