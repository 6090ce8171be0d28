"""Source of loops over groups of slots, and of the tests that an entity matches."""

from collections.abc import Iterator
from contextlib import contextmanager

from segar.engine.compiler.emit import Writer
from segar.engine.compiler.spec import Group

VARIABLES = ("i", "j", "k")


@contextmanager
def over_group(w: Writer, group: Group, variable: str) -> Iterator[None]:
    """A loop over the group's slots, or a plain assignment where there is one."""
    if group.is_single:
        with w.scope():
            w.line(f"{variable} = {group.slots[0]}")
            yield
    else:
        with w.block(f"for {variable} in {group.loop}:"):
            yield


@contextmanager
def condition(w: Writer, test: str) -> Iterator[None]:
    """An ``if`` block, or nothing but a scope where the test is empty."""
    if test:
        with w.block(f"if {test}:"):
            yield
    else:
        with w.scope():
            yield


def match_test(variable: str, mask: int) -> str:
    """Source of the test that an entity's bits include the mask; empty for no test."""
    return f"(bits[{variable}] & {mask}) == {mask}" if mask else ""


def both(*tests: str) -> str:
    """The conjunction of the tests that are not empty."""
    return " and ".join(t for t in tests if t)


def share(a: Group, b: Group) -> bool:
    """Whether some slot is in both groups."""
    return not set(a.slots).isdisjoint(b.slots)
