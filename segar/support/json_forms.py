"""Checks of data from JSON files that others made: whether it has the form that its reader takes for granted."""

import json
import math
from collections.abc import Mapping
from typing import Any

LARGEST_INTEGER = 2**64  # in size; larger ones have no place in an array


def from_json(text: bytes) -> Any:
    """The data in a JSON text.

    Raises:
        ValueError: it is no JSON text, or nested too deeply.
    """
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def misfit(value: Any, form: Any, at: str = "") -> str | None:
    """What is wrong with data from a JSON text, in words that name the place; None where it has the form.

    A form is a class (``str``, ``bool``, ``int``, ``float``: any finite number), ``None``, a tuple of forms (one of
    which must fit), a list of one form (a list of any length), or a mapping: of keys to forms, where a key that ends in
    ``?`` may be absent and further keys are left aside, or of the class ``str`` to one form, for any keys.

    >>> misfit({"seed": "3"}, {"seed": int})
    "'seed' must be int, not '3'"
    """
    if isinstance(form, tuple):
        return None if any(misfit(value, one, at) is None for one in form) else _wrong(value, form, at)
    if isinstance(form, list):
        if not isinstance(value, list):
            return _wrong(value, form, at)
        found = (misfit(item, form[0], f"{at}[{k}]") for k, item in enumerate(value))
        return next((wrong for wrong in found if wrong), None)
    if isinstance(form, Mapping):
        return _misfit_of_mapping(value, form, at)
    fits = value is None if form is None else _is(value, form)
    return None if fits else _wrong(value, form, at)


def _misfit_of_mapping(value: Any, form: Mapping[Any, Any], at: str) -> str | None:
    if not isinstance(value, dict):
        return _wrong(value, form, at)
    if str in form:
        parts = [(f"{at}.{key}".lstrip("."), item, form[str]) for key, item in value.items()]
    else:
        names = {key.removesuffix("?"): part for key, part in form.items()}
        absent = [key for key in form if not key.endswith("?") and key not in value]
        if absent:
            return f"'{f'{at}.{absent[0]}'.lstrip('.')}' is absent"
        parts = [(f"{at}.{key}".lstrip("."), value[key], part) for key, part in names.items() if key in value]
    return next((wrong for place, item, part in parts if (wrong := misfit(item, part, place))), None)


def _is(value: Any, kind: type) -> bool:
    if kind is float:
        return isinstance(value, (int, float)) and not isinstance(value, bool) and _is_finite(value)
    if kind is int:
        return isinstance(value, int) and not isinstance(value, bool) and abs(value) < LARGEST_INTEGER
    return isinstance(value, kind)


def _is_finite(value: int | float) -> bool:
    return abs(value) < LARGEST_INTEGER if isinstance(value, int) else math.isfinite(value)


def _wrong(value: Any, form: Any, at: str) -> str:
    shown = repr(value)
    return f"'{at or 'all'}' must be {_said(form)}, not {shown if len(shown) < 60 else shown[:60] + '...'}"


def _said(form: Any) -> str:
    if isinstance(form, tuple):
        return " or ".join(map(_said, form))
    if isinstance(form, list):
        return f"a list of {_said(form[0])}"
    if isinstance(form, Mapping):
        return "a mapping"
    return "null" if form is None else form.__name__
