"""Checks of data from JSON files that others made: whether it has the form that its reader takes for granted."""

import csv
import json
import math
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from segar.errors import SegarError, did_you_mean
from segar.support.npz import damage_told
from segar.support.reading import LIMIT, content_of

LARGEST_INTEGER = 2**64  # in size; larger ones have no place in an array
LONGEST_SHOWN = 60  # [characters] of a wrong value in a message


def from_json(text: bytes, **hooks: Any) -> Any:
    """The data in a JSON text; ``hooks`` are those of :func:`json.loads`.

    Raises:
        ValueError: it is no JSON text, or nested too deeply.
    """
    try:
        return json.loads(text, **hooks)
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
        return from_json(text, parse_int=_whole_number, object_pairs_hook=_mapping)
    except UnicodeDecodeError as error:
        raise ValueError(f"it is no text in UTF-8: {error.reason}, byte {error.start + 1}") from error


def from_csv(text: bytes, columns: tuple[str, ...]) -> list[dict[str, str]]:
    """The rows of a CSV text; raises :class:`ValueError` where it is none with these columns."""
    try:
        reader = csv.DictReader(text.decode("utf-8-sig").splitlines(), strict=True)
        rows = list(reader)
    except csv.Error as error:
        raise ValueError(str(error)) from error
    lacking = [number for number, row in enumerate(rows, 2) if None in (*row, *row.values())]
    if tuple(reader.fieldnames or ()) != columns or lacking:
        raise ValueError(f"line {(lacking or [1])[0]} must have {', '.join(columns)}")
    return rows


def data_in(
    path: Path,
    kind: str,
    error: type[SegarError],
    parse: Callable[[bytes], Any] = from_json,
    limit: int = LIMIT,
    form: Any = object,
    only: bool = False,
    advice: str = "",
) -> Any:
    """The data in a file.

    Args:
        kind: what it should be, as "a level file".
        parse: the function for its text, which raises :class:`ValueError`; :func:`from_handwritten_json` for JSON that people
            may have written.
        limit: [bytes] that it may have; see :func:`segar.support.reading.content_of`.
        form, only: what the data must be; see :func:`misfit`.
        advice: how the messages end.

    Raises:
        SegarError: of the class ``error``: there is no such file, it is too large, it is no such text, or the data are of
            another form; the message names the place.
    """
    text = content_of(path, kind.removeprefix("a ").removesuffix(" in JSON"), error, limit)
    with damage_told(lambda why: error(f"{path} is not {kind}, or only part of one: {why}{advice}")):
        data = parse(text)
    if wrong := misfit(data, form, only=only):
        raise error(f"{path}: {wrong}{advice}")
    return data


def shown(value: Any) -> str:
    """A value from a JSON text in short, for messages: one line, whatever it is."""
    if isinstance(value, (list, dict)):
        return f"a {'list' if isinstance(value, list) else 'mapping'} of {len(value)}"
    text = ascii(value)
    return text if len(text) <= LONGEST_SHOWN else text[:LONGEST_SHOWN] + "..."


def require_form(value: Any, form: Any, at: str = "", only: bool = False) -> None:
    """Raise :class:`SegarError` unless data from a JSON text have the form; see :func:`misfit`."""
    if wrong := misfit(value, form, at, only):
        raise SegarError(wrong)


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
        found = [misfit(value, one, at, only) for one in form]
        within = [
            wrong for one, wrong in zip(form, found, strict=True) if isinstance(one, list) and isinstance(value, list)
        ]
        return None if None in found else next(iter(within), _wrong(value, form, at))
    if isinstance(form, list):
        if not isinstance(value, list):
            return _wrong(value, form, at)
        items = (misfit(item, form[0], f"{at}[{k}]", only) for k, item in enumerate(value))
        return next((wrong for wrong in items if wrong), None)
    if isinstance(form, Mapping):
        return _misfit_of_mapping(value, form, at, only)
    fits = value is None if form is None else _is(value, form)
    return None if fits else _wrong(value, form, at)


def check_form(
    where: str, data: Any, kind: str, name: str, version: int, form: Mapping[str, Any], error: type[SegarError]
) -> None:
    """Raise an error unless data from a JSON text have the format ``name``, in a version that can be read, and the form.

    Args:
        where: the file, and the place in it.
        kind: what the data should be, as "a level file in JSON".
    """
    found = data.get("format") if isinstance(data, dict) else data
    if found != name:
        raise error(f"{where} is not {kind}, whose 'format' is '{name}'; there is {shown(found)}")
    wrong = misfit(data, {"version": int})
    if wrong is None and data["version"] < 1:
        wrong = f"'version' must be 1 to {version}, not {data['version']}"
    if wrong is None and data["version"] > version:
        raise error(
            f"{where} has version {data['version']} of its format, and this SEGAR reads up to {version}; install a newer one"
        )
    if wrong := wrong or misfit(data, form, only=True):
        raise error(f"{where}: {wrong}")


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
        names = {key: key if key.isidentifier() else shown(key) for key in value}
        parts = [(f"{at}.{names[key]}".lstrip("."), item, form[str]) for key, item in value.items()]
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
    if kind not in (int, float):
        return isinstance(value, kind)
    if isinstance(value, int):
        return not isinstance(value, bool) and abs(value) < LARGEST_INTEGER
    return isinstance(value, kind) and math.isfinite(value)


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
