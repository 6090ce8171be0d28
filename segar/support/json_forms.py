"""Checks of data from JSON files that others made: whether it has the form that its reader takes for granted."""

import json
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from segar.errors import SegarError, did_you_mean
from segar.support.npz import first_line

LARGEST_INTEGER = 2**64  # in size; larger ones have no place in an array
STEP = re.compile(r"\[(\d+)\]|'([^']*)'|(\w+)")  # of a place: an index, an odd name, a name
LONGEST_SHOWN = 60  # [characters] of a wrong value in a message


def from_json(text: bytes) -> Any:
    """The data in a JSON text.

    Raises:
        ValueError: it is no JSON text, or nested too deeply.
    """
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def from_handwritten_json(text: bytes) -> Any:
    """The data in a JSON text that people may have written, with each number as it stands there.

    ``-0`` is the number -0.0, and whole numbers that int64 does not hold become float. NaN and Infinity, which are not
    JSON, become numbers that are not finite: the reader says where they stand.

    Raises:
        ValueError: it is no JSON text (the message has line and column), is nested too deeply, or a key stands twice in
            one mapping.
    """
    try:
        return json.loads(text, parse_int=_whole_number, object_pairs_hook=_mapping)
    except UnicodeDecodeError as error:
        raise ValueError(f"it is no text in UTF-8: {error.reason}, byte {error.start + 1}") from error
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def read_handwritten_json(path: Path, kind: str, error: type[SegarError]) -> Any:
    """The data in a JSON file that people may have written; ``kind`` says what it should be, as "a level file".

    Raises:
        SegarError: of the class ``error``: there is no such file, or it is no JSON.
    """
    if not path.exists():
        raise error(f"there is no {kind.removeprefix('a ').removesuffix(' in JSON')} {path}")
    try:
        return from_handwritten_json(path.read_bytes())
    except (ValueError, OSError) as cause:
        raise error(f"{path} is not {kind}, or only part of one: {first_line(cause)}") from cause


def with_line(path: Path, message: str, steps: Sequence[str | int] = ()) -> str:
    """A message about a JSON file, with the line of the place that it names behind it; as it is where it names none.

    ``steps``, keys and indices, lead to the place where they are given. Else a place is written as
    ``levels[0].entities.goal.factors``; a key in quotation marks after it is looked for there.
    """
    found = re.match(rf"{re.escape(str(path))}: ((?:\w+|\['[^']*'\]|'[^']*'|\[\d+\]|\.)+): (.*)", message, re.S)
    if found is None and not steps:
        return message
    named = None
    if found is not None and not steps:
        steps = [int(k) if k else name or odd for k, odd, name in STEP.findall(found[1])]
        named = re.search(r"'([^']*)'", found[2])
    try:
        text = path.read_text(encoding="utf-8")
        at = next(
            p for p in (place_of(text, [*steps, named[1]] if named else steps), place_of(text, steps)) if p is not None
        )
    except (OSError, ValueError, StopIteration, RecursionError):
        return message
    return f"{message} (line {text.count(chr(10), 0, at) + 1})"


def place_of(text: str, steps: Sequence[str | int]) -> int | None:
    """Where the part of a JSON text starts that these keys and indices lead to; None where they lead nowhere.

    Raises:
        ValueError: it is no JSON text.
    """
    decoder, at = json.JSONDecoder(), _blank(text, 0)
    for step in steps:
        if text[at] != ("[" if isinstance(step, int) else "{"):
            return None
        at, count = _blank(text, at + 1), 0
        while True:
            if text[at] in "]}":
                return None
            start, key = at, None
            if isinstance(step, str):
                key, at = decoder.raw_decode(text, at)
                at = _blank(text, _blank(text, at) + 1)
            if step == (count if key is None else key):
                at = start if step is steps[-1] else at
                break
            _, at = decoder.raw_decode(text, at)
            at, count = _blank(text, at), count + 1
            at = _blank(text, at + 1) if text[at] == "," else at
    return at


def _blank(text: str, at: int) -> int:
    """The place of the next character that is no blank."""
    while text[at : at + 1].isspace():
        at += 1
    return at


def shown(value: Any) -> str:
    """A value from a JSON text in short, for messages: one line, whatever it is."""
    if isinstance(value, (list, dict)):
        return f"a {'list' if isinstance(value, list) else 'mapping'} of {len(value)}"
    text = ascii(value)
    return text if len(text) <= LONGEST_SHOWN else text[:LONGEST_SHOWN] + "..."


def misfit(value: Any, form: Any, at: str = "", only: bool = False) -> str | None:
    """What is wrong with data from a JSON text, in words that name the place; None where it has the form.

    A form is a class (``str``, ``bool``, ``int``, ``float``: any finite number), ``None``, a tuple of forms (one of
    which must fit), a list of one form (a list of any length), or a mapping: of keys to forms, where a key that ends in
    ``?`` may be absent and further keys are left aside (with ``only``, they do not fit), or of the class ``str`` to one
    form, for any keys.

    >>> misfit({"seed": "3"}, {"seed": int})
    "'seed' must be int, not '3'"
    """
    if isinstance(form, tuple):
        return None if any(misfit(value, one, at, only) is None for one in form) else _wrong(value, form, at)
    if isinstance(form, list):
        if not isinstance(value, list):
            return _wrong(value, form, at)
        found = (misfit(item, form[0], f"{at}[{k}]", only) for k, item in enumerate(value))
        return next((wrong for wrong in found if wrong), None)
    if isinstance(form, Mapping):
        return _misfit_of_mapping(value, form, at, only)
    fits = value is None if form is None else _is(value, form)
    return None if fits else _wrong(value, form, at)


def _whole_number(digits: str) -> int | float:
    if digits == "-0":
        return -0.0
    number = float(digits)  # first: int refuses very many digits
    return int(digits) if abs(number) < 2.0**63 else number


def _mapping(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        [(twice, _)] = Counter(name for name, _ in pairs).most_common(1)
        raise ValueError(f"the key {shown(twice)} stands twice in one mapping, which begins with {shown(pairs[0][0])}")
    return found


def _misfit_of_mapping(value: Any, form: Mapping[Any, Any], at: str, only: bool) -> str | None:
    if not isinstance(value, dict):
        return _wrong(value, form, at)
    if str in form:
        parts = [(f"{at}.{key}".lstrip("."), item, form[str]) for key, item in value.items()]
    else:
        names = {key.removesuffix("?"): part for key, part in form.items()}
        absent = [key for key in form if not key.endswith("?") and key not in value]
        if absent:
            return f"'{f'{at}.{absent[0]}'.lstrip('.')}' is absent"
        for key in value if only else ():
            if key not in names:
                return f"{shown(f'{at}.{key}'.lstrip('.'))} is not known.{did_you_mean(key, names)}"
        parts = [(f"{at}.{key}".lstrip("."), value[key], part) for key, part in names.items() if key in value]
    return next((wrong for place, item, part in parts if (wrong := misfit(item, part, place, only))), None)


def _is(value: Any, kind: type) -> bool:
    if kind is float:
        return isinstance(value, (int, float)) and not isinstance(value, bool) and _is_finite(value)
    if kind is int:
        return isinstance(value, int) and not isinstance(value, bool) and abs(value) < LARGEST_INTEGER
    return isinstance(value, kind)


def _is_finite(value: int | float) -> bool:
    return abs(value) < LARGEST_INTEGER if isinstance(value, int) else math.isfinite(value)


def _wrong(value: Any, form: Any, at: str) -> str:
    return f"'{at or 'all'}' must be {_said(form)}, not {shown(value)}"


def _said(form: Any) -> str:
    if isinstance(form, tuple):
        return " or ".join(map(_said, form))
    if isinstance(form, list):
        return f"a list of {_said(form[0])}"
    if isinstance(form, Mapping):
        return "a mapping"
    return "null" if form is None else form.__name__
