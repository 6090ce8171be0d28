"""The errors that SEGAR raises, and the nearest known name for their messages."""

import difflib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

LONGEST_NAME = 200  # [characters] of a name that is compared with others; comparing takes time


class SegarError(ValueError):
    """Base of all errors that a user's input can cause."""


class FactorError(SegarError):
    """A factor, entity or shape is declared or used wrongly."""


class RuleError(SegarError):
    """A rule cannot be understood, which is raised where it is defined or the world is built; or a number that rules
    change is not finite after a step."""


class ConflictError(SegarError):
    """Two rules set one factor to different values and neither is more specific."""


class PriorError(SegarError):
    """Priors contradict each other, or name something that no entity has."""


class PlacementError(SegarError):
    """Entities cannot be placed as the level distribution requires."""


class LevelError(SegarError):
    """Levels or a level file cannot be used in this way."""


class SuiteError(SegarError):
    """There is no such suite, or a file of it is not what it was when the suite was frozen."""


class ActionError(SegarError):
    """An action has the wrong shape or is not finite."""


class UnknownOptionError(SegarError, TypeError):
    """Something has no option of this name; a ``TypeError``, too, as Python raises for the arguments of functions."""


class UnseenDifferenceWarning(UserWarning):
    """Level sets differ in something that the distance between them does not see."""


@contextmanager
def naming(place: object, kind: type[SegarError] = SegarError) -> Iterator[None]:
    """Have an error of SEGAR inside the block begin with the place that it concerns, and be of this ``kind``."""
    try:
        yield
    except SegarError as cause:
        raise kind(f"{place}: {cause}") from cause


def did_you_mean(name: object, names: Iterable[str], listed: Iterable[str] | None = None) -> str:
    """Return ``" Did you mean 'x'?"`` for the nearest of ``names``, or the list of names when none is near; ``listed`` says
    which, where they are too many."""
    names = sorted(set(names))
    near = difflib.get_close_matches(str(name)[:LONGEST_NAME], names, n=1, cutoff=0.5)
    if near:
        return f" Did you mean '{near[0]}'?"
    shown = names if listed is None else sorted(set(listed))
    return f" Known: {', '.join(shown)}." if shown else ""


def must_be(value: object, known: Iterable[str | None]) -> str:
    """Return ``"must be 'a' or 'b', not 'c'."``, and which one was meant."""
    known = list(known)
    return f"must be {' or '.join(map(repr, known))}, not {value!r}.{did_you_mean(str(value), map(str, known))}"
